// URDFs in practice: newer versions, shapes, limits, inertias and doubtful units.
#include <dashpot/controller/controller.hpp>
#include <dashpot/controller/default_settings.hpp>
#include <dashpot/controller/drives.hpp>
#include <dashpot/controller/dynamics.hpp>
#include <dashpot/controller/robot_model.hpp>
#include <dashpot/controller/settings_check.hpp>
#include <dashpot/sim/robot.hpp>
#include <dashpot/tests/support/arms.hpp>
#include <dashpot/tests/support/dynamics_match.hpp>

#include <gmock/gmock.h>

#include <functional>
#include <limits>
#include <regex>
#include <string>
#include <utility>
#include <vector>

namespace dashpot::controller {
namespace {

using ::testing::AllOf;
using ::testing::Contains;
using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::IsEmpty;
using ::testing::Not;
using ::testing::SizeIs;
using ::testing::StartsWith;
using ::testing::ThrowsMessage;

/// The Panda's description with one piece of text in place of another.
std::string panda_with(const std::string& old, const std::string& next, bool all = false) {
  static const std::string original = read_urdf_file(testing::arm_path("panda"));
  std::string text = original;
  std::size_t at = text.find(old);
  EXPECT_NE(at, std::string::npos) << old;
  while (at != std::string::npos) {
    text.replace(at, old.size(), next);
    at = all ? text.find(old, at + next.size()) : std::string::npos;
  }
  return text;
}

RobotModel read_panda(const std::string& text, const ModelOptions& options = {}) {
  return RobotModel::from_urdf_text(text, "panda_link0", "panda_hand_tcp", options, "panda.urdf");
}

std::string refusal_of_panda(const std::string& text, const ModelOptions& options = {}) {
  try {
    read_panda(text, options);
  } catch (const InvalidModel& error) {
    return error.what();
  }
  return "read";
}

JointVector bent() {
  JointVector q(7);
  q << 0.1, -0.7, 0.2, -2.3, 0.3, 1.6, 0.8;
  return q;
}

/// Returns true if the models have the same M, weight and tip, except for rounding.
void expect_same(const RobotModel& model, const RobotModel& other) {
  const DynamicsResult a = evaluate(model, bent(), bent()), b = evaluate(other, bent(), bent());
  EXPECT_LT((a.M - b.M).cwiseAbs().maxCoeff(), 1e-13);
  EXPECT_LT((a.gravity - b.gravity).cwiseAbs().maxCoeff(), 1e-12);
  EXPECT_LT((a.p_BT_B - b.p_BT_B).cwiseAbs().maxCoeff(), 1e-14);
  EXPECT_LT((a.R_BT - b.R_BT).cwiseAbs().maxCoeff(), 1e-14);
}

const std::string kHead = "<robot name=\"panda\">", kTurn = "rpy=\"-1.5707963267948966 0 0\"",
                  kQuaternion = "quat_xyzw=\"-0.7071067811865475 0 0 0.7071067811865476\"",
                  kEnd = "</robot>",
                  kFrame =
                      "<joint name='camera' type='fixed'><parent link='panda_hand'/>"
                      "<child link='camera_frame'/></joint></robot>";

std::string in_version(const std::string& version, std::string text) {
  text.replace(text.find(kHead), kHead.size(),
               "<robot name=\"panda\" version=\"" + version + "\">");
  return text;
}

TEST(UrdfForms, AreReadInVersions11And12) {
  const RobotModel panda = testing::panda_model();
  EXPECT_THAT(panda.warnings(), IsEmpty());
  for (const std::string version : {"1.1", "1.2"}) {
    expect_same(read_panda(in_version(version, panda_with(kTurn, kTurn))), panda);
    const std::string turned = in_version(version, panda_with(kTurn, kQuaternion, true));
    expect_same(read_panda(turned), panda);
    EXPECT_EQ(sim::Robot::from_text(turned, "panda_link0", "panda_hand_tcp").dof(), 7);
  }
  EXPECT_THAT(refusal_of_panda(panda_with(kTurn, kQuaternion)),
              StartsWith("panda.urdf: joint 'panda_joint2': quat_xyzw: belongs to URDF 1.1"));
  EXPECT_THROW(sim::Robot::from_text(panda_with(kTurn, kQuaternion), "panda_link0", "panda_link7"),
               sim::InvalidRobot);
}

TEST(UrdfForms, MayHaveShapesThatNobodyKnows) {
  const std::string link = "<link name=\"panda_link3\">";
  for (const std::string shape :
       {"<collision><geometry><capsule radius='0.06' length='0.15'/></geometry></collision>",
        "<visual><geometry><mesh filename='x.dae' scale='1 1 1 1'/></geometry></visual>",
        "<visual><material name='none'/><origin xyz='a b'/></visual><collision/>"}) {
    expect_same(read_panda(panda_with(link, link + shape)), testing::panda_model());
  }
  const std::string paint = "<material name='m'><color rgba='red'/></material><transmission/>";
  expect_same(read_panda(panda_with(kHead, kHead + paint)), testing::panda_model());
}

TEST(UrdfForms, HaveLimitsOfAccelerationThatTheReferenceKeeps) {
  const std::string limit = "velocity=\"2.175\" effort=\"87\"";
  const Settings usual = default_settings(testing::panda_model());
  const auto settings = [&](const std::string& more, const std::string& version = "1.2") {
    return default_settings(read_panda(in_version(version, panda_with(limit, limit + " " + more))));
  };
  const RobotModel model = read_panda(in_version(
      "1.2", panda_with(limit, limit + " acceleration='15' deceleration='9' jerk='7500'")));
  EXPECT_EQ(model.joints()[0].acceleration, 15);
  EXPECT_EQ(model.joints()[0].deceleration, 9);
  EXPECT_EQ(model.joints()[0].jerk, 7500);
  EXPECT_EQ(model.joints()[1].jerk, std::numeric_limits<double>::infinity());
  EXPECT_EQ(default_settings(model).motion.acceleration, usual.motion.acceleration);
  EXPECT_EQ(settings("acceleration='0.5'").motion.acceleration[0], 0.5);
  EXPECT_EQ(settings("acceleration='0.5'").motion.acceleration[1], usual.motion.acceleration[1]);
  EXPECT_EQ(settings("deceleration='0.5'").motion.acceleration[0], 1.0) << "it brakes at half";
  EXPECT_EQ(settings("jerk='10'").motion.acceleration[0], 0.5 * 0.03 * 10);
  EXPECT_EQ(settings("acceleration='0.5'", "1.1").motion.acceleration, usual.motion.acceleration)
      << "older versions have none";
}

TEST(UrdfForms, StateNoLimitByZero) {
  const RobotModel model =
      read_panda(panda_with("velocity=\"2.175\" effort=\"87\"", "velocity=\"0\" effort=\"0\""));
  EXPECT_EQ(model.joints()[0].velocity, std::numeric_limits<double>::infinity());
  EXPECT_EQ(model.joints()[0].effort, std::numeric_limits<double>::infinity());
}

/// If no joint has a limit of effort, limits.torque has to be set before any torque is commanded.
TEST(UrdfForms, WantTorquesWhereNoneIsStated) {
  const RobotModel model =
      read_panda(std::regex_replace(read_urdf_file(testing::arm_path("panda")),
                                    std::regex("effort=\"[0-9.]*\""), "effort=\"0\""));
  EXPECT_THAT(model.warnings(), Contains(HasSubstr("a controller needs limits.torque")));
  Settings settings = default_settings(model);
  EXPECT_THAT([&] { (void)Controller(model, settings); },
              ThrowsMessage<InvalidSettings>(HasSubstr("limits.torque: missing: no joint of the")));
  settings.limits.torque.setConstant(7, 80);
  EXPECT_NO_THROW((void)Controller(model, settings));
  // If some joints state one, the others are named, and a zero torque does not count as missing.
  const RobotModel other = read_panda(panda_with("effort=\"87\"", "effort=\"0\""));
  EXPECT_THAT(other.warnings(), Contains(HasSubstr("no limit): panda_joint1: a controller")));
  settings.limits.torque.setZero();
  EXPECT_THAT([&] { (void)Controller(other, settings); },
              ThrowsMessage<InvalidSettings>(Not(HasSubstr("missing"))));
}

TEST(UrdfForms, MayHoldInertiasThatCannotMatter) {
  const std::string frame =
      "<link name='camera_frame'><inertial><mass value='MASS'/><inertia ixx='1e-8' ixy='1e-8' "
      "ixz='1e-8' iyy='1e-8' iyz='1e-8' izz='1e-8'/></inertial></link>";
  const auto with_mass = [&](const std::string& mass) {
    std::string link = frame;
    return panda_with(kEnd, link.replace(link.find("MASS"), 4, mass) + kFrame);
  };
  const RobotModel model = read_panda(with_mass("1e-8"));
  EXPECT_THAT(model.warnings(),
              ElementsAre(AllOf(StartsWith("link 'camera_frame': its inertia breaks the triangle "),
                                HasSubstr("cannot matter"))));
  EXPECT_THAT(read_panda(with_mass("0.004")).warnings(), SizeIs(1)) << "a fingertip";
  std::string large = with_mass("1e-8");
  large.replace(large.find("ixx='1e-8'"), 10, "ixx='1'");
  EXPECT_THAT(refusal_of_panda(large), StartsWith("panda.urdf: link 'camera_frame': its inertia"));
  EXPECT_THAT(refusal_of_panda(with_mass("-1e-8")), HasSubstr("its mass is negative"));
}

TEST(UrdfForms, MayHaveAnImpossibleBase) {
  const std::string base = "<link name=\"panda_link0\"/>";
  const RobotModel model = read_panda(panda_with(
      base,
      "<link name='panda_link0'><inertial><mass value='51'/><inertia ixx='16616' ixy='-2240' "
      "ixz='0' iyy='-2240' iyz='16616' izz='0'/></inertial></link>"));
  expect_same(model, testing::panda_model());
  EXPECT_THAT(model.warnings(),
              ElementsAre(AllOf(StartsWith("link 'panda_link0': its inertia is not positive"),
                                HasSubstr("stands still"))));
}

/// With moments of two links that break the triangle inequality by 10 and 50 %.
std::string two_faults() {
  const auto part = [](const std::string& link, const std::string& izz) {
    return "<link name='" + link + "'><inertial><mass value='1'/><inertia ixx='0.01' ixy='0' " +
           "ixz='0' iyy='0.01' iyz='0' izz='" + izz + "'/></inertial></link><joint name='to_" +
           link + "' type='fixed'><parent link='panda_hand'/><child link='" + link + "'/></joint>";
  };
  return panda_with(kEnd, part("camera", "0.022") + part("light", "0.03") + kEnd);
}

TEST(UrdfForms, NameAllFaultyLinksAtOnce) {
  EXPECT_EQ(refusal_of_panda(two_faults()),
            "panda.urdf: link 'light': its inertia breaks the triangle inequality by 50 %: "
            "principal moments 0.01, 0.01, 0.03 kg m^2; link 'camera': its inertia breaks the "
            "triangle inequality by 10 %: principal moments 0.01, 0.01, 0.022 kg m^2; "
            "robot.accept_inertias: true, or --accept-inertias, takes them as they are; both take "
            "names of links as well");
  ModelOptions options;
  options.accept_inertias_of = {"camera"};
  EXPECT_THAT(refusal_of_panda(two_faults(), options),
              AllOf(StartsWith("panda.urdf: link 'light': "), Not(HasSubstr("'camera'"))));
  options.accept_inertias_of = {"light", "camera"};
  EXPECT_EQ(refusal_of_panda(two_faults(), options), "read");
  options.accept_inertias_of = {"light", "camra"};
  EXPECT_THAT(refusal_of_panda(two_faults(), options),
              StartsWith("panda.urdf: link 'camra': there is none whose inertia to accept; the "
                         "nearest of its "));
}

TEST(UrdfForms, AreDoubtedWhereUnitsCannotBeRight) {
  const std::string mass = "<mass value=\"3.587895\"/>";  // of link 4
  const auto warnings = [&](const std::string& old, const std::string& next) {
    return read_panda(panda_with(old, next)).warnings();
  };
  const auto of_link_4 = [](const std::string& what) {
    return AllOf(StartsWith("link 'panda_link4': "), HasSubstr(what));
  };
  EXPECT_THAT(warnings(mass, "<mass value='3587.895'/>"),
              ElementsAre(of_link_4("3588 kg, is 2153 times the mass of an ordinary link"),
                          of_link_4("are masses in g")));
  EXPECT_THAT(warnings(mass, "<mass value='4e-4'/>"),
              ElementsAre(of_link_4("is it in kg?"), of_link_4("fits a body larger than the arm")));
  EXPECT_THAT(warnings(mass, "<mass value='1.2'/>"), IsEmpty());
  EXPECT_THAT(warnings("effort=\"87\"", "effort=\"5\""), SizeIs(0)) << "joint 1 holds no weight";
  EXPECT_THAT(
      read_panda(panda_with("\"/>\n      <inertia", "e3\"/>\n      <inertia", true)).warnings(),
      ElementsAre(of_link_4("take 5.3")))
      << "all of them in grams";
  EXPECT_THAT(warnings("lower=\"-2.8973\" upper=\"2.8973\" velocity=\"2.175\"",
                       "lower=\"-166\" upper=\"166\" velocity=\"150\""),
              ::testing::Contains(HasSubstr("is many turns: is it in deg?")));
  EXPECT_THAT(warnings("velocity=\"2.175\" effort=\"87\"", "velocity=\"20.8\" effort=\"87000\""),
              ElementsAre(HasSubstr("is it in deg/s or rpm?"), HasSubstr("is it in N m?")));
  EXPECT_THAT(
      warnings("0.333\" rpy=\"0 0 0\"", "0.333\" rpy=\"0 -90 0\""),
      ElementsAre(HasSubstr("joint1': its origin's rpy is 0 -90 0 rad, beyond a turn: is")));
  EXPECT_THAT(warnings("0.333\" rpy=\"0 0 0\"", "0.333\" rpy=\"0 0 6.28319\""), IsEmpty());
}

TEST(UrdfForms, AreDoubtedWhereWhatIsToldBesideCannotBeRight) {
  const auto warnings = [](const auto& change) {
    ModelOptions options;
    change(options);
    return read_panda(read_urdf_file(testing::arm_path("panda")), options).warnings();
  };
  using O = ModelOptions;
  for (const auto& [said, change] : std::vector<std::pair<const char*, std::function<void(O&)>>>{
           {"tool: its frame is off the tip link by 100 m",
            [](O& o) {
              o.tool.position = {0, 0, 100};
            }},
           {"is payload.center in m?",
            [](O& o) {
              o.payload.mass = 1;
              o.payload.center = {0, 0, 50};
            }},
           {"payload: its mass and inertia fit a body of 122.5 m",
            [](O& o) {
              o.payload.mass = 1;
              o.payload.inertia = 1e4 * Eigen::Matrix3d::Identity();
            }},
           {"joint 'panda_joint1': its reflected inertia, 3000 kg m^2, is hardly possible for",
            [](O& o) { o.reflected_inertia.setConstant(7, 3000); }}}) {
    EXPECT_THAT(warnings(change), ::testing::Contains(HasSubstr(said)));
  }
  EXPECT_THAT(warnings([](O& o) { o.reflected_inertia.setConstant(7, 1e-5); }),
              ::testing::Contains(HasSubstr("multiplied by the square of the gear ratio?")));
  EXPECT_THAT(warnings([](O& o) {
                o.gravity = {0, 0, -1};
              }),
              ElementsAre("gravity: 1 m/s^2 fits no planet: is it in m/s^2?"));
  EXPECT_THAT(warnings([](O& o) {
                o.tool.position = {0, 0, 0.3};
                o.payload = {3, {0, 0, 0.1}, 0.01 * Eigen::Matrix3d::Identity()};
                o.reflected_inertia.setConstant(7, 0.6);
              }),
              IsEmpty());
}

TEST(UrdfForms, MayLackLimitsOffTheChain) {
  const std::string wheel =
      "<link name='wheel'/><joint name='drive' type='continuous'><parent link='panda_link0'/>"
      "<child link='wheel'/><limit velocity='6'/></joint></robot>";
  expect_same(read_panda(panda_with(kEnd, wheel)), testing::panda_model());
  EXPECT_EQ(refusal_of_panda(panda_with(" effort=\"87\"", "")),
            "panda.urdf: joint 'panda_joint1': its limit has no effort");
}

TEST(UrdfForms, SayWhichLimitsDoNotCount) {
  const std::string joint = "<joint name=\"panda_joint1\" type=\"";
  EXPECT_THAT(read_panda(panda_with(joint + "revolute", joint + "continuous")).warnings(),
              ElementsAre(AllOf(StartsWith("joint 'panda_joint1': it is continuous"),
                                HasSubstr("-2.8973 to 2.8973 rad do not count"))));
}

TEST(UrdfForms, OfSimModelsAreNotDoubtedNorTheirPublishedDrives) {
  for (const testing::Arm& arm : testing::all_arms()) {
    const RobotModel model = testing::arm_model(arm);
    EXPECT_THAT(model.warnings(), IsEmpty()) << arm.file;
    ModelOptions options;
    if (const Drives* drives = drives_like(model)) options.drives = drives->name;
    EXPECT_THAT(RobotModel::from_urdf_file(testing::arm_path(arm.file), arm.base, arm.tip, options)
                    .warnings(),
                IsEmpty())
        << options.drives;
  }
}

}  // namespace
}  // namespace dashpot::controller
