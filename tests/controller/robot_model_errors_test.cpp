// A fault of a URDF or an option is described in one line that names it.
#include <dashpot/tests/support/arms.hpp>
#include <dashpot/tests/support/places.hpp>
#include <dashpot/tests/support/random_robot.hpp>

#include <gmock/gmock.h>

#include <algorithm>
#include <limits>
#include <string>

namespace dashpot::controller {
namespace {

using ::testing::EndsWith;
using ::testing::HasSubstr;
using ::testing::IsEmpty;
using ::testing::Not;
using ::testing::StartsWith;

constexpr double kNaN = std::numeric_limits<double>::quiet_NaN();

/// Message of the InvalidModel that the model throws; nothing of it reaches the console.
std::string problem(const std::string& text, const ModelOptions& options = {},
                    const std::string& base = "a", const std::string& tip = "b") {
  ::testing::internal::CaptureStderr();
  ::testing::internal::CaptureStdout();
  std::string message = "no error";
  try {
    RobotModel::from_urdf_text(text, base, tip, options, "arm.urdf");
  } catch (const InvalidModel& error) {
    message = error.what();
  }
  EXPECT_THAT(::testing::internal::GetCapturedStderr(), IsEmpty());
  EXPECT_THAT(::testing::internal::GetCapturedStdout(), IsEmpty());
  EXPECT_THAT(message, Not(HasSubstr("\n")));
  return message;
}

std::string robot(const std::string& parts) {
  return "<robot name='r'>" + parts + "</robot>";
}

std::string joint(const std::string& name, const std::string& parent, const std::string& child,
                  const std::string& type = "revolute", const std::string& more = "") {
  return "<joint name='" + name + "' type='" + type + "'><parent link='" + parent +
         "'/><child link='" + child + "'/>" + more +
         (more.find("<limit") == std::string::npos
              ? "<limit lower='-1' upper='1' effort='1' velocity='1'/>"
              : "") +
         "</joint>";
}

std::string inertial(const std::string& mass, const std::string& ixx, const std::string& iyy,
                     const std::string& izz, const std::string& ixy = "0") {
  return "<inertial><origin xyz='0.1 0.2 0.3'/><mass value='" + mass + "'/><inertia ixx='" + ixx +
         "' ixy='" + ixy + "' ixz='0' iyy='" + iyy + "' iyz='0' izz='" + izz + "'/></inertial>";
}

const std::string kGood = inertial("2", "1", "1", "1");

/// One joint, "j", from "a" to "b", with this content of link b and of the joint.
std::string arm(const std::string& link, const std::string& more = "",
                const std::string& type = "revolute") {
  return robot("<link name='a'/><link name='b'>" + link + "</link>" +
               joint("j", "a", "b", type, more));
}

TEST(RobotModelErrors, NameTheFileThatCannotBeRead) {
  for (const auto& [path, what] :
       {std::pair(testing::arm_path("no_such_arm"), "cannot be read: No such file or directory"),
        std::pair(std::string(DASHPOT_SOURCE_DIR), "cannot be read: Is a directory"),
        std::pair(testing::arm_path("panda"), "link 'a': there is none; ")}) {
    EXPECT_THAT([file = path] { RobotModel::from_urdf_file(file, "a", "b"); },
                ::testing::ThrowsMessage<InvalidModel>(StartsWith(path + ": " + what)));
  }
}

const std::string kTwoLinks = "<link name='a'/><link name='b'>" + kGood + "</link>";
const std::string kMoreLinks = "<link name='c'/><link name='d'/>";

TEST(RobotModelErrors, AreOneLineThatNamesTheElement) {
  const struct {
    std::string text;
    const char* start;   // after "arm.urdf: "
    const char* reason;  // a part of it
  } cases[] = {
      {"", "", "is not a robot description: it contains no XML"},
      {"mass: [[1]]", "", "is not a robot description: it contains no XML"},
      {"<robot name='r'><link name='a'", "", ""},
      {"<sdf/>", "is SDF, ", "give the URDF or xacro that it was made from"},
      {"<?xml version='1.0'?><mujoco model='a'/>", "is MJCF, ", "dashpot.Robot.from_mujoco"},
      {"<mujocoinclude/>", "is MJCF, ", "save()"},
      {"<model/>", "", "robot"},
      {robot(""), "", "No link elements"},
      {robot(kTwoLinks + joint("j", "x", "b")), "", "[x]"},
      {robot("<link name='b'/>"), "link 'a': ", "there is none"},
      {robot("<link name='a'/>"), "link 'b': ", "there is none"},
      {robot(kTwoLinks + "<link name='c'/>" + joint("j", "a", "b") + joint("k", "a", "c") +
             joint("l", "c", "b")),
       "link 'b': ", "child of two joints, 'j' and 'l'"},
      {robot(kTwoLinks + joint("j", "a", "b") + joint("k", "b", "a")), "", "root"},
      {robot(kTwoLinks + kMoreLinks + joint("j", "a", "b") + joint("k", "c", "d") +
             joint("l", "d", "c")),
       "link 'c': ", "loop"},
      {robot(kTwoLinks), "", "root"},
      {robot(kTwoLinks + "<link name='a'/>"), "", "'a' is not unique"},
      {robot("<link name='a'/><link name='b'/>" + joint("j", "b", "a")),
       "link 'b': ", "not beyond the base, 'a'"},
      {robot(kTwoLinks + joint("j", "a", "b", "fixed")),
       "link 'b': ", "no joint moves it against 'a'"},
      {arm(kGood, "", "floating"), "joint 'j': ", "floating joints are not"},
      {arm(kGood, "", "planar"), "joint 'j': ", "planar joints are not"},
      {arm(kGood, "", "screw"), "", "[screw]"},
      {robot("<link name='a'/><link name='c'>" + kGood + "</link><link name='b'>" + kGood +
             "</link>" + joint("k", "a", "c") +
             joint("j", "c", "b", "revolute", "<mimic joint='k'/>")),
       "joint 'j': ", "mimics joint 'k'"},
      {arm(kGood, "<axis xyz='0 0 0'/>"), "joint 'j': ", "axis"},
      {arm(kGood, "<axis xyz='0 nan 1'/>"), "", "[j]"},
      {arm(kGood, "<limit lower='1' upper='-1' effort='1' velocity='1'/>"),
       "joint 'j': ", "lower limit is above its upper"},
      {arm(kGood, "<!--<limit-->"), "", "limits"},
      {arm(kGood, "<limit lower='0' upper='1' effort='1' velocity='-1'/>"),
       "joint 'j': ", "negative"},
      {arm(kGood, "<dynamics damping='-1' friction='0'/>"), "joint 'j': ", "damping is negative"},
      {arm(kGood, "<dynamics damping='1' friction='-1'/>"), "joint 'j': ", "friction is negative"},
      {arm(inertial("-2", "1", "1", "1")), "link 'b': ", "mass is negative"},
      {arm(inertial("nan", "1", "1", "1")), "", "[b]"},
      {arm(inertial("2kg", "1", "1", "1")), "", "[b]"},
      {arm(inertial("2", "1e999", "1", "1")), "", "[b]"},
      {arm(inertial("2", "-1", "1", "1")),
       "link 'b': ", "not positive definite: a principal moment is -1 kg m^2"},
      {arm(inertial("2", "1", "1", "1", "1.5")), "link 'b': ", "not positive definite"},
      {arm(inertial("2", "1", "1", "2.1")),
       "link 'b': ", "breaks the triangle inequality by 5 %: principal moments 1, 1, 2.1 kg m^2"},
      {arm(""), "joint 'j': ", "no inertia resists it"},
      {arm("<inertial><origin xyz='3 0 0'/><mass value='1'/><inertia ixx='0' ixy='0' ixz='0' "
           "iyy='0' iyz='0' izz='0'/></inertial>",
           "<origin xyz='0.1 0.2 0.3' rpy='1 2 3'/><axis xyz='1 0 0'/>"),
       "joint 'j': ", "no inertia resists it"},
      {robot("<link name='a'/><link name='c'/><link name='b'>" + kGood + "</link>" +
             joint("k", "a", "c") + joint("j", "c", "b")),
       "joint 'k': ", "no inertia resists it"},
      {robot(kTwoLinks + "<link name='c'>" + inertial("-1", "1", "1", "1") + "</link>" +
             joint("j", "a", "b") + joint("k", "b", "c")),
       "link 'c': ", "negative"},
  };
  for (const auto& [text, start, reason] : cases) {
    SCOPED_TRACE(text);
    const std::string message = problem(text);
    EXPECT_THAT(message, StartsWith(std::string("arm.urdf: ") + start));
    EXPECT_THAT(message, HasSubstr(reason));
  }
}

TEST(RobotModelErrors, AreWarningsWhereTheyCannotMatter) {
  for (const auto& [text, said] :
       {std::pair(arm(inertial("2", "-2.1e-12", "0", "0")),
                  "a principal moment is -2.1e-12 kg m^2"),
        {arm(inertial("2", "0", "0", "2.1e-12")), "breaks the triangle inequality"}}) {
    EXPECT_THAT(RobotModel::from_urdf_text(text, "a", "b").warnings(),
                ::testing::ElementsAre(HasSubstr(said)));
  }
}

TEST(RobotModelErrors, SpareWhatCanExist) {
  for (const std::string& good : {
           kGood,
           inertial("2", "1", "1", "2.005"),     // rounded
           inertial("2", "0", "1", "1"),         // a thin rod
           inertial("2", "0", "0", "0"),         // a point mass
           inertial("2", "-1e-35", "0", "0"),    // what rounding makes of zero:
           inertial("2", "-1.9e-12", "0", "0"),  // 1e-12 m^2 times 2 kg
           inertial("2", "0", "0", "1.9e-12"),
       }) {
    EXPECT_EQ(problem(arm(good)), "no error") << good;
    EXPECT_THAT(RobotModel::from_urdf_text(arm(good), "a", "b").warnings(), ::testing::IsEmpty());
  }
  EXPECT_EQ(problem(arm(inertial("0", "-1e-35", "0", "0"))),
            "arm.urdf: joint 'j': no inertia resists it: the links it moves lack mass, and it has "
            "no reflected inertia");
  ModelOptions options;
  options.reflected_inertia = JointVector::Constant(1, 0.1);
  EXPECT_EQ(problem(arm(""), options), "no error") << "a rotor alone";
  options.include_off_chain = false;
  EXPECT_EQ(problem(robot(kTwoLinks + "<link name='c'>" + inertial("-1", "1", "1", "1") +
                          "</link>" + joint("j", "a", "b") + joint("k", "b", "c", "planar")),
                    options),
            "no error")
      << "links off the chain";
}

TEST(RobotModelErrors, NameWhatAcceptsAnImpossibleInertia) {
  const std::string broken = arm(inertial("2", "1", "1", "2.1"));
  EXPECT_THAT(problem(broken),
              EndsWith("2.1 kg m^2; robot.accept_inertias: true, or --accept-inertias, takes it as "
                       "it is; both take names of links as well"));
  ModelOptions options;
  options.accept_inertias = true;
  EXPECT_EQ(problem(broken, options), "no error");
  EXPECT_EQ(problem(arm(inertial("2", "-0.1", "1", "1")), options), "no error");
  EXPECT_THAT(problem(arm(inertial("-2", "1", "1", "1")), options), HasSubstr("mass is negative"));
  options.payload.inertia(0, 0) = -1;
  EXPECT_THAT(problem(arm(kGood), options), HasSubstr("payload: its inertia is not positive"));
}

TEST(RobotModelErrors, ListTheLinksWithTheNearestNamesFirst) {
  const std::string few = robot("<link name='a'/><link name='arm_link'/><link name='b'>" + kGood +
                                "</link>" + joint("j", "a", "b") + joint("k", "b", "arm_link"));
  EXPECT_EQ(problem(few, {}, "a", "arm_lnk"),
            "arm.urdf: link 'arm_lnk': there is none; its links are arm_link, a, b");
  testing::RandomRobot random(17);
  const std::string many = random.chain(12, 0);
  const std::string message = problem(many, {}, "link0", "lnk12");
  EXPECT_THAT(message, StartsWith("arm.urdf: link 'lnk12': there is none; the nearest of its "));
  EXPECT_THAT(message, HasSubstr(" links are link12, link"));
  EXPECT_EQ(std::count(message.begin(), message.end(), ','), 9) << "ten of them: " << message;
  const std::string endless(100000, 'x');
  EXPECT_THAT(problem(few, {}, "a", endless), HasSubstr("..."));
}

TEST(RobotModelErrors, SayThatAXacroHasToBeExpanded) {
  const std::string head = "<robot name='r' xmlns:xacro='http://www.ros.org/wiki/xacro'>";
  const std::string rest = kTwoLinks + joint("j", "a", "b") + "</robot>";
  const std::string how =
      "); expand it first: xacro arm.urdf > robot.urdf (xacro comes with ROS, or by pip install "
      "xacro)";
  const std::string start = "arm.urdf: is a xacro that is not expanded yet (";
  EXPECT_EQ(problem(head + "<xacro:include filename='b.xacro'/>" + rest),
            start + "<xacro:include>" + how);
  EXPECT_EQ(problem("<xacro:arm name='r'/>"), start + "<xacro:arm>" + how);
  EXPECT_EQ(problem(arm(inertial("${2 * m}", "1", "1", "1"))), start + "${2 * m}" + how);
  EXPECT_EQ(problem(head + "<!-- from <xacro:arm/> and ${m} -->" + rest), "no error") << "expanded";
  EXPECT_THAT(problem(head + "<!-- ${m}" + rest), Not(HasSubstr("xacro arm")));
}

TEST(RobotModelErrors, CountJoints) {
  testing::RandomRobot random(731);
  EXPECT_EQ(problem(random.chain(17, 0), {}, "link0", "tip"),
            "arm.urdf: link 'tip': 17 joints from 'link0', more than 16");
}

TEST(RobotModelErrors, SayHowManyJointsCanBeElastic) {
  std::string links = "<link name='l0'/>", joints;
  for (int i = 1; i <= 10; ++i) {
    const std::string before = "l" + std::to_string(i - 1), link = "l" + std::to_string(i);
    links += "<link name='" + link + "'>" + inertial("1", "1", "1", "1") + "</link>";
    joints += joint("j" + std::to_string(i), before, link);
  }
  ModelOptions options;
  options.reflected_inertia = JointVector::Ones(10);
  options.gear_stiffness = JointVector::Constant(10, 1e4);
  const auto problem = [&] {
    try {
      RobotModel::from_urdf_text(robot(links + joints), "l0", "l10", options, "arm.urdf");
    } catch (const InvalidModel& error) {
      return std::string(error.what());
    }
    return std::string("no error");
  };
  EXPECT_EQ(problem(),
            "arm.urdf: gear stiffness: 10 of 10 joints are elastic, at most 6 can be; "
            "set the others to none");
  options.gear_stiffness.tail(4).setConstant(std::numeric_limits<double>::infinity());
  EXPECT_EQ(problem(), "no error");
}

TEST(RobotModelErrors, NeedALinkBehindAnElasticGear) {
  ModelOptions options;
  options.reflected_inertia = JointVector::Constant(1, 0.1);
  options.gear_stiffness = JointVector::Constant(1, 1e4);
  EXPECT_THAT(problem(arm(""), options), EndsWith("no reflected inertia on this side of its gear"));
}

TEST(RobotModelErrors, NameTheOption) {
  using Options = ModelOptions;
  const std::pair<void (*)(Options&), const char*> cases[] = {
      {[](Options& o) { o.reflected_inertia = JointVector::Ones(2); },
       "reflected inertia: has 2 entries for 1 joints"},
      {[](Options& o) { o.reflected_inertia = -JointVector::Ones(1); },
       "joint 'j': reflected inertia is negative or not a finite number"},
      {[](Options& o) { o.viscous_friction = JointVector::Constant(1, kNaN); },
       "joint 'j': damping is negative or not a finite number"},
      {[](Options& o) { o.coulomb_friction = -JointVector::Ones(1); },
       "joint 'j': friction is negative or not a finite number"},
      {[](Options& o) { o.gear_stiffness = JointVector::Zero(1); },
       "joint 'j': gear stiffness is not a positive number, N m/rad"},
      {[](Options& o) { o.gear_damping = -JointVector::Ones(1); },
       "joint 'j': gear damping is negative or not a finite number"},
      {[](Options& o) { o.torque_loop_inertia_ratio = JointVector::Zero(1); },
       "joint 'j': torque loop inertia ratio is not in (0, 1]"},
      {[](Options& o) { o.gravity.x() = kNaN; }, "gravity: not finite"},
      {[](Options& o) { o.payload.mass = -1; }, "payload: its mass is negative, -1 kg"},
      {[](Options& o) { o.payload.inertia(0, 1) = 1; }, "payload: its inertia is not symmetric"},
      {[](Options& o) { o.payload.center.y() = kNaN; },
       "payload: its centre of mass is not finite"},
      {[](Options& o) { o.tool.rotation *= 2; }, "tool: "},
      {[](Options& o) { o.tool.rotation *= -1; }, "tool: "},
      {[](Options& o) { o.tool.position.x() = kNaN; }, "tool: "},
  };
  for (const auto& [set, start] : cases) {
    Options options;
    set(options);
    EXPECT_THAT(problem(arm(kGood), options), StartsWith(std::string("arm.urdf: ") + start));
  }
}

}  // namespace
}  // namespace dashpot::controller
