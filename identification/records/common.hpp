#pragma once
#include <dashpot/analysis/matrix_types.hpp>

#include <stdexcept>
#include <string>

namespace dashpot::identification {

using Eigen::ArrayXd;
using Eigen::Index;
using Eigen::MatrixXcd;
using Eigen::MatrixXd;
using Eigen::VectorXcd;
using Eigen::VectorXd;

inline constexpr double kTiny = 1e-300;  ///< in place of a zero that would be divided by

/// Throws std::invalid_argument, "identify: message", unless the condition holds.
inline void check_that(bool condition, const std::string& message) {
  if (!condition) throw std::invalid_argument("identify: " + message);
}

}  // namespace dashpot::identification
