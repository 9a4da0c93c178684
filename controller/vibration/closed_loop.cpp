#include <dashpot/controller/vibration/closed_loop.hpp>
#include <dashpot/controller/vibration/spring_factors.hpp>

#include <Eigen/Geometry>
#include <cmath>

namespace dashpot::controller {
namespace {

using Eigen::Index;
using Eigen::Vector3d;

/// K += J1' A J2
void add_congruence(const Jacobian& J1, const Matrix6& A, const Jacobian& J2,
                    JointMatrix& K) noexcept {
  for (Index j = 0; j < K.cols(); ++j) {
    const Vector6 column_j = A * J2.col(j);
    for (Index i = 0; i < K.rows(); ++i) K(i, j) += J1.col(i).dot(column_j);
  }
}

}  // namespace

Jacobian jacobian_rate(const Jacobian& J, const JointVector& qd) noexcept {
  Jacobian rate(6, J.cols());
  Vector3d inner = Vector3d::Zero();        // sum of w_k qd_k for k <= j
  Vector3d outer = twist(J, qd).head<3>();  // sum of v_k qd_k for k > j
  for (Index j = 0; j < J.cols(); ++j) {
    const Vector3d v = J.col(j).head<3>(), w = J.col(j).tail<3>();
    inner += w * qd[j];
    outer -= v * qd[j];
    rate.col(j).head<3>() = inner.cross(v) + w.cross(outer);
    rate.col(j).tail<3>() = inner.cross(w);
  }
  return rate;
}

JointMatrix geometric_stiffness(const Jacobian& J, const Vector6& f) noexcept {
  JointMatrix K_G(J.cols(), J.cols());
  const Vector3d force = f.head<3>(), moment = f.tail<3>();
  for (Index k = 0; k < J.cols(); ++k) {
    const Vector3d v_k = J.col(k).head<3>(), w_k = J.col(k).tail<3>();
    for (Index j = 0; j < J.cols(); ++j) {
      const Vector3d v = J.col(j).head<3>(), w = J.col(j).tail<3>();
      K_G(j, k) =
          k <= j ? force.dot(w_k.cross(v)) + moment.dot(w_k.cross(w)) : force.dot(w.cross(v_k));
    }
  }
  return K_G;
}

void null_projector(const NullSpace& null_space, JointMatrix& P) noexcept {
  for (Index j = 0; j < P.cols(); ++j) {
    const JointVector column = null_space.projected_velocity(JointVector::Unit(P.rows(), j));
    for (Index i = 0; i < P.rows(); ++i) P(i, j) = column[i];
  }
}

void add_projected(const JointMatrix& P, const JointVector& k, JointMatrix& K) noexcept {
  for (Index j = 0; j < K.cols(); ++j) {
    for (Index i = 0; i < K.rows(); ++i) {
      for (Index l = 0; l < K.rows(); ++l) K(i, j) += P(l, i) * k[l] * P(l, j);
    }
  }
}

void closed_loop(const DynamicsResult& robot, const JointVector& qd, const Impedance& impedance,
                 const NullSpace& null_space, const JointVector& viscous_friction,
                 const TaskTerms& terms, const Vector6& external_wrench,
                 analysis::System<kMaxJoints>& system) noexcept {
  const Jacobian& J = robot.J;
  const Index n = J.cols();
  const Matrix6 K_C = impedance.base.stiffness + turned(impedance.tool.stiffness, robot.R_BT);
  const Matrix6 C_C = impedance.base.damping + turned(impedance.tool.damping, robot.R_BT);
  JointMatrix K_N = impedance.joint_stiffness;  // all stiffness but the tip's springs
  JointMatrix C = impedance.joint_damping;
  JointMatrix projector = JointMatrix::Zero(n, n);
  if (impedance.null_space()) {
    null_projector(null_space, projector);
    add_projected(projector, impedance.null_stiffness, K_N);
    add_projected(projector, impedance.null_damping, C);
  }
  JointMatrix K = K_N;
  add_congruence(J, K_C, J, K);
  add_congruence(J, C_C, J, C);
  for (Index i = 0; i < n; ++i) C(i, i) += viscous_friction[i];

  JointMatrix extra = JointMatrix::Zero(n, n);
  if (terms.geometric_stiffness) extra = geometric_stiffness(J, external_wrench);
  if (terms.jacobian_rate) add_congruence(J, C_C, jacobian_rate(J, qd), extra);

  system.has_low_words = false;
  system.mass = robot.M;
  system.damping.resize(n, n);
  system.stiffness.resize(n, n);
  for (Index j = 0; j < n; ++j) {
    for (Index i = 0; i < n; ++i) {
      system.damping(i, j) = 0.5 * (C(i, j) + C(j, i));
      system.stiffness(i, j) = 0.5 * (K(i, j) + K(j, i)) + extra(i, j);
    }
  }
  if (terms.jacobian_rate || terms.geometric_stiffness) {
    system.stiffness_factor.resize(0, n);
    return;
  }
  // Without joint springs the factor of K_N is sqrt(K_0) times the projector: no digit is lost.
  const bool plain = impedance.joint_weight == 0;
  const JointMatrix W_N = plain ? projector : semidefinite_factor(K_N);
  const Matrix6 W_C = semidefinite_factor(K_C);
  system.stiffness_factor.resize(n + 6, n);
  for (Index j = 0; j < n; ++j) {
    const Vector6 top = W_C * J.col(j);
    for (Index i = 0; i < 6; ++i) system.stiffness_factor(i, j) = top[i];
    for (Index i = 0; i < n; ++i) {
      const double scale = plain ? std::sqrt(impedance.null_stiffness[i]) : 1;
      system.stiffness_factor(i + 6, j) = scale * W_N(i, j);
    }
  }
}

}  // namespace dashpot::controller
