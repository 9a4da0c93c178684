#pragma once
#include <dashpot/controller/robot_model.hpp>

#include <array>

namespace dashpot::controller {

/// Terms of  M(q) qdd + coriolis + gravity = torque + J' wrench  at one state, and the pose of the
/// tip. N is the number of joints n, known at compile time; DynamicsResult is for n chosen at run
/// time.
template <int N>
struct Dynamics {
  Eigen::Matrix<double, N, N> M;         ///< n x n, kg m^2; symmetric positive definite
  Eigen::Matrix<double, N, 1> coriolis;  ///< n, C(q, qd) qd, N m
  Eigen::Matrix<double, N, 1> gravity;   ///< n, gradient of the potential energy, N m
  Eigen::Matrix<double, 6, N> J;         ///< 6 x n, tip's twist = J qd: linear, angular; B's axes
  Vector6 Jdot_qd;                       ///< tip's acceleration at qdd = 0, m/s^2 and rad/s^2
  Eigen::Vector3d p_BT_B;                ///< m
  Eigen::Matrix3d R_BT;
};

/// The same terms with n, at most kMaxJoints, chosen at run time, in fixed storage.
struct DynamicsResult {
  JointMatrix M;                                                               ///< n x n
  JointVector coriolis;                                                        ///< n
  JointVector gravity;                                                         ///< n
  Eigen::Matrix<double, 6, Eigen::Dynamic, Eigen::ColMajor, 6, kMaxJoints> J;  ///< 6 x n
  Vector6 Jdot_qd;
  Eigen::Vector3d p_BT_B;
  Eigen::Matrix3d R_BT;
};

/// Computes all of Dynamics<N> in one pass over a chain of N joints, N from 1 to kMaxJoints.
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
template <int N>
class DynamicsKernel {
 public:
  /// Throws std::invalid_argument unless the model has N joints.
  explicit DynamicsKernel(const RobotModel& model);

  /// Sets `result` at q, rad (m), and qd, rad/s (m/s). Allocates nothing. If q or qd is not finite,
  /// neither is the result.
  void evaluate(const Eigen::Matrix<double, N, 1>& q, const Eigen::Matrix<double, N, 1>& qd,
                Dynamics<N>& result) const noexcept;

 private:
  static constexpr int kPadded = (N + 3) / 4 * 4;
  /// One number for each joint, and padding of zeros.
  using Row = std::array<double, kPadded>;

  // For link i, in its own axes.
  alignas(64) std::array<Row, 9> rotation_;      ///< from link i to link i - 1 at q = 0, by columns
  alignas(64) std::array<Row, 3> offset_;        ///< e_i at q = 0, m
  alignas(64) std::array<Row, 3> next_slide_;    ///< axis of joint i + 1 if prismatic, else 0
  alignas(64) std::array<Row, 3> first_moment_;  ///< mass times centre of mass, kg m
  alignas(64) std::array<Row, 6> inertia_;       ///< about p_i: xx yy zz xy xz yz, kg m^2
  alignas(64) Row mass_;                         ///< kg
  alignas(64) Row carried_mass_;                 ///< of link i and all links beyond it, kg
  alignas(64) Row revolute_;                     ///< 1, or 0 for a prismatic joint
  alignas(64) Row prismatic_;                    ///< 1, or 0 for a revolute joint
  Eigen::Matrix<double, N, 1> reflected_inertia_;
  Eigen::Vector3d first_joint_;  ///< p_1 in B at q = 0, m
  Eigen::Vector3d first_slide_;  ///< axis of joint 1 in B if prismatic, else 0
  Eigen::Matrix3d tool_;         ///< rotation from T to the last link
  Eigen::Vector3d gravity_;      ///< in B, m/s^2
};

/// Returns the terms at q and qd. For set-up and tests, because it chooses the kernel at each call.
/// Throws std::invalid_argument unless q and qd have n entries.
DynamicsResult evaluate(const RobotModel& model, const JointVector& q, const JointVector& qd);

extern template class DynamicsKernel<1>;
extern template class DynamicsKernel<2>;
extern template class DynamicsKernel<3>;
extern template class DynamicsKernel<4>;
extern template class DynamicsKernel<5>;
extern template class DynamicsKernel<6>;
extern template class DynamicsKernel<7>;
extern template class DynamicsKernel<8>;
extern template class DynamicsKernel<9>;
extern template class DynamicsKernel<10>;
extern template class DynamicsKernel<11>;
extern template class DynamicsKernel<12>;
extern template class DynamicsKernel<13>;
extern template class DynamicsKernel<14>;
extern template class DynamicsKernel<15>;
extern template class DynamicsKernel<16>;

}  // namespace dashpot::controller
