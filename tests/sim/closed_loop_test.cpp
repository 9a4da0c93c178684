// Arms under the real controller in simulation, along a self-motion and out of a singularity.
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

  /// An impedance that the drives can hold with torque to spare.
  JointVector posture() {
    const JointVector limit = twin.model.joint_values(&controller::Joint::effort);
    for (;;) {
      const JointVector q = random_posture(twin, random);
      const auto robot = evaluate(twin.model, q, JointVector::Zero(q.size()));
      if ((robot.gravity.cwiseAbs().array() < 0.6 * limit.array()).all()) return q;
    }
  }
};
INSTANTIATE_TEST_SUITE_P(Arms, ClosedLoop, ::testing::ValuesIn(testing::arms()),
                         [](const auto& instance) { return std::string(instance.param.file); });

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
    const VectorXd omega{{8, 11, 14, 18, 23, 30}};
    const controller::Gains gains =
        tip_gains(twin, q0, omega, VectorXd::Constant(6, 0.3), 0, random);
    const controller::Settings settings = release_settings(twin, gains, 0.001);
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
