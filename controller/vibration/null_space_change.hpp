#pragma once
#include <dashpot/controller/dynamics.hpp>
#include <dashpot/controller/law/null_space.hpp>

namespace dashpot::controller {

/// How the null space's projector N' and J# = M^-1 J' (J M^-1 J')^-1 change with q, where no gains
/// change and the arm is not nearly singular. With G = H (H J M^-1 J' H)^-1 H of the selected
/// directions H, dJ_k = dJ/dq_k and dM_k = dM/dq_k,
///     d(J# V)/dq_k = M^-1 N' (dJ_k' G V - dM_k J# V) - J# dJ_k J# V
///     d(N' t)/dq_k = -N' dJ_k' h - J' G dJ_k z + (1 - N') dM_k z,    h = G J M^-1 t, z = M^-1 N'
///     t.
/// Where the selected directions turn with the tool, dJ_k is less by the turning of J's rows.
class NullSpaceChange {
 public:
  /// All arguments have to outlive this; `robot` and `null_space` are those of the kernel at `q`.
  NullSpaceChange(const DynamicsKernel& kernel, const JointVector& q, const DynamicsResult& robot,
                  const NullSpace& null_space, bool in_tool_axes) noexcept
      : kernel_(kernel), q_(q), robot_(robot), null_space_(null_space), tool_(in_tool_axes) {}

  /// Returns d(J# V)/dq, n x n, for a V that is constant in the axes of the selected directions.
  JointMatrix of_joint_velocity(const Vector6& V) const noexcept;
  /// Returns d(N' t)/dq, n x n, for constant t.
  JointMatrix of_torque(const JointVector& t) const noexcept;
  /// Returns what turns V, constant in the axes of the selected directions, as joint k moves.
  Vector6 turning(const Vector6& V, Eigen::Index k) const noexcept;

  /// Returns d(J x)/dq (6 x n) for constant x, in the axes of the selected directions.
  Jacobian twists(const JointVector& x) const noexcept;
  const NullSpace& null_space() const noexcept { return null_space_; }

 private:
  /// (dJ/dq_k)' F by columns
  JointMatrix torques(const Vector6& F) const noexcept;

  const DynamicsKernel& kernel_;
  const JointVector& q_;
  const DynamicsResult& robot_;
  const NullSpace& null_space_;
  bool tool_;
};

}  // namespace dashpot::controller
