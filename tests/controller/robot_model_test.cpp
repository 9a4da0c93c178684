// A model from a URDF and from its options.
#include <dashpot/tests/support/arms.hpp>
#include <dashpot/tests/support/dynamics_match.hpp>
#include <dashpot/tests/support/random_robot.hpp>
#include <dashpot/tests/support/special_values.hpp>

#include <gmock/gmock.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <string>

namespace dashpot::controller {
namespace {

using ::testing::ElementsAre;
using testing::kInfinity;
using testing::near;
using testing::RandomRobot;
using testing::same_dynamics;

/// `text` with `more` before its end.
std::string with(const std::string& text, const std::string& more) {
  return text.substr(0, text.rfind("</robot>")) + more + "</robot>";
}

RobotModel chain(const std::string& text, const ModelOptions& options = {}) {
  return RobotModel::from_urdf_text(text, "link0", "tip", options);
}

DynamicsResult at(const RobotModel& model) {
  const int n = model.dof();
  return evaluate(model, JointVector::LinSpaced(n, -1, 1.3), JointVector::LinSpaced(n, 0.7, -0.4));
}

::testing::AssertionResult same(const RobotModel& a, const RobotModel& b) {
  return same_dynamics(at(a), at(b), JointVector::Ones(b.dof()), 1e-13);
}

TEST(RobotModel, TakesJointsFromTheFile) {
  const RobotModel model = testing::arm_model(testing::arms()[0]);
  EXPECT_EQ(model.name(), "panda");
  EXPECT_EQ(model.base(), "panda_link0");
  EXPECT_EQ(model.tip(), "panda_hand_tcp");
  ASSERT_EQ(model.dof(), 7);
  const Joint& elbow = model.joints()[3];
  EXPECT_EQ(elbow.name, "panda_joint4");
  EXPECT_EQ(elbow.type, JointType::kRevolute);
  EXPECT_EQ(elbow.lower, -3.0718);
  EXPECT_EQ(elbow.upper, -0.0698);
  EXPECT_EQ(elbow.velocity, 2.175);
  EXPECT_EQ(elbow.effort, 87);
  EXPECT_EQ(elbow.viscous_friction, 0.003);
  EXPECT_EQ(elbow.coulomb_friction, 0);
  EXPECT_EQ(elbow.reflected_inertia, 0);
  EXPECT_THAT(model.joint_values(&Joint::effort), ElementsAre(87, 87, 87, 87, 12, 12, 12));
  EXPECT_EQ(model.gravity(), Eigen::Vector3d(0, 0, -9.81));
}

/// A link on a joint without limits, about this axis.
RobotModel hinge(const std::string& axis) {
  return RobotModel::from_urdf_text(
      "<robot name='r'><link name='a'/><link name='b'>" +
          testing::inertial(1, {0.3, 0.1, 0}, 0.1 * Eigen::Matrix3d::Identity()) +
          "</link><joint name='j' type='continuous'><parent link='a'/><child link='b'/><axis "
          "xyz='" +
          axis + "'/></joint></robot>",
      "a", "b");
}

TEST(RobotModel, GivesAContinuousJointNoLimits) {
  const Joint joint = hinge("1 0 0").joints()[0];
  EXPECT_EQ(joint.type, JointType::kContinuous);
  EXPECT_EQ(joint.lower, -kInfinity);
  for (const double limit : {joint.upper, joint.velocity, joint.effort}) {
    EXPECT_EQ(limit, kInfinity);
  }
}

TEST(RobotModel, TakesAnAxisOfAnyLength) {
  EXPECT_TRUE(same(hinge("0 0.6 -0.8"), hinge("0 6e-4 -8e-4")));
}

TEST(RobotModel, TakesReflectedInertiaAndFrictionFromTheOptions) {
  ModelOptions options;
  options.viscous_friction = JointVector::LinSpaced(7, 1, 7);
  options.coulomb_friction = JointVector::LinSpaced(7, 0.1, 0.7);
  options.reflected_inertia = JointVector::LinSpaced(7, 0.1, 0.7);
  const RobotModel model = testing::arm_model(testing::arms()[0], options);
  EXPECT_EQ(model.joint_values(&Joint::viscous_friction), options.viscous_friction);
  EXPECT_EQ(model.joint_values(&Joint::coulomb_friction), options.coulomb_friction);
  DynamicsResult expected = at(testing::arm_model(testing::arms()[0]));  // without friction
  expected.M.diagonal() += options.reflected_inertia;
  EXPECT_TRUE(same_dynamics(at(model), expected, JointVector::Ones(7), 1e-14));
}

TEST(RobotModel, CarriesAPayloadAsItWouldALink) {
  RandomRobot random(741);
  const std::string text = random.chain(5, 0.3);
  ModelOptions options;
  options.payload.mass = 1.7;
  options.payload.center = {0.1, -0.05, 0.2};
  options.payload.inertia = random.inertia(1.7, 0.1);
  const std::string link =
      "<link name='load'>" +
      testing::inertial(1.7, options.payload.center, options.payload.inertia) +
      "</link><joint name='grasp' type='fixed'><parent link='tip'/><child link='load'/></joint>";
  const RobotModel loaded = chain(text, options);
  EXPECT_TRUE(same(loaded, chain(with(text, link))));
  const double bare = at(chain(text)).M(0, 0);
  EXPECT_GT(std::abs(at(loaded).M(0, 0) - bare), 0.01);
}

TEST(RobotModel, WeighsLinksOffTheChainAtTheirZeroPosition) {
  RandomRobot random(742);
  const std::string text = random.chain(6, 0.3);
  // A finger on a joint that moves, with a nail on it, on a link in the middle of the chain.
  const std::string finger = random.joint("f", "prismatic", "link3", "finger");
  const std::string nail = random.joint("g", "continuous", "finger", "nail");
  const std::string links = random.link("finger") + random.link("nail");
  const auto fixed = [](std::string joint) {
    const auto at = joint.find("type='");
    return joint.replace(at, joint.find('\'', at + 6) + 1 - at, "type='fixed'");
  };
  const auto model = [&](const std::string& more, bool include = true) {
    ModelOptions options;
    options.include_off_chain = include;
    return chain(with(text, more), options);
  };
  const RobotModel moving = model(links + finger + nail);
  EXPECT_TRUE(same(moving, model(links + fixed(finger) + fixed(nail))));
  EXPECT_FALSE(same(moving, model("")));
  EXPECT_TRUE(same(model(links + finger + nail, false), model("")));
  // What stands still
  const std::string camera = random.link("camera") + random.joint("c", "fixed", "link0", "camera");
  EXPECT_TRUE(same(model(camera), model("")));
}

TEST(RobotModel, TurnsGravityIntoTheAxesOfABaseThatIsNotTheRoot) {
  RandomRobot random(744);
  const std::string text = random.chain(8, 0.3);
  // From link 3 on, with the joints before it at zero, against the whole chain.
  const RobotModel whole = chain(text);
  const RobotModel part = RobotModel::from_urdf_text(text, "link3", "tip");
  ASSERT_EQ(part.dof(), 5);
  JointVector q = JointVector::Zero(8), qd = JointVector::Zero(8);
  q.tail(5) = JointVector::LinSpaced(5, -1, 1.3);
  qd.tail(5) = JointVector::LinSpaced(5, 0.7, -0.4);
  const DynamicsResult all = evaluate(whole, q, qd), some = at(part);
  const Eigen::Matrix3d R = evaluate(RobotModel::from_urdf_text(text, "link0", "link3"),
                                     JointVector::Zero(3), JointVector::Zero(3))
                                .R_BT;
  EXPECT_TRUE(near(some.M, all.M.bottomRightCorner(5, 5), 1e-12));
  EXPECT_TRUE(near(some.coriolis, all.coriolis.tail(5), 1e-12));
  EXPECT_TRUE(near(some.gravity, all.gravity.tail(5), 1e-12));
  EXPECT_TRUE(near(R * some.J.topRows<3>(), all.J.topRightCorner(3, 5), 1e-13));
  EXPECT_TRUE(near(R * some.R_BT, all.R_BT, 1e-14));
}

TEST(RobotModel, MovesTheTipToTheTool) {
  const auto& arm = testing::arms()[1];
  ModelOptions options;
  options.tool.position = {0.1, 0.2, -0.3};
  options.tool.rotation =
      Eigen::AngleAxisd(0.7, Eigen::Vector3d(1, 2, -1).normalized()).toRotationMatrix();
  const DynamicsResult bare = at(testing::arm_model(arm)),
                       tool = at(testing::arm_model(arm, options));
  const Eigen::Vector3d r = bare.R_BT * options.tool.position;
  EXPECT_TRUE(near(tool.p_BT_B, bare.p_BT_B + r, 1e-14));
  EXPECT_TRUE(near(tool.R_BT, bare.R_BT * options.tool.rotation, 1e-14));
  EXPECT_TRUE(near(tool.M, bare.M, 1e-13));
  EXPECT_TRUE(near(tool.J.bottomRows<3>(), bare.J.bottomRows<3>(), 1e-15));
  for (int i = 0; i < 7; ++i) {
    const Eigen::Vector3d axis = bare.J.col(i).tail<3>();
    EXPECT_TRUE(near(tool.J.col(i).head<3>(), bare.J.col(i).head<3>() + axis.cross(r), 1e-14));
  }
}

TEST(RobotModel, MergesFixedJointsAndMasslessLinks) {
  RandomRobot random(745);
  // A link split in two by a fixed joint without an offset, with a massless one between.
  const std::string head =
      "<robot name='r'><link name='a'/>" + random.joint("j", "revolute", "a", "b");
  const std::string inertia_1 = testing::inertial(1, {0.1, 0, 0}, random.inertia(1, 0.1));
  const std::string inertia_2 = testing::inertial(2, {0, 0.3, 0}, random.inertia(2, 0.1));
  const auto fixed = [](const std::string& name, const std::string& parent,
                        const std::string& child, const std::string& origin) {
    return "<joint name='" + name + "' type='fixed'><parent link='" + parent + "'/><child link='" +
           child + "'/><origin " + origin + "/></joint>";
  };
  const std::string bodies =
      "<link name='b'>" + inertia_1 + "</link><link name='d'>" + inertia_2 + "</link>";
  const RobotModel split = RobotModel::from_urdf_text(
      head + bodies + "<link name='c'/>" + fixed("k", "b", "c", "xyz='1 2 3' rpy='0 0 1.5'") +
          fixed("l", "c", "d", "xyz='-2 1 -3' rpy='0 0 -1.5'") + "</robot>",
      "a", "d");
  EXPECT_EQ(split.dof(), 1);
  // The second joint's offset undoes the first: Rz(1.5) (-2, 1, -3) + (1, 2, 3).
  const Eigen::Vector3d p =
      Eigen::AngleAxisd(1.5, Eigen::Vector3d::UnitZ()) * Eigen::Vector3d(-2, 1, -3) +
      Eigen::Vector3d(1, 2, 3);
  const RobotModel joined = RobotModel::from_urdf_text(
      head + bodies + fixed("k", "b", "d", "xyz='" + testing::exact(p) + "'") + "</robot>", "a",
      "d");
  EXPECT_TRUE(same(split, joined));
}

}  // namespace
}  // namespace dashpot::controller
