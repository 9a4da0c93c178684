// Arms under the real controller in simulation: rest stays rest, pushes are damped, and energy
// comes only from the hold.
#include <dashpot/controller/default_settings.hpp>
#include <dashpot/tests/support/released_arm.hpp>

#include <gtest/gtest.h>

#include <Eigen/Geometry>
#include <cmath>

namespace dashpot {
namespace {

using controller::JointVector;
using controller::Vector6;
using Eigen::MatrixXd;
using Eigen::VectorXd;
using testing::Random;
using testing::ReleasedArm;
using testing::TwinModels;

class ClosedLoop : public ::testing::TestWithParam<testing::Arm> {
 protected:
  TwinModels twin{GetParam()};
  Random random{7};

  /// Modes from 8 to 30 rad/s with this ratio.
  controller::Gains gains(const JointVector& q, double zeta) {
    const VectorXd omega{{8, 11, 14, 18, 23, 30}};
    return tip_gains(twin, q, omega, VectorXd::Constant(6, zeta), 0, random);
  }
  /// An impedance that the drives can hold with torque to spare.
  JointVector posture() {
    const JointVector limit = twin.model.joint_values(&controller::Joint::effort);
    for (;;) {
      const JointVector q = random_posture(twin, random);
      const auto robot = evaluate(twin.model, q, JointVector::Zero(q.size()));
      if ((robot.gravity.cwiseAbs().array() < 0.6 * limit.array()).all()) return q;
    }
  }
  /// Also springs toward the posture, where there is a self-motion.
  void hold_posture(const JointVector& q, controller::Gains& gains) {
    if (twin.dof() == 6) return;
    const double softness = self_motion(twin, q).squaredNorm();
    gains.null_stiffness.setConstant(100 / softness);
    gains.null_damping.setConstant(10 / softness);
  }
  Eigen::Vector3d tip(const JointVector& q) const {
    return evaluate(twin.model, q, JointVector::Zero(q.size())).p_BT_B;
  }
};
INSTANTIATE_TEST_SUITE_P(Arms, ClosedLoop, ::testing::ValuesIn(testing::arms()),
                         [](const auto& instance) { return std::string(instance.param.file); });

TEST_P(ClosedLoop, KeepsItsEquilibrium) {
  for (int i = 0; i < 5; ++i) {
    const JointVector q0 = posture();
    const controller::Settings settings = release_settings(twin, gains(q0, 0.3), 0.001);
    ReleasedArm arm(twin, settings, q0, JointVector::Zero(q0.size()));
    for (int k = 0; k < 1000; ++k) ASSERT_EQ(arm.step(), sim::Status::kOk);
    EXPECT_LT((arm.plant().position() - q0).norm(), 1e-10);
    EXPECT_LT(arm.plant().velocity().norm(), 1e-10);
    EXPECT_EQ(arm.worst, controller::Status::kOk) << to_text(arm.worst);
  }
}

TEST_P(ClosedLoop, ComesBackAfterAPush) {
  for (int i = 0; i < 5; ++i) {
    const JointVector q0 = posture();
    const controller::Settings settings = release_settings(twin, gains(q0, 0.7), 0.001);
    sim::ArmOptions options;
    Vector6 push = Vector6::Zero();
    push.head<3>() = 5 * random.vector(3).normalized();
    options.wrenches = {{0.1, 0.3, push}};
    ReleasedArm arm(twin, settings, q0, JointVector::Zero(q0.size()), {}, options);
    double farthest = 0;
    for (int k = 0; k < 3000; ++k) {
      ASSERT_EQ(arm.step(), sim::Status::kOk);
      farthest = std::max(farthest, (tip(arm.plant().position()) - tip(q0)).norm());
    }
    EXPECT_GT(farthest, 1e-3);
    EXPECT_LT((tip(arm.plant().position()) - tip(q0)).norm(), 1e-3 * farthest);
    EXPECT_EQ(arm.worst, controller::Status::kOk) << to_text(arm.worst);
  }
}

/// With a free posture, an arm displaced along its self-motion feels no spring and stays.
TEST_P(ClosedLoop, StoresNothingInTheSelfMotion) {
  if (twin.dof() == 6) GTEST_SKIP() << "no self-motion";
  for (int i = 0; i < 5; ++i) {
    const JointVector q0 = posture();
    const JointVector none = JointVector::Zero(q0.size());
    const auto home = evaluate(twin.model, q0, none);
    // Along the self-motion by steps, each corrected by Newton's method.
    JointVector q = q0;
    VectorXd last = self_motion(twin, q0);
    for (int k = 0; k < 50; ++k) {
      VectorXd u = self_motion(twin, q).normalized();
      if (u.dot(last) < 0) u = -u;
      last = u;
      q += 0.004 * u;
      for (int pass = 0; pass < 4; ++pass) {
        const auto robot = evaluate(twin.model, q, none);
        const Eigen::AngleAxisd turn(home.R_BT * robot.R_BT.transpose());
        Vector6 error;
        error << home.p_BT_B - robot.p_BT_B, turn.angle() * turn.axis();
        const MatrixXd J = robot.J;
        q += J.transpose() * (J * J.transpose()).ldlt().solve(error);
      }
    }
    const JointVector dq = q - q0;
    ASSERT_GT(dq.norm(), 0.15);
    const controller::Settings settings = release_settings(twin, gains(q0, 0.3), 0.001);
    ReleasedArm arm(twin, settings, q0, dq);
    for (int k = 0; k < 300; ++k) {
      ASSERT_EQ(arm.step(), sim::Status::kOk);
      ASSERT_LT(arm.controller.snapshot().tip_wrench.norm(), 1e-6);
    }
    EXPECT_LT((arm.plant().position() - q).norm(), 1e-8);
    const auto there = evaluate(twin.model, q, none);
    EXPECT_LT((arm.torque - there.gravity).norm(), 1e-6);
  }
}

TEST_P(ClosedLoop, KeepsToTheTorqueLimits) {
  const JointVector q0 = posture();
  controller::Gains springs = gains(q0, 0.5);
  hold_posture(q0, springs);
  controller::Settings settings = release_settings(twin, springs, 0.001);
  const JointVector gravity =
      evaluate(twin.model, q0, JointVector::Zero(q0.size())).gravity.cwiseAbs();
  settings.limits.torque = gravity.array() + 4;
  ReleasedArm arm(twin, settings, q0, 0.05 * random.vector(q0.size()).normalized());
  JointVector last = arm.torque;
  for (int k = 0; k < 3000; ++k) {
    ASSERT_EQ(arm.step(), sim::Status::kOk);
    ASSERT_TRUE((arm.torque.cwiseAbs().array() <= settings.limits.torque.array()).all());
    ASSERT_TRUE(((arm.torque - last).cwiseAbs().array() <=
                 0.001 * (1 + 1e-9) * settings.limits.torque_rate.array())
                    .all());
    ASSERT_EQ(arm.plant().torque(), arm.torque);
    last = arm.torque;
  }
  EXPECT_EQ(arm.worst, controller::Status::kTorqueLimited) << to_text(arm.worst);
  EXPECT_LT((tip(arm.plant().position()) - tip(q0)).norm(), 1e-3);
}

// ----------------------------------------------------------------------------------------- energy

/// Returns the energy of motion and springs, J: 1/2 qd' M qd + 1/2 e' K_C e. For a stiffness that
/// is the same in all directions of rotation, and not coupled with translation, the second is a
/// potential of the law's springs however far they stretch.
double energy(const TwinModels& twin, const JointVector& q0, const Vector6& stiffness,
              const sim::Plant& plant) {
  const JointVector q = plant.position(), qd = plant.velocity();
  const auto home = evaluate(twin.model, q0, qd), robot = evaluate(twin.model, q, qd);
  const Eigen::AngleAxisd turn(home.R_BT * robot.R_BT.transpose());
  Vector6 e;
  e << home.p_BT_B - robot.p_BT_B, turn.angle() * turn.axis();
  return 0.5 * qd.dot(robot.M * qd) + 0.5 * e.dot(stiffness.cwiseProduct(e));
}

struct EnergyRun {
  double start = 0;         ///< J
  double end = 0;           ///< J
  double largest_rise = 0;  ///< in a tick, J
};

EnergyRun run(const TwinModels& twin, const JointVector& q0, const JointVector& dq, double damping,
              double period) {
  Vector6 stiffness;
  stiffness << 150, 150, 150, 10, 10, 10;
  controller::Gains gains;
  gains.task_stiffness = stiffness.asDiagonal();
  gains.task_damping = damping * gains.task_stiffness;
  gains.null_stiffness = gains.null_damping = JointVector::Zero(q0.size());
  sim::PlantOptions options;
  options.integrator.max_step = period;
  controller::Settings settings = release_settings(twin, gains, period);
  settings.feed_forward.coriolis = false;  // which would cancel the mechanism's own work
  ReleasedArm arm(twin, settings, q0, dq, options);
  EnergyRun result;
  double last = result.start = energy(twin, q0, stiffness, arm.plant());
  for (int k = 0; k < std::lround(0.4 / period); ++k) {
    EXPECT_EQ(arm.step(), sim::Status::kOk);
    const double now = energy(twin, q0, stiffness, arm.plant());
    result.largest_rise = std::max(result.largest_rise, now - last);
    last = now;
  }
  EXPECT_EQ(arm.worst, controller::Status::kOk) << to_text(arm.worst);
  result.end = last;
  return result;
}

TEST_P(ClosedLoop, LosesEnergyAtEveryTickWithEnoughDamping) {
  for (int i = 0; i < 3; ++i) {
    const JointVector q0 = posture();
    const JointVector dq = 0.05 * random.vector(q0.size()).normalized();
    const EnergyRun damped = run(twin, q0, dq, 0.02, 5e-4);
    EXPECT_LT(damped.largest_rise, 1e-5 * damped.start);
    EXPECT_LT(damped.end, 0.9 * damped.start);
  }
}

/// C = 0: the loop gains energy only from the hold, and half as much with half the period.
TEST_P(ClosedLoop, GainsNoEnergyButThroughTheHold) {
  const TwinModels smooth(GetParam(), false);
  for (int i = 0; i < 2; ++i) {
    const JointVector q0 = posture();
    const JointVector dq = 0.05 * random.vector(q0.size()).normalized();
    double last = 0;
    for (const double period : {1e-3, 5e-4, 2.5e-4}) {
      const EnergyRun free = run(smooth, q0, dq, 0, period);
      const double gain = free.end - free.start;
      EXPECT_LT(std::abs(gain), 0.5 * free.start);
      if (last != 0) {
        EXPECT_NEAR(last / gain, 2, 0.25);
      }
      last = gain;
    }
  }
}

/// From a stretched elbow to a pose far away. The tip's reference may be fast there one degree
/// further on; if it were so at once, the elbow would swing at 9 Hz with a quarter of its limit.
TEST(ClosedLoopOfAStretchedArm, LeavesItsSingularityWithoutVibrating) {
  const testing::Arm iiwa{"iiwa14", "iiwa_link_0", "iiwa_link_ee_kuka"};
  const TwinModels twin(iiwa);
  const JointVector from{{1.147, -0.790, -0.027, 0.047, -0.869, -1.257, 1.424}};
  const JointVector to{{1.143, -0.776, -0.541, -0.868, -1.229, -0.218, 2.0}};
  controller::Controller controller(twin.model, controller::default_settings(twin.model));
  controller::Setpoint goal = controller.settings().initial;
  goal.mode = controller::Mode::kCartesian;
  goal.joint_position.resize(0);  // no posture
  const auto there = evaluate(twin.model, to, JointVector::Zero(7));
  goal.tip_pose = {there.p_BT_B, there.R_BT};
  sim::Arm arm(twin.robot);
  sim::PlantOptions options;
  options.initial_torque = evaluate(twin.model, from, JointVector::Zero(7)).gravity;
  sim::Plant plant(arm, options, from);
  controller::RobotState state;
  JointVector torque = options.initial_torque;
  controller.reset(torque);
  int turns = 0;
  double last = 0;
  for (int k = 0; k < 2000; ++k) {
    goal.time = state.time += 1'000'000;
    state.position = plant.measured().position;
    state.velocity = plant.measured().velocity;
    controller.update(state, goal, torque);
    ASSERT_EQ(plant.step(torque), sim::Status::kOk);
    const double share = plant.velocity()[3] / controller.settings().limits.velocity[3];
    turns += share * last < 0 && std::abs(share) > 0.1 ? 1 : 0;
    if (std::abs(share) > 0.1) last = share;
  }
  EXPECT_EQ(controller.snapshot().fault, controller::Status::kOk);
  EXPECT_LE(turns, 2);
}

}  // namespace
}  // namespace dashpot
