// Compiled in four parts, to share the work.
#include <dashpot/controller/core/fixed_core_analysis.hpp>
#include <dashpot/controller/core/fixed_core_motion.hpp>

namespace dashpot::controller {

template class FixedCore<1>;
template class FixedCore<2>;
template class FixedCore<3>;
template class FixedCore<4>;

}  // namespace dashpot::controller
