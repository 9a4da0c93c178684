// The law against its equations written out with dense matrices, from KDL's M, J and bias torques.
#include <dashpot/controller/law/impedance_law.hpp>
#include <dashpot/controller/vibration/closed_loop.hpp>
#include <dashpot/tests/support/arms.hpp>
#include <dashpot/tests/support/kdl_dynamics.hpp>
#include <dashpot/tests/support/matrices.hpp>
#include <dashpot/tests/support/random.hpp>
#include <dashpot/tests/support/random_robot.hpp>

#include <gtest/gtest.h>

#include <Eigen/Geometry>
#include <Eigen/QR>
#include <limits>

namespace dashpot::controller {
namespace {

using Eigen::MatrixXd;
using Eigen::Quaterniond;
using Eigen::Vector3d;
using Eigen::VectorXd;
using testing::near;
using testing::Random;

constexpr FeedForward kNone{false, false, false, false, false};
constexpr FeedForward kAll{true, true, true, true, true};
constexpr ErrorClamp kEndless{std::numeric_limits<double>::infinity(),
                              std::numeric_limits<double>::infinity()};

/// Gains of every kind, symmetric positive semidefinite.
Gains random_gains(Random& random, int n) {
  Gains gains;
  gains.joint_stiffness = 100 * random.spd(n);
  gains.joint_damping = 10 * random.spd(n);
  gains.task_stiffness = 500 * random.spd(6);
  gains.task_damping = 20 * random.spd(6);
  gains.null_stiffness = 20 * random.vector(n).cwiseAbs();
  gains.null_damping = 2 * random.vector(n).cwiseAbs();
  return gains;
}

/// One arm, its law, and the same by hand.
struct Case {
  RobotModel model;
  int n;
  JointVector q, qd;
  DynamicsResult robot;
  DynamicsResult kdl;
  SpringReferences references;
  Vector3d p_d;
  Quaterniond R_d;
  JointVector weights = JointVector::LinSpaced(n, 0.3, 3);

