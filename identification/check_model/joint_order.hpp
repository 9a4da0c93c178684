#pragma once
#include <dashpot/identification/check_model/weak_form.hpp>

#include <string>
#include <vector>

namespace dashpot::identification {

/// Column and sign of each joint.
struct ColumnOrder {
  std::vector<Eigen::Index> from;
  Eigen::VectorXd sign;

  explicit ColumnOrder(Eigen::Index n);
  Eigen::MatrixXd apply(const Eigen::MatrixXd& value) const;
};

/// The likely kind of the torques, and the likely order of the columns.
struct JointOrder {
  TorqueKind kind = TorqueKind::kWhole;
  ColumnOrder position, torque;

  std::vector<SmoothRun> apply(const std::vector<SmoothRun>& runs) const;
  /// Returns sentences; none: the columns fit as they are.
  std::vector<std::string> changes() const;
  /// Returns the joints, from 0, whose columns are doubted.
  std::vector<Eigen::Index> joints() const;
};

/// Tries the kinds of torque, exchanged columns and signs on a part of the motion. The given order
/// is only doubted if another one leaves a seventh of the variance at one joint, or as little at
/// several together.
JointOrder find_order(const controller::RobotModel& model, const std::vector<SmoothRun>& runs,
                      const RecordFilter& how);

}  // namespace dashpot::identification
