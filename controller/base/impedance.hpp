#pragma once
#include <dashpot/controller/robot_types.hpp>

namespace dashpot::controller {

/// Springs and dampers at the tip, and how much of each direction is selected (0 to 1), in the axes
/// of one frame.
struct TipImpedance {
  Matrix6 stiffness = Matrix6::Zero();
  Matrix6 damping = Matrix6::Zero();
  Vector6 selected = Vector6::Zero();

  bool none() const noexcept { return (selected.array() == 0).all(); }
};

/// Springs and dampers of every mode and frame at once; inactive springs and dampers are zero.
/// Weighted means of two impedances are impedances, and their matrices stay positive semidefinite.
struct Impedance {
  double joint_weight = 0;         ///< share of the joint springs
  double task_weight = 0;          ///< share of the Cartesian springs
  double damping_ratio = 0;        ///< designed for the tip's springs, beside `damping`
  double joint_damping_ratio = 0;  ///< for the joints' springs, beside `joint_damping`
  double null_damping_ratio = 0;   ///< for the null space's springs, beside `null_damping`
  double common_ratio = 0;         ///< share of the tip's springs that null_damping_ratio is for
  std::array<double, 4> projectors{1};  ///< share of each NullProjector
  TipImpedance base;                    ///< in B's axes
  TipImpedance tool;                    ///< in T's axes
  JointVector null_stiffness;
  JointVector null_damping;
  JointMatrix joint_stiffness;
  JointMatrix joint_damping;

  /// No springs and dampers for n joints.
  explicit Impedance(int n);
  /// The impedance that a set-point asks for, which is valid for n joints. Directions that are not
  /// selected have no springs and dampers. There are no null-space springs and dampers unless there
  /// are more joints than selected directions, or no projector. With a damping ratio the dampers
  /// given act only where there is no spring: on joints and in directions whose row of the
  /// stiffness is zero, and in the null space if all its stiffness is zero.
  Impedance(const Setpoint& setpoint, int n) noexcept;

  /// Returns the share of the Cartesian springs in all active springs, 1 if there are no others.
  double task_share() const noexcept { return task_weight / (task_weight + joint_weight); }
  /// Returns the share of a projector.
  double share(NullProjector projector) const noexcept {
    return projectors[static_cast<std::size_t>(projector)];
  }
  /// Returns true if there are springs or dampers in the null space.
  bool null_space() const noexcept;
};

/// Returns diag(R, R) K diag(R, R)': K in the tool's axes, turned into B's axes.
Matrix6 turned(const Matrix6& K, const Eigen::Matrix3d& R) noexcept;

/// Returns a + s (b - a) for 0 <= s <= 1, exactly b for s = 1.
Vector6 blend(const Vector6& a, const Vector6& b, double s) noexcept;
Impedance blend(const Impedance& a, const Impedance& b, double s) noexcept;

}  // namespace dashpot::controller
