// Compiled in four parts, to share the work.
#include <dashpot/controller/core/fixed_core_analysis.hpp>
#include <dashpot/controller/core/fixed_core_motion.hpp>

namespace dashpot::controller {

template class FixedCore<9>;
template class FixedCore<10>;
template class FixedCore<11>;
template class FixedCore<12>;

}  // namespace dashpot::controller
