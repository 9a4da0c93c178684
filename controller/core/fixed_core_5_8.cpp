// Compiled in four parts, to share the work.
#include <dashpot/controller/core/fixed_core_analysis.hpp>
#include <dashpot/controller/core/fixed_core_motion.hpp>

namespace dashpot::controller {

template class FixedCore<5>;
template class FixedCore<6>;
template class FixedCore<7>;
template class FixedCore<8>;

}  // namespace dashpot::controller
