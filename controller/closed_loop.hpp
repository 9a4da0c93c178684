#pragma once
#include <dashpot/analysis/system.hpp>
#include <dashpot/controller/dynamics.hpp>
#include <dashpot/controller/null_space.hpp>
#include <dashpot/controller/settings.hpp>

#include <cmath>
#include <limits>

namespace dashpot::controller {

/// W with W' W = A for a symmetric positive semidefinite A; as many rows as A, the last ones zero
/// if A has less than full rank. Cholesky factorisation, largest pivot first.
template <class Matrix>
Matrix semidefinite_factor(Matrix A) noexcept {
  Matrix W = Matrix::Zero(A.rows(), A.cols());
  const auto size = static_cast<double>(A.rows());
  const double least = size * std::numeric_limits<double>::epsilon() * A.diagonal().maxCoeff();
  for (Eigen::Index k = 0; k < A.rows(); ++k) {
    Eigen::Index pivot = 0;
    const double largest = A.diagonal().maxCoeff(&pivot);
    if (!(largest > least)) break;
    W.row(k) = A.row(pivot) / std::sqrt(largest);
    A.noalias() -= W.row(k).transpose() * W.row(k);
    A.row(pivot).setZero();
    A.col(pivot).setZero();
  }
  return W;
}

/// Jdot (6 x n) at joint velocity qd: with j and k counted from the base, w and v the angular and
/// linear rows of J,
///     dJ_j/dq_k = (w_k x v_j, w_k x w_j) for k <= j,  (w_j x v_k, 0) for k > j.
template <int N>
Eigen::Matrix<double, 6, N> jacobian_rate(const Eigen::Matrix<double, 6, N>& J,
                                          const Eigen::Matrix<double, N, 1>& qd) noexcept {
  Eigen::Matrix<double, 6, N> rate;
  Eigen::Vector3d w_inner = Eigen::Vector3d::Zero();       // sum of w_k qd_k for k <= j
  Eigen::Vector3d v_outer = J.template topRows<3>() * qd;  // sum of v_k qd_k for k > j
  for (int j = 0; j < N; ++j) {
    const Eigen::Vector3d v = J.col(j).template head<3>(), w = J.col(j).template tail<3>();
    w_inner += w * qd[j];
    v_outer -= v * qd[j];
    rate.col(j) << w_inner.cross(v) + w.cross(v_outer), w_inner.cross(w);
  }
  return rate;
}

/// K_G = [(dJ/dq_1)' f ... (dJ/dq_n)' f], n x n, for the wrench f in B's axes.
template <int N>
Eigen::Matrix<double, N, N> geometric_stiffness(const Eigen::Matrix<double, 6, N>& J,
                                                const Vector6& f) noexcept {
  Eigen::Matrix<double, N, N> K_G;
  const Eigen::Vector3d force = f.head<3>(), moment = f.tail<3>();
  for (int k = 0; k < N; ++k) {
    const Eigen::Vector3d v_k = J.col(k).template head<3>(), w_k = J.col(k).template tail<3>();
    for (int j = 0; j < N; ++j) {
      const Eigen::Vector3d v = J.col(j).template head<3>(), w = J.col(j).template tail<3>();
      K_G(j, k) =
          k <= j ? force.dot(w_k.cross(v)) + moment.dot(w_k.cross(w)) : force.dot(w.cross(v_k));
    }
  }
  return K_G;
}

/// The robot with the springs and dampers of an impedance, M q'' + C q' + K q = f, linearised where
/// the springs are at rest (e = 0, q = q_d, q = q_0) and N stands still:
///     K = K_q + J' K_C J + N' K_0 N  [+ J' C_C Jdot]  [+ K_G(external wrench)]
///     C = C_q + J' C_C J + N' C_0 N + viscous friction of the joints.
/// The terms in brackets are there if TaskTerms asks for them; K is symmetric and has its factor W
/// if none is. The feed-forward has no part in it: it depends on the set-point, not on the state.
template <int N>
void closed_loop(const Dynamics<N>& robot, const Eigen::Matrix<double, N, 1>& qd,
                 const Impedance<N>& impedance, const NullSpace<N>& null_space,
                 const Eigen::Matrix<double, N, 1>& viscous_friction, const TaskTerms& terms,
                 const Vector6& external_wrench, analysis::System<kMaxJoints>& system) noexcept {
  using Square = Eigen::Matrix<double, N, N>;
  const auto& J = robot.J;
  Matrix6 R = Matrix6::Zero();
  R.topLeftCorner<3, 3>() = R.bottomRightCorner<3, 3>() = robot.R_BT;
  const Matrix6 K_C = impedance.base.stiffness + R * impedance.tool.stiffness * R.transpose();
  const Matrix6 C_C = impedance.base.damping + R * impedance.tool.damping * R.transpose();
  Square K = impedance.joint_stiffness + J.transpose() * K_C * J;
  Square C = impedance.joint_damping + J.transpose() * C_C * J;
  C.diagonal() += viscous_friction;

  Eigen::Matrix<double, N + 6, N> W;
  W.template topRows<6>() = semidefinite_factor(K_C) * J;
  if (impedance.null_space()) {
    Square projector;
    for (int i = 0; i < N; ++i) {
      projector.col(i) = null_space.projected_velocity(Square::Identity().col(i));
    }
    const Square K_N = projector.transpose() * impedance.null_stiffness.asDiagonal() * projector;
    K += K_N;
    C += projector.transpose() * impedance.null_damping.asDiagonal() * projector;
    if (impedance.joint_weight > 0) {
      W.template bottomRows<N>() = semidefinite_factor(Square(impedance.joint_stiffness + K_N));
    } else {
      W.template bottomRows<N>() = impedance.null_stiffness.cwiseSqrt().asDiagonal() * projector;
    }
  } else {
    W.template bottomRows<N>() = semidefinite_factor(impedance.joint_stiffness);
  }
  K = (0.5 * (K + K.transpose())).eval();
  C = (0.5 * (C + C.transpose())).eval();
  if (terms.jacobian_rate) K += J.transpose() * C_C * jacobian_rate<N>(J, qd);
  if (terms.geometric_stiffness) K += geometric_stiffness<N>(J, external_wrench);

  system.mass = robot.M;
  system.damping = C;
  system.stiffness = K;
  system.has_tails = false;
  if (terms.jacobian_rate || terms.geometric_stiffness) {
    system.stiffness_factor.resize(0, N);
  } else {
    system.stiffness_factor = W;
  }
}

}  // namespace dashpot::controller
