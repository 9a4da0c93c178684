#pragma once
#include <dashpot/controller/base/impedance.hpp>

#include <string>

namespace dashpot::controller {

/// Throws std::invalid_argument with the message unless the condition holds.
void require(bool condition, const std::string& message);

/// Returns the rank of a stiffness (k x k). Throws std::invalid_argument, with its name, unless it
/// is positive semidefinite.
int checked_rank(const std::string& name, const Eigen::MatrixXd& stiffness);

/// How a controller means its gains, see AuditOptions.
struct StatedGains {
  Mode mode;
  bool half_quaternion, inertia_blocks;
};

/// Returns the springs and dampers as stated, in force, for n joints. Throws std::invalid_argument,
/// with the member's name and the reason.
Impedance stated_impedance(const Gains& gains, const StatedGains& stated, int n);

}  // namespace dashpot::controller