  Case(const RobotModel& robot_model, Random& random)
      : model(robot_model),
        n(model.dof()),
        q(random.vector(n)),
        qd(0.5 * random.vector(n)),
        kdl(testing::by_kdl(model, q, qd)),
        references({JointVector::Ones(n), JointVector::Ones(n), 1, 1, 1, 1, 0.01, 0}, 1e-3) {
    DynamicsKernel(model).evaluate(q, qd, robot);
    p_d = robot.p_BT_B + 0.05 * Vector3d(random.vector(3));
    R_d = quaternion(0.3 * random.vector(3)) * Quaterniond(robot.R_BT);
    references.joint.start(q + JointVector(0.1 * random.vector(n)));
    references.posture.start(q + JointVector(0.1 * random.vector(n)));
    references.tip.start(p_d, R_d);
    for (int k = 0; k < 40; ++k) {  // in motion, so that velocities and accelerations matter
      references.joint.step(JointVector::Constant(n, 1));
      references.posture.step(JointVector::Constant(n, -1));
      references.tip.step(p_d + Vector3d::Ones(), R_d * quaternion(Vector3d(0.1, 1, 0.3)));
    }
  }
  JointVector torque(const Impedance& impedance, const FeedForward& parts, const Vector6& wrench) {
    ImpedanceLaw law(model, parts);
    NullSpace null_space(weights);
    null_space.compute(robot, impedance);
    LawTorque result;
    law.torque({robot, q, qd, impedance, null_space, references, kEndless, wrench}, result);
    return result.torque;
  }
  Vector6 tip_error() const {
    Vector6 e;
    const Eigen::AngleAxisd turn(
        Eigen::Matrix3d(references.tip.rotation().toRotationMatrix() * kdl.R_BT.transpose()));
    e << references.tip.position() - kdl.p_BT_B, turn.angle() * turn.axis();
    return e;
  }
  VectorXd friction(const VectorXd& v) const {
    VectorXd result(n);
    for (int i = 0; i < n; ++i) {
      const Joint& joint = model.joints()[static_cast<std::size_t>(i)];
      result[i] = joint.viscous_friction * v[i] + joint.coulomb_friction * std::tanh(v[i] / 0.01);
    }
    return result;
  }
};

RobotModel rough_chain(Random& random, int n) {
  ModelOptions options;
  options.viscous_friction = random.vector(n).cwiseAbs();
  options.coulomb_friction = random.vector(n).cwiseAbs();
  return RobotModel::from_urdf_text(testing::RandomRobot(random.engine()()).chain(n, 0.2), "link0",
                                    "tip", options);
}

void expect_joint_law(Random& random, int n) {
  Case one(rough_chain(random, n), random);
  Setpoint setpoint;
  setpoint.gains = random_gains(random, n);
  const Impedance impedance(setpoint, n);
  const Vector6 f = random.vector(6);
  const JointReference& path = one.references.joint;
  const VectorXd springs = setpoint.gains.joint_stiffness * (path.position() - one.q) +
                           setpoint.gains.joint_damping * (path.velocity() - one.qd);
  const double size = 1e-11 * (1 + springs.norm() + one.kdl.M.norm());
  EXPECT_TRUE(near(one.torque(impedance, kNone, f), springs, size));
  const VectorXd all = springs + one.kdl.M * path.acceleration() + one.kdl.coriolis +
                       one.kdl.gravity + one.kdl.J.transpose() * f + one.friction(path.velocity());
  EXPECT_TRUE(near(one.torque(impedance, kAll, f), all, size));
}

/// At the measured velocity friction is compensated in part, and gives less power than it takes.
TEST(FrictionCompensation, IsThatOfTheMeasuredVelocity) {
  Random random(24);
  Case one(rough_chain(random, 7), random);
  FeedForward parts = kNone;
  parts.friction = true;
  parts.friction_at = FeedForward::FrictionAt::kMeasured;
  parts.friction_share = 0.7;
  parts.friction_rise = 0.02;
  for (const double size : {1e-9, 1e-3, 1.0}) {
    one.qd = size * random.vector(7);
    const JointVector tau = one.torque(Impedance(7), parts, Vector6::Zero());
    for (int i = 0; i < 7; ++i) {
      const Joint& joint = one.model.joints()[static_cast<std::size_t>(i)];
      const double b = joint.viscous_friction, c = joint.coulomb_friction, v = one.qd[i];
      EXPECT_NEAR(tau[i], 0.7 * (b * v + c * std::tanh(v / 0.02)), 1e-14);
      EXPECT_LE(tau[i] * v, 0.7 * (b * v * v + c * std::abs(v)) * (1 + 1e-15));
    }
  }
}

TEST(JointImpedance, IsItsEquation) {
  Random random(321);
  for (int k = 0; k < 20; ++k) {
    for (const int n : {1, 7, 16}) expect_joint_law(random, n);
  }
}

/// Cartesian law for any directions and frame, with the Moore-Penrose form of a projector, or of
/// its way to a second one, whose share is `s`.
void expect_task_law(const RobotModel& model, Random& random,
                     NullProjector kind = NullProjector::kDynamic,
                     NullProjector second = NullProjector::kDynamic, double s = 0) {
  Case one(model, random);
  const int n = one.n;
  Setpoint setpoint;
  setpoint.mode = Mode::kCartesian;
  setpoint.gains = random_gains(random, n);
  Gains& gains = setpoint.gains;
  gains.frame = random.integer(0, 1) == 0 ? Frame::kBase : Frame::kTool;
  int held = 0;
  for (bool& direction : gains.directions) held += direction = random.integer(0, 4) > 0;
  if (held == 0) return;
  gains.null_projector = second;
  const Impedance after(setpoint, n);
  gains.null_projector = kind;
  const Impedance impedance = blend(Impedance(setpoint, n), after, s);

  // Rows of selected directions: S maps a twist in B's axes to their components.
  MatrixXd turn = MatrixXd::Identity(6, 6);
  if (gains.frame == Frame::kTool) {
    turn.topLeftCorner(3, 3) = turn.bottomRightCorner(3, 3) = one.kdl.R_BT.transpose();
  }
  MatrixXd S(held, 6);
  for (int i = 0, row = 0; i < 6; ++i) {
    if (gains.directions[static_cast<std::size_t>(i)]) S.row(row++) = turn.row(i);
  }
  const MatrixXd M = one.kdl.M, J = one.kdl.J, JS = S * J;
  const MatrixXd A = JS * M.inverse() * JS.transpose();
  if (Eigen::JacobiSVD<MatrixXd>(A).singularValues().reverse()[0] < 0.05 * A.norm()) return;
  const MatrixXd pseudo = M.inverse() * JS.transpose() * A.inverse();
  const MatrixXd held_only = S.transpose() * S * turn.transpose();
  const MatrixXd K_C = held_only * gains.task_stiffness * held_only.transpose(),
                 C_C = held_only * gains.task_damping * held_only.transpose();
  const TipReference& path = one.references.tip;
  VectorXd tau = J.transpose() * (K_C * one.tip_error() + C_C * (path.velocity() - J * one.qd));
  if (impedance.null_space()) {
    const double mass = impedance.share(NullProjector::kDynamic),
                 none = impedance.share(NullProjector::kNone), rest_of = 1 - mass - none,
                 given = impedance.share(NullProjector::kWeighted) / std::max(rest_of, 1e-3);
    const VectorXd V = VectorXd::Constant(n, 1 - given) + given * one.weights.cwiseInverse();
    const MatrixXd VJ = V.asDiagonal() * JS.transpose();
    const MatrixXd B = JS * VJ;
    if (Eigen::JacobiSVD<MatrixXd>(B).singularValues().reverse()[0] < 0.02 * B.norm()) return;
    const MatrixXd inverse = mass * pseudo + rest_of * VJ * B.inverse();
    const MatrixXd projector = MatrixXd::Identity(n, n) - inverse * JS;
    const JointReference& rest = one.references.posture;
    VectorXd share = inverse * S * one.tip_error();
    share /= std::sqrt(1 + share.squaredNorm() / 0.09);
    tau += projector.transpose() *
           (gains.null_stiffness.asDiagonal() * VectorXd(rest.position() - one.q - share) +
            gains.null_damping.asDiagonal() * projector * VectorXd(rest.velocity() - one.qd));
  }
  const double size = 1e-9 * (1 + tau.norm() + M.norm());
  const Vector6 f = random.vector(6);
  EXPECT_TRUE(near(one.torque(impedance, kNone, f), tau, size));
  const VectorXd all = tau + M * pseudo * S * path.acceleration() + one.kdl.coriolis +
                       one.kdl.gravity + J.transpose() * f +
                       one.friction(pseudo * S * path.velocity());
  EXPECT_TRUE(near(one.torque(impedance, kAll, f), all, size + 1e-9 * all.norm()));
}

TEST(CartesianImpedance, IsItsEquation) {
  Random random(322);
  for (int k = 0; k < 50; ++k) {
    expect_task_law(testing::arm_model(testing::arms()[0]), random);
    expect_task_law(testing::arm_model(testing::arms()[2]), random);
    expect_task_law(rough_chain(random, 9), random);
    expect_task_law(rough_chain(random, 14), random);
    expect_task_law(testing::arm_model(testing::arms()[0]), random, NullProjector::kKinematic);
    expect_task_law(rough_chain(random, 9), random, NullProjector::kKinematic);
    expect_task_law(testing::arm_model(testing::arms()[0]), random, NullProjector::kWeighted);
    expect_task_law(rough_chain(random, 9), random, NullProjector::kWeighted);
    expect_task_law(testing::arm_model(testing::arms()[2]), random, NullProjector::kNone);
    expect_task_law(rough_chain(random, 9), random, NullProjector::kNone);
    for (const auto& [a, first] : kNullProjectors) {
      for (const auto& [b, second] : kNullProjectors) {
        if (first < second) expect_task_law(rough_chain(random, 7), random, first, second, 0.4);
      }
    }
  }
}

// Where tip and joints move as their references, no damping for a ratio brakes them.
TEST(CartesianImpedance, DampsTheErrorOfTheTipsVelocityForTheRatioOfAllSprings) {
  Random random(327);
  for (int k = 0; k < 20; ++k) {
    Case one(rough_chain(random, 7), random);
    Setpoint setpoint;
    setpoint.mode = Mode::kCartesian;
    setpoint.gains = random_gains(random, 7);
    setpoint.gains.task_damping_ratio = setpoint.gains.null_damping_ratio = 0.7;
    setpoint.gains.null_projector = NullProjector::kNone;
    const Impedance impedance(setpoint, 7);
    NullSpace null_space;
    null_space.compute(one.robot, impedance);
    if (null_space.inertia().nearly_singular()) continue;
    const JointVector& rest = one.references.posture.velocity();
    const MatrixXd M = one.robot.M, J = one.robot.J;
    const MatrixXd A = J * M.inverse() * J.transpose();
    one.qd = rest + JointVector(M.inverse() * J.transpose() * A.inverse() *
                                (one.references.tip.velocity() - J * rest));
    const auto dampers = [&] {
      ImpedanceLaw law(one.model, kNone);
      LawTorque result;
      law.torque({one.robot, one.q, one.qd, impedance, null_space, one.references, kEndless,
                  Vector6::Zero()},
                 result);
      return result.dampers.norm();
    };
    const double still = dampers();
    one.qd = rest;
    EXPECT_LT(still, 1e-8 * dampers());
  }
}

// Each mode gives its share of springs and feed-forward while one passes into the other.
TEST(Law, SumsTheModesByTheirWeights) {
  Random random(323);
  for (int k = 0; k < 50; ++k) {
    Case one(rough_chain(random, 7), random);
    Setpoint setpoint;
    setpoint.gains = random_gains(random, 7);
    setpoint.gains.null_stiffness.setZero();
    setpoint.gains.null_damping.setZero();
    const auto joint = Impedance(setpoint, 7);
    setpoint.mode = Mode::kCartesian;
    const auto task = Impedance(setpoint, 7);
    const double s = random.uniform(0.1, 0.9);
    const auto impedance = blend(joint, task, s);
    const Vector6 f = Vector6::Zero();
    const VectorXd plain = one.torque(impedance, kNone, f);
    const VectorXd springs = (1 - s) * one.torque(joint, kNone, f) + s * one.torque(task, kNone, f);
    const double size = 1e-9 * (1 + plain.norm());
    EXPECT_TRUE(near(plain, springs, size));
    NullSpace null_space;  // of directions that are selected in part
    null_space.compute(one.robot, impedance);
    const JointReference& joints = one.references.joint;
    const TipReference& tip = one.references.tip;
    const VectorXd acceleration =
        (1 - s) * one.kdl.M * joints.acceleration() +
        s * one.kdl.J.transpose() * null_space.inertia().wrench(tip.acceleration());
    ASSERT_GT(acceleration.norm(), 1e-2);
    EXPECT_TRUE(near(one.torque(impedance, {false, false, false, true, false}, f) - plain,
                     acceleration, size));
    const VectorXd velocity =
        (1 - s) * joints.velocity() + s * null_space.joint_velocity(tip.velocity());
    EXPECT_TRUE(near(one.torque(impedance, {false, false, true, false, false}, f) - plain,
                     one.friction(velocity), size));
  }
}

TEST(ClosedLoop, AddsOptionalTermsAndFriction) {
  Random random(326);
  Case one(rough_chain(random, 7), random);
  Setpoint setpoint;
  setpoint.mode = Mode::kCartesian;
  setpoint.gains = random_gains(random, 7);
  const auto impedance = Impedance(setpoint, 7);
  NullSpace null_space;
  null_space.compute(one.robot, impedance);
  JointVector friction = random.vector(7).cwiseAbs();
  const MatrixXd wanted = friction.asDiagonal();
  const Vector6 f = random.vector(6);
  const auto system_with = [&](const TaskTerms& terms) {
    Settings settings;
    settings.task_terms = terms;
    analysis::System<kMaxJoints> system;
    closed_loop(one.robot, one.qd, {impedance, null_space, friction, {f, f}}, settings, system);
    return system;
  };
  const JointMatrix load = stiffness_under_load(one.robot, impedance, Load::kToolWrench, {f, f});
  const auto plain = system_with({}), both = system_with({Load::kToolWrench, true});
  const MatrixXd J = one.robot.J, given = J.transpose() * setpoint.gains.task_damping;
  EXPECT_TRUE(near(both.stiffness - plain.stiffness,
                   given * jacobian_rate(one.robot.J, one.qd) + load, 1e-9));
  EXPECT_EQ(both.stiffness_factor.rows(), 0);
  EXPECT_EQ(plain.stiffness_factor.rows(), 13);
  friction.setZero();
  EXPECT_TRUE(near(plain.damping - system_with({}).damping, wanted, 1e-9));
}

}  // namespace
}  // namespace dashpot::controller
