#pragma once
#include <dashpot/analysis/system.hpp>
#include <dashpot/controller/dynamics.hpp>
#include <dashpot/controller/law/null_space.hpp>
#include <dashpot/controller/settings.hpp>
#include <dashpot/controller/vibration/spring_factors.hpp>

#include <cmath>

namespace dashpot::controller {

/// Returns Jdot (6 x n) at joint velocity qd: with j and k counted from the base, v and w the
/// linear and angular rows of J,
///     dJ_j/dq_k = (w_k x v_j, w_k x w_j) for k <= j,  (w_j x v_k, 0) for k > j.
template <int N>
Jacobian<N> jacobian_rate(const Jacobian<N>& J, const Joints<N>& qd) noexcept {
  Jacobian<N> rate;
  Eigen::Vector3d inner = Eigen::Vector3d::Zero();             // sum of w_k qd_k for k <= j
  Eigen::Vector3d outer = twist<N>(J, qd).template head<3>();  // sum of v_k qd_k for k > j
  for (int j = 0; j < N; ++j) {
    const Eigen::Vector3d v = column<N>(J, j).template head<3>();
    const Eigen::Vector3d w = column<N>(J, j).template tail<3>();
    inner += w * qd[j];
    outer -= v * qd[j];
    column<N>(rate, j).template head<3>() = inner.cross(v) + w.cross(outer);
    column<N>(rate, j).template tail<3>() = inner.cross(w);
  }
  return rate;
}

/// Returns K_G = [(dJ/dq_1)' f ... (dJ/dq_n)' f], n x n, for the wrench f in B's axes.
template <int N>
JointSquare<N> geometric_stiffness(const Jacobian<N>& J, const Vector6& f) noexcept {
  JointSquare<N> K_G;
  const Eigen::Vector3d force = f.head<3>(), moment = f.tail<3>();
  for (int k = 0; k < N; ++k) {
    const Eigen::Vector3d v_k = column<N>(J, k).template head<3>();
    const Eigen::Vector3d w_k = column<N>(J, k).template tail<3>();
    for (int j = 0; j < N; ++j) {
      const Eigen::Vector3d v = column<N>(J, j).template head<3>();
      const Eigen::Vector3d w = column<N>(J, j).template tail<3>();
      K_G(j, k) =
          k <= j ? force.dot(w_k.cross(v)) + moment.dot(w_k.cross(w)) : force.dot(w.cross(v_k));
    }
  }
  return K_G;
}

/// K += J1' A J2
template <int N>
void add_congruence(const Jacobian<N>& J1, const Matrix6& A, const Jacobian<N>& J2,
                    JointSquare<N>& K) noexcept {
  for (int j = 0; j < N; ++j) {
    const Vector6 column_j = A * column<N>(J2, j);
    for (int i = 0; i < N; ++i) K(i, j) += column<N>(J1, i).dot(column_j);
  }
}

/// K += P' diag(k) P
template <int N>
void add_projected(const JointSquare<N>& P, const Joints<N>& k, JointSquare<N>& K) noexcept {
  for (int j = 0; j < N; ++j) {
    for (int i = 0; i < N; ++i) {
      double sum = 0;
      for (int l = 0; l < N; ++l) sum += P(l, i) * k[l] * P(l, j);
      K(i, j) += sum;
    }
  }
}

/// Sets `system` to the robot with the springs and dampers of an impedance, M q'' + C q' + K q = f,
/// linearised where the springs are at rest (e = 0, q = q_d, q = q_0) and N stands still:
///     K = K_q + J' K_C J + N' K_0 N  [+ J' C_C Jdot]  [+ K_G(external wrench)]
///     C = C_q + J' C_C J + N' C_0 N + viscous friction of the joints.
/// TaskTerms says which terms in brackets are included. If none is, K is symmetric and has its
/// factor W. The feed-forward does not appear, because it depends on the set-point, not on the
/// state, except for Coriolis and gravity, which cancel the robot's Coriolis and gravity torques.
template <int N>
void closed_loop(const Dynamics<N>& robot, const Joints<N>& qd, const Impedance<N>& impedance,
                 const NullSpace<N>& null_space, const Joints<N>& viscous_friction,
                 const TaskTerms& terms, const Vector6& external_wrench,
                 analysis::System<kMaxJoints>& system) noexcept {
  const Jacobian<N>& J = robot.J;
  const Matrix6 K_C = impedance.base.stiffness + turned(impedance.tool.stiffness, robot.R_BT);
  const Matrix6 C_C = impedance.base.damping + turned(impedance.tool.damping, robot.R_BT);
  JointSquare<N> K_N = JointSquare<N>::Zero();  // all stiffness but the tip's springs
  JointSquare<N> C = impedance.joint_damping;
  JointSquare<N> projector = JointSquare<N>::Zero();
  if (impedance.null_space()) {
    for (int j = 0; j < N; ++j) {
      Joints<N> unit = Joints<N>::Zero();
      unit[j] = 1;
      unit = null_space.projected_velocity(unit);
      for (int i = 0; i < N; ++i) projector(i, j) = unit[i];
    }
    add_projected<N>(projector, impedance.null_stiffness, K_N);
    add_projected<N>(projector, impedance.null_damping, C);
  }
  for (int i = 0; i < N * N; ++i) K_N.data()[i] += impedance.joint_stiffness.data()[i];
  JointSquare<N> K = K_N;
  add_congruence<N>(J, K_C, J, K);
  add_congruence<N>(J, C_C, J, C);
  for (int i = 0; i < N; ++i) C(i, i) += viscous_friction[i];

  JointSquare<N> extra = JointSquare<N>::Zero();
  if (terms.jacobian_rate) add_congruence<N>(J, C_C, jacobian_rate<N>(J, qd), extra);
  if (terms.geometric_stiffness) {
    const JointSquare<N> K_G = geometric_stiffness<N>(J, external_wrench);
    for (int i = 0; i < N * N; ++i) extra.data()[i] += K_G.data()[i];
  }

  system.has_low_words = false;
  system.mass.resize(N, N);
  system.damping.resize(N, N);
  system.stiffness.resize(N, N);
  for (int j = 0; j < N; ++j) {
    for (int i = 0; i < N; ++i) {
      system.mass(i, j) = robot.M(i, j);
      system.damping(i, j) = 0.5 * (C(i, j) + C(j, i));
      system.stiffness(i, j) = 0.5 * (K(i, j) + K(j, i)) + extra(i, j);
    }
  }
  if (terms.jacobian_rate || terms.geometric_stiffness) {
    system.stiffness_factor.resize(0, N);
    return;
  }
  // Without joint springs the factor of K_N is sqrt(K_0) times the projector: no digit is lost.
  const bool plain = impedance.joint_weight == 0;
  const JointSquare<N> W_N = plain ? projector : semidefinite_factor<N>(K_N);
  const Matrix6 W_C = semidefinite_factor<6>(K_C);
  system.stiffness_factor.resize(N + 6, N);
  for (int j = 0; j < N; ++j) {
    const Vector6 top = W_C * column<N>(J, j);
    for (int i = 0; i < 6; ++i) system.stiffness_factor(i, j) = top[i];
    for (int i = 0; i < N; ++i) {
      const double scale = plain ? std::sqrt(impedance.null_stiffness[i]) : 1;
      system.stiffness_factor(i + 6, j) = scale * W_N(i, j);
    }
  }
}

}  // namespace dashpot::controller
