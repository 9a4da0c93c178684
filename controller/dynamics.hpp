#pragma once
#include <dashpot/controller/attachment.hpp>

#include <array>

namespace dashpot::controller {

/// Terms of  M(q) qdd + coriolis + gravity = torque + J' wrench  at one state, and the pose of the
/// tip.
struct DynamicsResult {
  JointMatrix M;           ///< n x n, kg m^2; symmetric positive definite
  JointVector coriolis;    ///< n, C(q, qd) qd, N m
  JointVector gravity;     ///< n, gradient of the potential energy, N m
  Jacobian J;              ///< 6 x n, tip's twist = J qd: linear, angular; B's axes
  Vector6 Jdot_qd;         ///< tip's acceleration at qdd = 0, m/s^2 and rad/s^2
  Eigen::Vector3d p_BT_B;  ///< m
  Eigen::Matrix3d R_BT;
};

/// Computes all of DynamicsResult on one way outward and one way inward along a chain of n joints,
/// four joints at a time.
///
/// Every vector is in B's axes. Link i has its frame at joint i, with the joint's axis as its z;
/// p_i is its origin, R_i its rotation, z_i the axis, and e_i leads from p_i to p_i+1, and from the
/// last joint to the tip. Outward along the chain go angular velocity w, bias angular acceleration
/// w' and bias acceleration a of p; inward come force f and moment n about p of the Newton-Euler
/// equations, and mass m, first moment h and inertia I about p of all that joint i carries:
///     w_i = w_i-1 + z_i qd_i           w'_i = w'_i-1 + w_i x z_i qd_i
///     a_i+1 = a_i + w'_i x e_i + w_i x (w_i x e_i)  [+ 2 w_i+1 x z_i+1 qd_i+1 where prismatic]
///     coriolis_i = z_i.n_i  [z_i.f_i]
/// A unit acceleration of joint i takes the force F_i = z_i x h_i [m_i z_i] and the moment
/// I_i z_i [h_i x z_i] about p_i, so
///     M_ki = J_k . (that wrench, taken at the tip), k <= i,        gravity_i = -F_i . g
/// See R. Featherstone, Rigid Body Dynamics Algorithms, 2008, chapters 5 and 6.
class DynamicsKernel {
 public:
  explicit DynamicsKernel(const RobotModel& model);

  /// From now on this is attached to the tip link. Allocates nothing.
  void attach(const Attachment& given) noexcept;

  /// Sets `result` at q (n), rad (m), and qd (n), rad/s (m/s). Allocates nothing. If q or qd is not
  /// finite, neither is the result.
  void evaluate(const JointVector& q, const JointVector& qd, DynamicsResult& result) const noexcept;

 private:
  friend class MassChange;
  /// One number for each of four joints; zeros beyond the last joint.
  using Four = std::array<double, 4>;
  /// Four links, each in its own axes.
  struct Links {
    std::array<Four, 9> rotation;      ///< from link i to link i - 1 at q = 0, by columns
    std::array<Four, 3> offset;        ///< e_i at q = 0, m
    std::array<Four, 3> next_slide;    ///< axis of joint i + 1 if prismatic, else 0
    std::array<Four, 3> first_moment;  ///< mass times centre of mass, kg m
    std::array<Four, 6> inertia;       ///< about p_i: xx yy zz xy xz yz, kg m^2
    Four mass;                         ///< kg
    Four carried_mass;                 ///< of link i and all links beyond it, kg
    Four revolute;                     ///< 1, or 0 for a prismatic joint
    Four prismatic;                    ///< 1, or 0 for a revolute joint
  };

  int n_;
  alignas(64) std::array<Links, kMaxJoints / 4> links_{};
  JointVector reflected_inertia_;
  Eigen::Vector3d first_joint_;  ///< p_1 in B at q = 0, m
  Eigen::Vector3d first_slide_;  ///< axis of joint 1 in B if prismatic, else 0
  Eigen::Matrix3d tool_;         ///< rotation from T to the last link
  Eigen::Vector3d gravity_;      ///< in B, m/s^2

  // The last link with nothing attached, in its own axes:
  double bare_mass_ = 0;
  Eigen::Vector3d bare_first_moment_;
  Eigen::Matrix3d bare_inertia_;  ///< about its origin
  Pose tip_link_;
};

/// Returns the terms at q and qd. For set-up and tests, because it makes a kernel at each call.
/// Throws std::invalid_argument unless q and qd have n entries.
DynamicsResult evaluate(const RobotModel& model, const JointVector& q, const JointVector& qd);

}  // namespace dashpot::controller
