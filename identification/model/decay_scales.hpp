#pragma once
#include <dashpot/identification/model/decay_data.hpp>

#include <vector>

namespace dashpot::identification {

/// Gives factors without scales the scales that best fit the amplitudes that each record has by
/// itself. `noise` has each channel's noise.
void find_scales(const DecayData& data, const Eigen::VectorXd& noise,
                 std::vector<DecayFactor>& factors);

}  // namespace dashpot::identification
