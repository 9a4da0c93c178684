#include <dashpot/controller/base/joint_algebra.hpp>
#include <dashpot/controller/law/impedance_law.hpp>
#include <dashpot/controller/vibration/closed_loop.hpp>
#include <dashpot/controller/vibration/spring_factors.hpp>

#include <Eigen/Eigenvalues>
#include <Eigen/Geometry>
#include <cmath>

namespace dashpot::controller {
namespace {

using Eigen::Index;
using Eigen::Matrix3d;
using Eigen::Vector3d;

constexpr double kLargestAngle = 2;  // rad

/// The e with K e = F, zero in directions without springs.
Vector6 deflection(const Matrix6& K, const Vector6& F) noexcept {
  constexpr double kNothing = 1e-10;
  Vector6 scale;  // metres and radians have springs of their own size
  for (Index i = 0; i < 6; ++i) scale[i] = K(i, i) > 0 ? 1 / std::sqrt(K(i, i)) : 0;
  const Matrix6 unit = scale.asDiagonal() * K * scale.asDiagonal();
  const Eigen::SelfAdjointEigenSolver<Matrix6> solved(unit);
  if (solved.info() != Eigen::Success) return Vector6::Zero();
  Vector6 parts = solved.eigenvectors().transpose() * scale.cwiseProduct(F);
  for (Index i = 0; i < 6; ++i) {
    const double k = solved.eigenvalues()[i];
    parts[i] = k > kNothing ? parts[i] / k : 0;
  }
  return scale.cwiseProduct(solved.eigenvectors() * parts);
}

/// A with de = -A w, for the rotation vector e of R_d R' while R turns with w: the inverse of the
/// right Jacobian of the rotations.
Matrix3d derivative_of_error(const Vector3d& e) noexcept {
  const double a = e.norm();
  const double c =
      a < 1e-2 ? 1.0 / 12 + a * a / 720 : 1 / (a * a) - (1 + std::cos(a)) / (2 * a * std::sin(a));
  Matrix3d cross;
  cross << 0, -e.z(), e.y(), e.z(), 0, -e.x(), -e.y(), e.x(), 0;
  return Matrix3d::Identity() + 0.5 * cross + c * cross * cross;
}

/// K += the load's part of the stiffness of posture springs `k`. `e` is the tip's error, and `A`
/// its derivative_of_error.
void add_loaded_posture(const LoadedPosture& posture, const Jacobian& J, const JointVector& k,
                        const Vector6& e, const Matrix3d& A, JointMatrix& K) noexcept {
  const Index n = J.cols();
  const NullSpaceChange& change = posture.change;
  const JointVector x = change.share() * e;
  const double s = 1 / std::sqrt(1 + product(x, x) / (kPostureShare * kPostureShare));
  JointMatrix dx = change.of_joint_velocity(e);
  Jacobian moved(6, n);  // the change of e for a constant J#
  for (Index j = 0; j < n; ++j) {
    moved.col(j) << -J.col(j).head<3>(), -(A * J.col(j).tail<3>());
    moved.col(j) -= change.turning(e, j);
  }
  dx += change.share().lazyProduct(moved);
  JointVector pull(n);
  for (Index i = 0; i < n; ++i) pull[i] = k[i] * posture.error[i];
  JointMatrix deflected = change.share().lazyProduct(J);  // 1 - N
  for (Index j = 0; j < n; ++j) {
    double along = 0;
    for (Index i = 0; i < n; ++i) along += x[i] * dx(i, j);
    along *= s * s / (kPostureShare * kPostureShare);
    for (Index i = 0; i < n; ++i) {
      deflected(i, j) = k[i] * (deflected(i, j) + s * (dx(i, j) - x[i] * along));
    }
  }
  K += change.projector().lazyProduct(deflected);
  K -= change.of_torque(pull);
}

/// K += D d(N qd)/dq with the damping D of the null space, N D N.
void add_null_space_rate(const NullSpaceChange& change, const Jacobian& J, const JointVector& qd,
                         const JointMatrix& D, JointMatrix& K) noexcept {
  JointMatrix rate = change.of_joint_velocity(twist(J, qd));
  rate += change.share().lazyProduct(change.twists(qd));
  K -= D.lazyProduct(rate);
}

}  // namespace

JointMatrix stiffness_of_load(const Jacobian& J, Load load, const Vector6& f) noexcept {
  if (load == Load::kIgnored || load == Load::kJointTorques)
    return JointMatrix::Zero(J.cols(), J.cols());
  JointMatrix K = -geometric_stiffness(J, f);
  if (load == Load::kToolWrench) {
    for (Index k = 0; k < J.cols(); ++k) {
      Vector6 turned_by_k;  // minus the change of f
      turned_by_k.head<3>() = f.head<3>().cross(J.col(k).tail<3>());
      turned_by_k.tail<3>() = f.tail<3>().cross(J.col(k).tail<3>());
      for (Index j = 0; j < J.cols(); ++j) K(j, k) += J.col(j).dot(turned_by_k);
    }
  }
  return K;
}

JointMatrix stiffness_under_load(const DynamicsResult& robot, const Impedance& impedance, Load load,
                                 const TipWrenches& wrenches,
                                 const LoadedPosture* posture) noexcept {
  const Jacobian& J = robot.J;
  const Matrix6& K_B = impedance.base.stiffness;
  const Matrix6 K_T = turned(impedance.tool.stiffness, robot.R_BT);
  const Matrix6 K_C = K_B + K_T;
  const Vector6 wanted =
      -impedance.task_weight * (wrenches.world + wrenches.commanded) - wrenches.posture;
  Vector6 e = deflection(K_C, wanted);
  const Vector6 F = K_C * e;  // the part that K_C can hold
  const double angle = e.tail<3>().norm();
  if (angle > kLargestAngle) e.tail<3>() *= kLargestAngle / angle;
  const Matrix3d A = derivative_of_error(e.tail<3>());
  const Vector6 F_T = K_T * e;

  JointMatrix K =
      stiffness_of_load(J, load, wrenches.world) - geometric_stiffness(J, F + wrenches.commanded);
  for (Index k = 0; k < J.cols(); ++k) {
    const Vector3d w = J.col(k).tail<3>();
    Vector6 moved = Vector6::Zero(), turned_by_k;
    moved.tail<3>() = A * w - w;
    turned_by_k.head<3>() = e.head<3>().cross(w);
    turned_by_k.tail<3>() = e.tail<3>().cross(w);
    Vector6 more = K_C * moved - K_T * turned_by_k;
    more.head<3>() += F_T.head<3>().cross(w);
    more.tail<3>() += F_T.tail<3>().cross(w);
    for (Index j = 0; j < J.cols(); ++j) K(j, k) += J.col(j).dot(more);
  }
  if (posture != nullptr) add_loaded_posture(*posture, J, impedance.null_stiffness, e, A, K);
  return K;
}

void add_environment(const Environment& environment, Impedance& impedance) noexcept {
  if (!environment.tip_stiffness.isZero(0) || !environment.tip_damping.isZero(0)) {
    impedance.task_weight = 1;  // there are springs or dampers at the tip
    impedance.base.stiffness.diagonal() += environment.tip_stiffness;
    impedance.base.damping.diagonal() += environment.tip_damping;
  }
  if (!environment.joint_stiffness.isZero(0)) impedance.joint_weight = 1;
  impedance.joint_stiffness.diagonal() += environment.joint_stiffness;
  impedance.joint_damping.diagonal() += environment.joint_damping;
}

JointVector friction_left(const RobotModel& model, const Settings& settings) {
  const FeedForward& given = settings.feed_forward;
  JointVector left = model.joint_values(&Joint::viscous_friction);
  if (!given.friction || given.friction_at != FeedForward::FrictionAt::kMeasured) return left;
  const JointVector coulomb = model.joint_values(&Joint::coulomb_friction);
  for (Index i = 0; i < left.size(); ++i) {
    left[i] -= given.friction_share * (left[i] + coulomb[i] / given.friction_rise);
  }
  return left;
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

void add_null_damping(const NullSpace& null_space, JointMatrix& C) noexcept {
  for (Index j = 0; j < C.cols(); ++j) {
    const JointVector column = null_space.ratio_damper(JointVector::Unit(C.rows(), j));
    for (Index i = 0; i < C.rows(); ++i) C(i, j) += column[i];
  }
}

void closed_loop(const DynamicsResult& robot, const JointVector& qd, const Acting& acting,
                 const Settings& settings, analysis::System<kMaxJoints>& system) noexcept {
  const NullSpace& null_space = acting.null_space;
  Impedance impedance = acting.impedance;
  if (!settings.environment.none()) add_environment(settings.environment, impedance);
  const Jacobian& J = robot.J;
  const Index n = J.cols();
  const Matrix6 K_C = impedance.base.stiffness + turned(impedance.tool.stiffness, robot.R_BT);
  const Matrix6 C_C = impedance.base.damping + turned(impedance.tool.damping, robot.R_BT);
  JointMatrix K_N = impedance.joint_stiffness;  // all stiffness but the tip's springs
  JointMatrix C = impedance.joint_damping;
  JointMatrix projector = JointMatrix::Zero(n, n), D = projector;  // D: of the null space
  if (impedance.null_space()) {
    null_projector(null_space, projector);
    add_projected(projector, impedance.null_stiffness, K_N);
    add_projected(projector, impedance.null_damping, D);
    if (impedance.null_damping_ratio > 0) add_null_damping(null_space, D);
    C += D;
  }
  JointMatrix K = K_N;
  add_congruence(J, K_C, J, K);
  add_congruence(J, C_C, J, C);
  for (Index i = 0; i < n; ++i) C(i, i) += acting.friction[i];

  const TaskTerms& terms = settings.task_terms;
  const bool loaded = terms.load != Load::kIgnored && !acting.wrenches.world.isZero(0);
  JointMatrix extra = JointMatrix::Zero(n, n);
  std::optional<NullSpaceChange> change;
  TipWrenches wrenches = acting.wrenches;
  if (acting.posture && impedance.null_space() && (loaded || terms.jacobian_rate)) {
    const double unprojected = null_space.unprojected_share();
    if (unprojected > 0) {
      const JointVector pull = impedance.null_stiffness.cwiseProduct(acting.posture->error);
      wrenches.posture = unprojected * null_space.wrench_of(pull);
    }
    if (unprojected < 1) {
      change.emplace(*acting.posture->kernel, *acting.posture->q, robot, null_space,
                     !impedance.tool.none());
    }
  }
  if (loaded) {
    std::optional<LoadedPosture> pulled;
    if (change && !impedance.null_stiffness.isZero(0)) {
      pulled.emplace(LoadedPosture{*change, acting.posture->error});
    }
    extra = stiffness_under_load(robot, acting.impedance, terms.load, wrenches,
                                 pulled ? &*pulled : nullptr);
  }
  if (terms.jacobian_rate) {
    add_congruence(J, C_C, jacobian_rate(J, qd), extra);
    if (change && !D.isZero(0)) {
      const JointVector past = difference(qd, acting.posture->velocity);
      if (!null_space.dynamic() && impedance.null_damping_ratio > 0) {
        JointMatrix designed = JointMatrix::Zero(n, n);
        add_null_damping(null_space, designed);
        D -= designed;
        const NullSpaceChange dynamic(*acting.posture->kernel, *acting.posture->q, robot,
                                      null_space, !impedance.tool.none(), true);
        add_null_space_rate(dynamic, J, past, designed, extra);
      }
      add_null_space_rate(*change, J, past, D, extra);
    }
  }

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
  if (terms.jacobian_rate || loaded) {
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
