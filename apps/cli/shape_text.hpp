#pragma once
#include <Eigen/Core>
#include <cstddef>
#include <string>

namespace dashpot::apps {

/// "q1" for the first coordinate, i = 0.
std::string joint_name(Eigen::Index i);

/// "q2 - 0.43 q5 + 0.21 q1 (95 deg)": entries relative to the largest, by falling size, without the
/// small ones; with the phase where an entry is not in step with the largest. At most `width`
/// characters, where the numbers allow it.
std::string format_shape(const Eigen::VectorXcd& shape, std::size_t width);

}  // namespace dashpot::apps
