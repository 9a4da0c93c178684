#pragma once
#include <dashpot/identification/identification.hpp>

#include <optional>
#include <vector>

namespace dashpot::identification {

/// The mode of free decays of one channel that rubs with Coulomb friction (Feeny and Liang 1996):
/// y'' + 2 zeta omega y' + omega^2 (y - rest + friction sign(y')) = 0, linear from one turn to the
/// next. omega, zeta and friction are common to the first eight records, of which each may drift.
/// The exact solution is fitted to the samples by least squares, as far as the motion is large
/// beside the friction, which varies at small speeds. Hums are removed where they hide it.
///
/// None if the residual is not white. The mode is among the rejected if no record has four turns,
/// or if frequency, ratio or friction are not determined.
std::optional<Identification> identify_rubbing(const std::vector<MotionRecord>& records);

}  // namespace dashpot::identification
