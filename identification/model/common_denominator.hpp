#pragma once
#include <dashpot/identification/model/realization.hpp>
#include <dashpot/identification/motion_record.hpp>

#include <vector>

namespace dashpot::identification {

/// Poles of models from inputs to outputs of rising order, from order 1: least squares in the
/// frequency domain with one denominator for all channels (LSCF, Guillaume et al. 2003),
///
///     A(z) Y(f) = sum of B_i(z) U_i(f) + T_r(z),
///
/// on the spectra of whole records r, up to `highest` (rad/s). The polynomials T_r describe the
/// beginning and end of a record (leakage), so no window is needed. The records are evenly spaced
/// by `step` (s), their channels of like noise, without missing samples.
std::vector<std::vector<RealizedPole>> common_denominator_poles(
    const std::vector<MotionRecord>& records, double step, int max_order, double highest);

}  // namespace dashpot::identification
