#include <dashpot/controller/attachment.hpp>
#include <dashpot/controller/default_settings.hpp>
#include <dashpot/controller/dynamics.hpp>
#include <dashpot/controller/model/least_inertia.hpp>
#include <dashpot/controller/posture.hpp>

#include <Eigen/Cholesky>
#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>

namespace dashpot::controller {

TipInertia least_tip_inertia(const RobotModel& model, const JointVector& lower,
                             const JointVector& upper) {
  double mobility_linear = 0, mobility_angular = 0;
  const PostureSequence postures(lower, upper);
  for (int k = 0; k < 64; ++k) {
    const DynamicsResult robot = evaluate(model, postures.at(k), JointVector::Zero(model.dof()));
    const Eigen::MatrixXd M = robot.M, J = robot.J;
    const Eigen::LLT<Eigen::MatrixXd> factor(M);
    if (factor.info() != Eigen::Success) {
      throw InvalidModel(
          "the mass matrix is not positive definite in some posture: a link has an inertia that no "
          "body has");
    }
    const Eigen::MatrixXd A = J * factor.solve(J.transpose());
    mobility_linear = std::max(mobility_linear, A.topLeftCorner<3, 3>().trace());
    mobility_angular = std::max(mobility_angular, A.bottomRightCorner<3, 3>().trace());
  }
  return {1 / mobility_linear, 1 / mobility_angular};
}

RobotModel unloaded(const RobotModel& model) try {
  Attachment nothing;
  nothing.tool = model.attachment().tool;
  return model.attachment().mass > 0 ? model.with(nothing) : model;
} catch (const InvalidModel&) {
  return model;
}

namespace {

double finite_or(double value, double otherwise) {
  return std::isfinite(value) && value > 0 ? value : otherwise;
}

constexpr double kRatio = 0.7;
constexpr double kUnbounded = std::numeric_limits<double>::infinity();

/// Damping at the tip lets the velocities of modes decay no faster than this, 1/s. A torque that is
/// held for a period of 1 ms and arrives a period late becomes unstable at much faster decays.
constexpr double kFastestDecay = 200;

}  // namespace

bool lacks_efforts(const RobotModel& model) {
  constexpr int kArm = 4;  // least joints of an arm; for smaller rigs 100 N m is enough
  return model.dof() >= kArm && model.joint_values(&Joint::effort).minCoeff() == kUnbounded;
}

Settings default_settings(const RobotModel& model) {
  const int n = model.dof();
  const JointVector none = JointVector::Zero(n);
  Settings settings;
  settings.environment.joint_stiffness = settings.environment.joint_damping = none;
  Limits& limits = settings.limits;
  limits.torque = limits.torque_rate = limits.velocity = none;
  limits.position_lower = limits.position_upper = none;
  limits.external_torque = JointVector::Constant(n, kUnbounded);
  JointVector middle = none;
  for (int i = 0; i < n; ++i) {
    const Joint& joint = model.joints()[static_cast<std::size_t>(i)];
    limits.torque[i] = finite_or(joint.effort, 100);
    const bool slides = joint.type == JointType::kPrismatic;
    limits.torque_rate[i] = 100 * limits.torque[i];
    if (!slides) limits.torque_rate[i] = std::min(1000.0, limits.torque_rate[i]);
    limits.velocity[i] = finite_or(joint.velocity, 2);
    limits.position_lower[i] = joint.lower;
    limits.position_upper[i] = joint.upper;
    const double center = 0.5 * (joint.lower + joint.upper);
    middle[i] = std::isfinite(center) ? center : 0;
  }
  settings.integral.torque = limits.torque / 10;
  // `validate` refuses it, because the joints' torques are unknown
  if (lacks_efforts(model)) limits.torque.setZero();
  settings.motion.velocity = 0.25 * limits.velocity;
  settings.motion.acceleration = limits.velocity;
  for (int i = 0; i < n; ++i) {  // it brakes at half of this, and changes it within the smoothing
    const Joint& joint = model.joints()[static_cast<std::size_t>(i)];
    double& most = settings.motion.acceleration[i];
    most = std::min({most, joint.acceleration, 2 * joint.deceleration,
                     0.5 * settings.motion.smoothing * joint.jerk});
  }

  // Between the inertia of a joint with all others held and with all others free.
  const Eigen::MatrixXd M = evaluate(model, middle, none).M;
  const Eigen::MatrixXd M_inverse = M.llt().solve(Eigen::MatrixXd::Identity(n, n));
  const JointVector inertia = M.diagonal().cwiseQuotient(M_inverse.diagonal()).cwiseSqrt();

  constexpr double kOmega = 2 * std::numbers::pi * 1.5;  // rad/s
  Gains& gains = settings.initial.gains;
  gains.joint_stiffness = (kOmega * kOmega * inertia).asDiagonal();
  gains.joint_damping = (2 * kRatio * kOmega * inertia).asDiagonal();
  // A damper 2 ratio omega m is the fastest for the fastest mode, whose omega^2 is at most
  // k_v / m_v + k_w / m_w: half for translation, half for rotation.
  constexpr double kFastestMode = kFastestDecay / (2 * kRatio);  // rad/s
  const TipInertia least =
      least_tip_inertia(unloaded(model), limits.position_lower, limits.position_upper);
  const double linear = std::min(400.0, 0.5 * kFastestMode * kFastestMode * least.linear);
  const double angular = std::min(20.0, 0.5 * kFastestMode * kFastestMode * least.angular);
  gains.task_stiffness.diagonal() << linear, linear, linear, angular, angular, angular;
  settings.null_weights = JointVector::Ones(n);
  gains.null_stiffness = 0.25 * gains.joint_stiffness.diagonal();
  // For directions without springs, in which a ratio gives no damping.
  const double slide = std::min(40.0, kFastestDecay * least.linear);
  const double turn = std::min(2.0, kFastestDecay * least.angular);
  gains.task_damping.diagonal() << slide, slide, slide, turn, turn, turn;
  gains.null_damping = 0.5 * gains.joint_damping.diagonal();
  gains.joint_damping_ratio = gains.task_damping_ratio = gains.null_damping_ratio = kRatio;
  settings.initial.joint_position = middle;
  return settings;
}

}  // namespace dashpot::controller
