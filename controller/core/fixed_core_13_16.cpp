// Compiled in four parts, to share the work.
#include <dashpot/controller/core/fixed_core_analysis.hpp>
#include <dashpot/controller/core/fixed_core_motion.hpp>

namespace dashpot::controller {

template class FixedCore<13>;
template class FixedCore<14>;
template class FixedCore<15>;
template class FixedCore<16>;

}  // namespace dashpot::controller
