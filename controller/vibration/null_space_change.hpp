#pragma once
#include <dashpot/controller/law/null_space.hpp>
#include <dashpot/controller/model/mass_change.hpp>

#include <array>

namespace dashpot::controller {

/// Changes of the null space's projector N' and of J# = M^-1 J' (J M^-1 J')^-1 with q, while gains
/// are constant. With G = H (H J M^-1 J' H)^-1 H of the selected directions H, dJ_k = dJ/dq_k and
/// dM_k = dM/dq_k,
///     d(J# V)/dq_k = M^-1 N' (dJ_k' G V - dM_k J# V) - J# dJ_k J# V
///     d(N' t)/dq_k = -N' dJ_k' h - J' G dJ_k z + (1 - N') dM_k z,    h = J#' t, z = M^-1 N' t.
/// If the arm is nearly singular, G changes by -S_k = -TaskInertia::spread as well, which adds
///     -M^-1 J' S_k V    and    J' S_k J M^-1 t.
/// For a projector with constant weights W, M is W, and dM_k is zero. If the selected directions
/// turn with the tool, the turning of J's rows is subtracted from dJ_k. Of several projectors each
/// adds its share.
class NullSpaceChange {
 public:
  using TipMatrix = Eigen::Matrix<double, Eigen::Dynamic, 6, Eigen::ColMajor, kMaxJoints, 6>;

  /// `robot` and `null_space` come from the kernel at `q`. The projectors come from `null_space`
  /// or, if `dynamic`, the dynamic one for all that is projected.
  NullSpaceChange(const DynamicsKernel& kernel, const JointVector& q, const DynamicsResult& robot,
                  const NullSpace& null_space, bool in_tool_axes, bool dynamic = false) noexcept;

  /// Returns d(J# V)/dq, n x n, for a V that is constant in the axes of the selected directions.
  JointMatrix of_joint_velocity(const Vector6& V) const noexcept;
  /// Returns d(N' t)/dq, n x n, for constant t.
  JointMatrix of_torque(const JointVector& t) const noexcept;
  /// Returns the change of V, constant in the axes of the selected directions, as joint k moves.
  Vector6 turning(const Vector6& V, Eigen::Index k) const noexcept;
  /// Returns d(J x)/dq (6 x n) for constant x, in the axes of the selected directions.
  Jacobian twists(const JointVector& x) const noexcept;

  const TipMatrix& share() const noexcept { return share_; }                   ///< J#, n x 6
  const JointMatrix& projector() const noexcept { return torque_projector_; }  ///< N', n x n

 private:
  /// (dJ/dq_k)' F by columns
  JointMatrix torques(const Vector6& F) const noexcept;
  /// The matrices of one projector.
  struct Part {
    bool dynamic = false;
    double factor = 0;                       ///< its share
    Matrix6 inertia;                         ///< G
    TipMatrix share, tip_torque;             ///< J#, J' G
    JointMatrix mobility, projector;         ///< M^-1 N', N'
    TipMatrix moved;                         ///< M^-1 J'
    bool spreads = false;                    ///< the arm is nearly singular
    std::array<Matrix6, kMaxJoints> spread;  ///< S_k
  };
  void fill(const NullSpace& null_space, Part& part) noexcept;
  void set_spread(const NullSpace& null_space, Part& part) noexcept;
  /// (dM/dq_k x) by columns
  JointMatrix inert(const Part& part, const JointVector& x) const noexcept;

  bool tool_;
  Jacobian J_;
  MassChange mass_;
  std::array<Part, 2> parts_;
  TipMatrix share_;
  JointMatrix torque_projector_;
};

}  // namespace dashpot::controller
