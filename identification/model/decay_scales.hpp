#pragma once
#include <dashpot/identification/model/decay_data.hpp>

#include <vector>

namespace dashpot::identification {

/// Gives factors that have none the scales that fit best the amplitudes that each record has by
/// itself. `noise` is that of each channel.
void find_scales(const DecayData& data, const Eigen::VectorXd& noise,
                 std::vector<DecayFactor>& factors);

}  // namespace dashpot::identification
