#pragma once
#include <dashpot/controller/audit/audit_options.hpp>

#include <optional>
#include <string>

namespace dashpot::controller {

/// Throws std::invalid_argument with the message unless the condition holds.
void require(bool condition, const std::string& message);

/// Returns the rank of a stiffness (k x k). Throws std::invalid_argument, with its name, unless it
/// is positive semidefinite.
int checked_rank(const std::string& name, const Eigen::MatrixXd& stiffness);

/// Returns the active springs and dampers as stated, for n joints. Throws std::invalid_argument,
/// with the member's name and the reason.
Impedance stated_impedance(const AuditOptions& stated, int n);

/// Returns AuditOptions::settings, or the settings of a controller that designs damping for the
/// ratios of `options`; none without a ratio. Throws std::invalid_argument for a law that
/// Controller does not have.
std::optional<Settings> designing_settings(const RobotModel& model, const AuditOptions& options);

}  // namespace dashpot::controller
