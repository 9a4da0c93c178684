#pragma once
#include <dashpot/controller/dynamics.hpp>

#include <array>

namespace dashpot::controller {

/// The change of the mass matrix with the joints, at one posture. Allocates nothing.
///
/// At the tip, with the twist c_i and the composite inertia I_i of all that joint i carries, the
/// velocities V_k = sum of c_j x_j for j <= k, and the momentum W_k of all that joint k carries,
/// joint k moves everything beyond it by its twist, and leaves energies as they are. So (dM/dq_k) x
/// is
///     -(I_i c_i).(c_k x V_k)                      in row i >= k,
///     c_i.(c_k x* W_k - I_k (c_k x V_k))          in row i < k.
class MassChange {
 public:
  /// `J` is the Jacobian of DynamicsKernel::evaluate at q.
  MassChange(const DynamicsKernel& kernel, const JointVector& q, const Jacobian& J) noexcept;
  /// Returns (dM/dq) x, n x n: column k is (dM/dq_k) x.
  JointMatrix times(const JointVector& x) const noexcept;

 private:
  /// A rigid body's inertia about the tip.
  struct Body {
    double mass = 0;
    Eigen::Vector3d first_moment = Eigen::Vector3d::Zero();
    Eigen::Matrix3d second = Eigen::Matrix3d::Zero();

    /// Returns the momentum of a twist at the tip, linear first.
    Vector6 operator*(const Vector6& twist) const noexcept;
  };

  Jacobian J_;
  std::array<Body, kMaxJoints> link_, carried_;
  std::array<Vector6, kMaxJoints> momentum_;  ///< I_i c_i
};

}  // namespace dashpot::controller
