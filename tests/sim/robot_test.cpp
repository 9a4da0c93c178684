// Reading robots: merged, lumped and turned links, and the errors of bad files.
#include <dashpot/sim/dynamics/articulated_body.hpp>
#include <dashpot/tests/sim/chains.hpp>
#include <dashpot/tests/sim/scenes.hpp>
#include <dashpot/tests/support/matrices.hpp>

#include <gmock/gmock.h>

#include <Eigen/Geometry>
#include <cmath>

namespace dashpot::sim {
namespace {

using Eigen::VectorXd;
using testing::near;
using testing::Random;

VectorXd accelerations(const Robot& robot, const VectorXd& q, const VectorXd& qd,
                       const VectorXd& tau) {
  ArticulatedBody bodies(robot);
  VectorXd qdd(robot.dof());
  bodies.move_to(q.data(), qd.data());
  bodies.accelerations(tau.data(), qdd.data());
  return qdd;
}

/// Two robots of the same joints move alike.
void expect_same_dynamics(const Robot& a, const Robot& b, std::uint64_t seed) {
  ASSERT_EQ(a.dof(), b.dof());
  Random random(seed);
  for (int trial = 0; trial < 10; ++trial) {
    const VectorXd q = random.vector(a.dof()), qd = random.vector(a.dof());
    const VectorXd tau = 10 * random.vector(a.dof());
    const VectorXd expected = accelerations(a, q, qd, tau);
    EXPECT_TRUE(near(accelerations(b, q, qd, tau), expected, 1e-10 * expected.norm()));
  }
}

std::string with_text_before(std::string text, const std::string& mark, const std::string& added) {
  return text.insert(text.find(mark), added);
}

const std::string kTool =
    "<inertial><origin xyz='0.03 -0.02 0.07' rpy='0.4 -0.3 1.1'/><mass value='1.3'/>"
    "<inertia ixx='0.004' iyy='0.006' izz='0.005' ixy='0.001' ixz='-0.0005' iyz='0.0002'/>"
    "</inertial>";

Inertia tool() {
  const Eigen::Matrix3d R = (Eigen::AngleAxisd(1.1, Eigen::Vector3d::UnitZ()) *
                             Eigen::AngleAxisd(-0.3, Eigen::Vector3d::UnitY()) *
                             Eigen::AngleAxisd(0.4, Eigen::Vector3d::UnitX()))
                                .toRotationMatrix();
  const Eigen::Matrix3d I{
      {0.004, 0.001, -0.0005}, {0.001, 0.006, 0.0002}, {-0.0005, 0.0002, 0.005}};
  const Eigen::Matrix3d turned = R * I * R.transpose();
  return {1.3, {0.03, -0.02, 0.07}, 0.5 * (turned + turned.transpose())};
}

TEST(Robot, CarriesAPayloadLikeALinkAtItsTip) {
  const testing::ChainFile plain = testing::panda_file();
  testing::ChainFile with_tool = plain;
  with_tool.urdf = with_text_before(plain.urdf, "</robot>",
                                    "<link name='tool'>" + kTool +
                                        "</link><joint name='tool_joint' type='fixed'><parent "
                                        "link='panda_hand_tcp'/><child link='tool'/></joint>");
  RobotParameters parameters;
  parameters.payload = tool();
  const Robot loaded = testing::robot_of(plain, parameters);
  expect_same_dynamics(loaded, testing::robot_of(with_tool), 731);  // hangs off the chain
  with_tool.tip = "tool";
  expect_same_dynamics(loaded, testing::robot_of(with_tool), 732);  // is on the chain
}

TEST(Robot, CountsLinksOffTheChainRigidAtTheirZeroPosition) {
  const testing::ChainFile plain = testing::panda_file();
  // A finger on a slide that stands 0.2 m up, turned a quarter, off link 4.
  const auto finger = [](const std::string& type) {
    return "<link name='finger'>" + kTool + "</link><joint name='slide' type='" + type +
           "'><parent link='panda_link4'/><child link='finger'/><origin xyz='0 0.1 0.2' "
           "rpy='1.5707963267948966 0 0'/><axis xyz='1 0 0'/><limit lower='-1' upper='1' "
           "effort='1' velocity='1'/></joint>";
  };
  testing::ChainFile fixed = plain, sliding = plain;
  fixed.urdf = with_text_before(plain.urdf, "</robot>", finger("fixed"));
  sliding.urdf = with_text_before(plain.urdf, "</robot>", finger("prismatic"));
  const Robot robot = testing::robot_of(sliding);
  expect_same_dynamics(robot, testing::robot_of(fixed), 733);
  const auto mass = [](const Robot& of) {
    double sum = 0;
    for (const Joint& joint : of.joints()) sum += joint.inertia.mass;
    return sum;
  };
  EXPECT_NEAR(mass(robot), mass(testing::robot_of(plain)) + 1.3, 1e-12);
}

TEST(Robot, StopsAtTheTipButCountsWhatComesBeyond) {
  testing::ChainFile file = testing::panda_file();
  const Robot whole = testing::robot_of(file);
  file.tip = "panda_link4";
  const Robot half = testing::robot_of(file);
  ASSERT_EQ(half.dof(), 4);
  // Held still, the joints beyond link 4 weigh as much: same static torque, from M qdd = -g at
  // rest.
  ArticulatedBody a(whole), b(half);
  VectorXd q = VectorXd::Zero(7);
  q.head(4) << 0.3, -0.5, 0.2, -1.9;
  const VectorXd rest = VectorXd::Zero(7);
  a.move_to(q.data(), rest.data());
  b.move_to(q.data(), rest.data());
  EXPECT_NEAR(a.gravity_energy(), b.gravity_energy(), 1e-12 * std::abs(a.gravity_energy()));
}

TEST(Robot, GivesGravityInTheAxesOfTheBase) {
  const std::string urdf =
      "<robot name='r'><link name='root'/><link name='base'/><link name='tip'>" + kTool +
      "</link><joint name='mount' type='continuous'><parent link='root'/><child link='base'/>"
      "<origin xyz='1 2 3' rpy='1.5707963267948966 0 0'/><axis xyz='0 1 0'/></joint>"
      "<joint name='j' type='continuous'><parent link='base'/><child link='tip'/>"
      "<axis xyz='0 0 1'/></joint></robot>";
  // The base's y axis is the root's z.
  EXPECT_TRUE(near(Robot::from_text(urdf, "base", "tip").gravity(), Eigen::Vector3d(0, -9.81, 0),
                   1e-15 * 10));
  RobotParameters parameters;
  parameters.gravity = {1, 2, 3};
  EXPECT_TRUE(near(Robot::from_text(urdf, "base", "tip", parameters).gravity(),
                   Eigen::Vector3d(1, 3, -2), 1e-14));
}

TEST(Robot, ReadsLimitsAndFriction) {
  const Robot panda = testing::robot_of(testing::panda_file());
  ASSERT_EQ(panda.dof(), 7);
  const Joint& elbow = panda.joints()[3];
  EXPECT_EQ(elbow.name, "panda_joint4");
  EXPECT_EQ(elbow.lower, -3.0718);
  EXPECT_EQ(elbow.upper, -0.0698);
  EXPECT_EQ(elbow.effort, 87);
  EXPECT_EQ(elbow.velocity, 2.175);
  EXPECT_EQ(elbow.viscous_friction, 0.003);
  EXPECT_EQ(elbow.coulomb_friction, 0);
  EXPECT_EQ(elbow.reflected_inertia, 0);
  const Joint hinge = testing::pendulum(1).joints()[0];
  EXPECT_EQ(hinge.lower, -std::numeric_limits<double>::infinity());
  EXPECT_EQ(hinge.upper, std::numeric_limits<double>::infinity());
  EXPECT_EQ(hinge.effort, std::numeric_limits<double>::infinity());
}

TEST(Robot, TakesParametersInsteadOfTheFile) {
  RobotParameters parameters;
  parameters.reflected_inertia = JointVector::LinSpaced(7, 1, 7);
  parameters.viscous_friction = JointVector::LinSpaced(7, 11, 17);
  parameters.coulomb_friction = JointVector::LinSpaced(7, 21, 27);
  const Robot panda = testing::robot_of(testing::panda_file(), parameters);
  EXPECT_EQ(panda.joints()[4].reflected_inertia, 5);
  EXPECT_EQ(panda.joints()[4].viscous_friction, 15);
  EXPECT_EQ(panda.joints()[4].coulomb_friction, 25);
}

// ---------------------------------------------------------------------------------------- errors

/// The message for a file in which `joint` and `link` stand for the only joint and its child.
std::string refusal(const std::string& joint, const std::string& inertial = kTool,
                    const RobotParameters& parameters = {}, const std::string& tip = "b",
                    const std::string& more = "") {
  const std::string urdf = "<robot name='r'><link name='a'/><link name='b'>" + inertial +
                           "</link><joint name='j' " + joint +
                           "<parent link='a'/><child link='b'/></joint>" + more + "</robot>";
  const std::string said = testing::refusal<InvalidRobot>(
      [&] { Robot::from_text(urdf, "a", tip, parameters, "arm.urdf"); });
  EXPECT_EQ(said.find('\n'), std::string::npos) << "more than a line";
  return said;
}

const std::string kHinge = "type='continuous'><axis xyz='0 0 1'/>";

TEST(RobotErrors, NameTheFileTheElementAndTheReason) {
  using ::testing::AllOf;
  using ::testing::HasSubstr;
  EXPECT_EQ(refusal(kHinge), "accepted");
  // Found here:
  EXPECT_EQ(refusal(kHinge, kTool, {}, "c"), "arm.urdf: tip link 'c' does not exist");
  EXPECT_EQ(refusal("type='fixed'>"),
            "arm.urdf: the chain from 'a' to 'b' has 0 moving joints, must have 1 to 16");
  EXPECT_EQ(refusal("type='floating'>"),
            "arm.urdf: joint 'j': type must be fixed, revolute, continuous or prismatic on the "
            "chain");
  EXPECT_EQ(refusal("type='continuous'><axis xyz='0 0 0'/>"),
            "arm.urdf: joint 'j': axis is zero or not finite");
  EXPECT_EQ(refusal("type='continuous'><axis xyz='0 0 1'/><mimic joint='k'/>"),
            "arm.urdf: joint 'j': mimics another joint; on the chain it must move by itself");
  EXPECT_EQ(refusal("type='revolute'><limit lower='1' upper='-1' effort='1' velocity='1'/>"),
            "arm.urdf: joint 'j': lower limit is not below upper limit");
  EXPECT_EQ(refusal("type='revolute'><limit lower='-1' upper='1' effort='-1' velocity='1'/>"),
            "arm.urdf: joint 'j': limit effort is negative");
  EXPECT_EQ(refusal(kHinge + "<dynamics damping='-2'/>"),
            "arm.urdf: joint 'j': dynamics damping: is -2 N m s/rad, must be finite and not "
            "negative");
  EXPECT_EQ(refusal(kHinge,
                    "<inertial><mass value='-1'/><inertia ixx='1' iyy='1' izz='1' ixy='0' "
                    "ixz='0' iyz='0'/></inertial>"),
            "arm.urdf: link 'b': mass: is -1 kg, must be finite and not negative");
  EXPECT_EQ(refusal(kHinge,
                    "<inertial><mass value='1'/><inertia ixx='1' iyy='1' izz='1' ixy='2' "
                    "ixz='0' iyz='0'/></inertial>"),
            "arm.urdf: link 'b': inertia has the negative principal moment -1 kg m^2");
  const std::string rounded =
      "<inertial><mass value='1'/><inertia ixx='-1e-35' iyy='0' izz='0' ixy='0' ixz='0' iyz='0'/>"
      "<origin xyz='1 0 0'/></inertial>";
  EXPECT_EQ(refusal(kHinge, rounded), "accepted");
  RobotParameters any;
  any.accept_inertias = true;
  EXPECT_EQ(refusal(kHinge,
                    "<inertial><mass value='1'/><inertia ixx='-1' iyy='1' izz='1' ixy='0' "
                    "ixz='0' iyz='0'/></inertial>",
                    any),
            "accepted");
  EXPECT_EQ(refusal(kHinge, ""), "arm.urdf: joint 'j': moves no mass and has no reflected_inertia");
  EXPECT_EQ(refusal(kHinge, kTool, {}, "b",
                    "<joint name='k' type='fixed'><parent link='a'/><child link='b'/></joint>"),
            "arm.urdf: link 'b' is the child of two joints");
  EXPECT_EQ(refusal(kHinge, kTool, {}, "b",
                    "<link name='x'/><link name='y'/>"
                    "<joint name='k' type='fixed'><parent link='x'/><child link='y'/></joint>"
                    "<joint name='l' type='fixed'><parent link='y'/><child link='x'/></joint>"),
            "arm.urdf: link 'x' is part of a loop");
  // Found by the parser:
  EXPECT_THAT(refusal("type='bogus'>"), AllOf(HasSubstr("arm.urdf: "), HasSubstr("[j]")));
  EXPECT_THAT(refusal("type='revolute'>"), AllOf(HasSubstr("arm.urdf: "), HasSubstr("[j]")));
  EXPECT_THAT(refusal("type='continuous'><axis xyz='0 0 nan'/>"), HasSubstr("[j]"));
  EXPECT_THAT(refusal(kHinge, "<inertial><mass value='x'/></inertial>"), HasSubstr("arm.urdf: "));
  EXPECT_THAT(refusal(kHinge, kTool, {}, "b", "<link name='loose'/>"), HasSubstr("loose"));
}

TEST(RobotErrors, NameTheParameter) {
  RobotParameters parameters;
  parameters.reflected_inertia = testing::joints({1, 2});
  EXPECT_EQ(refusal(kHinge, kTool, parameters),
            "reflected_inertia: has 2 entries, the chain has 1 joints");
  parameters = {};
  parameters.viscous_friction = testing::joints({-1});
  EXPECT_EQ(refusal(kHinge, kTool, parameters),
            "viscous friction of joint 'j': is -1 N m s/rad, must be finite and not negative");
  parameters = {};
  parameters.payload.mass = -3;
  EXPECT_EQ(refusal(kHinge, kTool, parameters),
            "payload: mass: is -3 kg, must be finite and not negative");
  parameters = {};
  parameters.payload.about_center(0, 1) = 1;
  EXPECT_EQ(refusal(kHinge, kTool, parameters), "payload: inertia is not symmetric");
  parameters = {};
  parameters.gravity[1] = std::nan("");
  EXPECT_EQ(refusal(kHinge, kTool, parameters), "gravity: is not finite");
}

TEST(RobotErrors, NameTheFileThatIsNotThereOrNotARobot) {
  const auto refused = [](const auto& read) { return testing::refusal<InvalidRobot>(read); };
  EXPECT_EQ(refused([] { Robot::from_file("/nowhere/arm.urdf", "a", "b"); }),
            "/nowhere/arm.urdf: cannot be read: No such file or directory");
  EXPECT_THAT(refused([] { Robot::from_text("garbage", "a", "b", {}, "arm.urdf"); }),
              ::testing::StartsWith("arm.urdf: "));
  EXPECT_EQ(refused([] {
              Robot::from_text(testing::panda_file().urdf, "panda_link3", "panda_link1", {}, "p");
            }),
            "p: tip link 'panda_link1' does not hang on base link 'panda_link3'");
}

TEST(RobotErrors, AreForTextsThatWouldOverflowTheStack) {
  const auto refused = [](const std::string& text) {
    return testing::refusal<InvalidRobot>([&] { Robot::from_text(text, "l0", "l1", {}, "p"); });
  };
  std::string nested;
  for (int i = 0; i < 100'000; ++i) nested += "<a>";
  for (int i = 0; i < 100'000; ++i) nested += "</a>";
  EXPECT_EQ(refused("<robot name='r'>" + nested + "</robot>"),
            "p: line 1: elements are nested more than 64 deep");
  const auto chain = [](int links) {
    std::string text = "<robot name='r'><link name='l0'/>";
    for (int i = 1; i <= links; ++i) {
      const std::string number = std::to_string(i), before = std::to_string(i - 1);
      text += "<link name='l" + number + "'>" + kTool + "</link><joint name='j" + number +
              "' type='" + (i == 1 ? "continuous" : "fixed") + "'><parent link='l" + before +
              "'/><child link='l" + number + "'/></joint>";
    }
    return text + "</robot>";
  };
  EXPECT_EQ(refused(chain(2500)), "p: line 1: holds more than 2000 links");
  const Robot robot = Robot::from_text(chain(1900), "l0", "l1");
  EXPECT_NEAR(robot.joints()[0].inertia.mass, 1900 * 1.3, 1e-9);
}

}  // namespace
}  // namespace dashpot::sim
