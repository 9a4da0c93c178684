#pragma once
#include <dashpot/controller/robot_model.hpp>

namespace dashpot::controller {

/// Terms of  M(q) qdd + coriolis + gravity = torque + J' wrench  at one state, and where the tip is.
/// For n joints; N is n, known at compile time, or at most kMaxJoints (see DynamicsResult).
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

/// The same with n chosen at run time, in fixed storage.
struct DynamicsResult {
  JointMatrix M;         ///< n x n
  JointVector coriolis;  ///< n
  JointVector gravity;   ///< n
  Eigen::Matrix<double, 6, Eigen::Dynamic, Eigen::ColMajor, 6, kMaxJoints> J;  ///< 6 x n
  Vector6 Jdot_qd;
  Eigen::Vector3d p_BT_B;
  Eigen::Matrix3d R_BT;
};

/// Computes all of Dynamics<N> in one pass over a chain of N joints, N from 1 to kMaxJoints.
template <int N>
class DynamicsKernel {
 public:
  /// Throws std::invalid_argument unless the model has N joints.
  explicit DynamicsKernel(const RobotModel& model);

  /// q in rad (m), qd in rad/s (m/s). Allocates nothing; what is not finite in q or qd makes the
  /// result so.
  void evaluate(const Eigen::Matrix<double, N, 1>& q, const Eigen::Matrix<double, N, 1>& qd,
                Dynamics<N>& result) const noexcept;
};

/// For set-up and tests: chooses the kernel at each call. Throws std::invalid_argument unless q and
/// qd have n entries.
DynamicsResult evaluate(const RobotModel& model, const JointVector& q, const JointVector& qd);

}  // namespace dashpot::controller
