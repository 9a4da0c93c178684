// The controller gets the values of the configuration file.
#include <dashpot/controller/base/settings_table.hpp>
#include <dashpot/controller/default_settings.hpp>
#include <dashpot/controller/dynamics.hpp>
#include <dashpot/controller/settings_check.hpp>
#include <dashpot/tests/plugin/config_file.hpp>
#include <dashpot/tests/support/places.hpp>
#include <dashpot/tests/support/special_values.hpp>

#include <gmock/gmock.h>

#include <Eigen/Geometry>
#include <limits>
#include <numbers>
#include <sstream>
#include <type_traits>
#include <vector>

namespace dashpot::tests {
namespace {

using controller::Config;
using controller::Frame;
using controller::JointVector;
using controller::Mode;
using controller::Settings;
using Eigen::Matrix3d;
using Eigen::MatrixXd;
using Eigen::Vector3d;
using Eigen::VectorXd;
using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::IsEmpty;
using testing::kInfinity;

constexpr double kDegree = std::numbers::pi / 180;

const std::string kExample = std::string(DASHPOT_SOURCE_DIR) + "/controller/examples/panda.yaml";

std::string text_of(const std::string& path) {
  std::ifstream stream(path);
  return {std::istreambuf_iterator<char>(stream), {}};
}

/// M(q) of the configured robot.
MatrixXd mass_matrix(const Config& config, double q = 0.3) {
  const JointVector position = JointVector::Constant(config.model.dof(), q);
  const JointVector velocity = JointVector::Zero(config.model.dof());
  return controller::evaluate(config.model, position, velocity).M;
}

/// Every setting of the table as text.
std::vector<std::pair<std::string, std::string>> texts_of(const Settings& settings) {
  std::vector<std::pair<std::string, std::string>> texts;
  controller::for_each_setting(settings,
                               [&](const controller::Setting& setting, const auto& value) {
                                 std::ostringstream text;
                                 text.precision(17);
                                 if constexpr (std::is_enum_v<std::decay_t<decltype(value)>>) {
                                   text << static_cast<int>(value);
                                 } else {
                                   text << value;
                                 }
                                 texts.emplace_back(setting.key, text.str());
                               });
  return texts;
}

/// Keys of the table under which two settings differ.
std::vector<std::string> differences(const Settings& a, const Settings& b) {
  std::vector<std::string> keys;
  const auto texts = texts_of(a), others = texts_of(b);
  for (std::size_t i = 0; i < texts.size(); ++i) {
    if (texts[i] != others[i]) keys.push_back(texts[i].first);
  }
  return keys;
}

void expect_same(const Settings& a, const Settings& b) {
  EXPECT_THAT(differences(a, b), IsEmpty());
  EXPECT_EQ(a.initial.gains.joint_stiffness, b.initial.gains.joint_stiffness);
  EXPECT_EQ(a.initial.gains.joint_damping, b.initial.gains.joint_damping);
  EXPECT_EQ(a.initial.gains.task_stiffness, b.initial.gains.task_stiffness);
  EXPECT_EQ(a.initial.gains.task_damping, b.initial.gains.task_damping);
  EXPECT_EQ(a.initial.gains.directions, b.initial.gains.directions);
  EXPECT_EQ(a.initial.gains.joint_damping_ratio, b.initial.gains.joint_damping_ratio);
  EXPECT_EQ(a.initial.gains.task_damping_ratio, b.initial.gains.task_damping_ratio);
  EXPECT_EQ(a.initial.gains.null_damping_ratio, b.initial.gains.null_damping_ratio);
}

TEST(Config, NeedsARobotOnly) {
  const Config config = load(panda());
  EXPECT_EQ(config.model.dof(), 7);
  EXPECT_EQ(config.model.tip(), "panda_hand_tcp");
  expect_same(config.settings, controller::default_settings(config.model));
}

TEST(Config, TakesGroupsThatAreEmpty) {
  const Config config = load(panda() +
                             "control: {}\ngains: {joint: {}, task: {}, null_space: {}}\n"
                             "limits: {}\nmotion: {}\nfeed_forward: {}\nwatchdog: {}\n"
                             "analysis: {}\n");
  expect_same(config.settings, controller::default_settings(config.model));
}

TEST(Config, FindsTheUrdfBesideTheFile) {
  const Scratch scratch;
  std::filesystem::copy_file(urdf_path("ur5.urdf"), scratch.path("my.urdf"));
  const std::string file =
      scratch.write("arm.yaml", "robot: {urdf: my.urdf, base: base_link, tip: ee_link}\n");
  EXPECT_EQ(controller::load_config(file).model.dof(), 6);
}

TEST(Config, MayBeJson) {
  const Config config = load(R"({"robot": {"urdf": ")" + urdf_path("panda.urdf") +
                             R"(", "base": "panda_link0", "tip": "panda_link8"},
                               "control": {"period": "2 ms", "mode": "cartesian"}})");
  EXPECT_EQ(config.settings.period, 0.002);
  EXPECT_EQ(config.settings.initial.mode, Mode::kCartesian);
}

TEST(Config, TakesTheRateForThePeriod) {
  EXPECT_EQ(load(panda() + "control: {rate: 1 kHz}\n").settings.period, 0.001);
  EXPECT_EQ(load(panda() + "control: {rate: 500}\n").settings.period, 0.002);
  EXPECT_EQ(load(panda() + "control: {period: 4 ms}\n").settings.period, 0.004);
}

TEST(Config, FitsDefaultsToThePeriod) {
  for (const char* period : {"1 us", "20 us", "0.1 ms", "0.5 ms", "1 ms", "20 ms", "0.1 s"}) {
    SCOPED_TRACE(period);
    const Settings settings = load(panda() + "control: {period: " + period + "}\n").settings;
    EXPECT_EQ(settings.motion.smoothing, std::min(0.03, 256 * settings.period));
    EXPECT_EQ(settings.watchdog.longest_gap, std::max(0.01, 2.5 * settings.period));
  }
}

TEST(Config, TakesAnInertiaThatNoBodyHasIfToldTo) {
  const Scratch scratch;
  std::string urdf = text_of(urdf_path("ur5.urdf"));
  const std::size_t at = urdf.find("izz=\"", urdf.find("upper_arm_link")) + 5;
  urdf.insert(at, "9");
  const std::string path = scratch.write("broken.urdf", urdf);
  const std::string robot = "robot: {urdf: " + path + ", base: base_link, tip: ee_link";
  EXPECT_THAT(complaint(robot + "}\n"), ::testing::HasSubstr("robot.accept_inertias: true"));
  EXPECT_EQ(load(robot + ", accept_inertias: true}\n").model.dof(), 6);
  EXPECT_EQ(load(robot + ", accept_inertias: [upper_arm_link]}\n").model.dof(), 6);
  EXPECT_THAT(complaint(robot + ", accept_inertias: [forearm_link]}\n"),
              ::testing::HasSubstr("link 'upper_arm_link': "));
  EXPECT_THAT(complaint(robot + ", accept_inertias: [[upper_arm_link]]}\n"),
              ::testing::HasSubstr("true, false or names of links are wanted"));
  EXPECT_THAT(complaint(robot + ", accept_inertias: [arm]}\n"),
              ::testing::HasSubstr("link 'arm': there is none whose inertia to accept"));
}

TEST(Config, FillsJointMatrices) {
  const Settings one =
      load(panda() + "gains: {joint: {stiffness: 600, damping: 20 Nms/rad}}\n").settings;
  EXPECT_EQ(one.initial.gains.joint_stiffness, 600 * MatrixXd::Identity(7, 7));
  EXPECT_EQ(one.initial.gains.joint_damping, 20 * MatrixXd::Identity(7, 7));
  const Settings list = load(panda() +
                             "gains:\n  joint:\n    stiffness: [1, 2, 3 Nm/rad, 4, 5, 6, 7]\n"
                             "    damping: 1\n")
                            .settings;
  const VectorXd diagonal = VectorXd::LinSpaced(7, 1, 7);
  EXPECT_EQ(list.initial.gains.joint_stiffness, MatrixXd(diagonal.asDiagonal()));
  const Settings full = load(panda() +
                             "gains:\n  joint:\n    damping: 0\n    stiffness:\n"
                             "    - [9, 1, 0, 0, 0, 0, 0]\n    - [1, 8, 0, 0, 0, 0, 0]\n"
                             "    - [0, 0, 7, 0, 0, 0, 0]\n    - [0, 0, 0, 6, 0, 0, 0]\n"
                             "    - [0, 0, 0, 0, 5, 0, 0]\n    - [0, 0, 0, 0, 0, 4, 0]\n"
                             "    - [0, 0, 0, 0, 0, 0, 3]\n")
                            .settings;
  MatrixXd expected = VectorXd::LinSpaced(7, 9, 3).asDiagonal();
  expected(0, 1) = expected(1, 0) = 1;
  EXPECT_EQ(full.initial.gains.joint_stiffness, expected);
}

TEST(Config, TakesADampingRatioInPlaceOfADamping) {
  const auto gains = [](const std::string& group, const std::string& keys) {
    return load(panda() + "gains: {" + group + ": {" + keys + "}}\n").settings.initial.gains;
  };
  const std::string task_springs = "stiffness: [9, 8, 7, 6, 5, 4], ";
  struct Group {
    const char* name;
    double controller::Gains::*ratio;
    std::string springs, dampers;
  };
  for (const auto& [name, ratio, springs, dampers] : std::vector<Group>{
           {"joint", &controller::Gains::joint_damping_ratio, "stiffness: 300, ", "damping: 9"},
           {"null_space", &controller::Gains::null_damping_ratio, "stiffness: 3, ", "damping: 1"},
           {"task", &controller::Gains::task_damping_ratio, task_springs,
            "damping: [1, 1, 1, 1, 1, 1]"}}) {
    SCOPED_TRACE(name);
    EXPECT_EQ(gains(name, "").*ratio, 0.7);
    EXPECT_EQ(gains(name, springs + dampers).*ratio, 0);
    const controller::Gains both = gains(name, springs + "damping_ratio: 0.8");
    EXPECT_DOUBLE_EQ(both.joint_damping_ratio + both.null_damping_ratio + both.task_damping_ratio,
                     0.7 + 0.7 + 0.8);
    EXPECT_EQ(both.*ratio, 0.8);
    EXPECT_EQ(gains(name, "damping_ratio: 2").*ratio, 2);
  }
  EXPECT_EQ(gains("null_space", "stiffness: 3, damping_ratio: 0.8").null_stiffness,
            VectorXd::Constant(7, 3));
  EXPECT_EQ(gains("task", task_springs + "damping_ratio: 2").task_stiffness(0, 0), 9);
  // Without springs nothing can be designed.
  EXPECT_GT(gains("joint", "stiffness: 0, damping_ratio: 0.8").joint_damping.diagonal().minCoeff(),
            0);
}

TEST(Config, NotesGainsThatDoNothing) {
  const std::string task = "gains: {task: {damping_ratio: 0.8}}\n";
  const std::string joint = "gains: {joint: {damping_ratio: 0.8}}\n";
  const std::string cartesian = "control: {mode: cartesian}\n";
  EXPECT_THAT(load(panda() + task).notes,
              ElementsAre(HasSubstr("gains.task (line 2) does nothing in control.mode: joint")));
  EXPECT_THAT(load(panda() + cartesian + joint).notes,
              ElementsAre(HasSubstr("gains.joint (line 3) does nothing in control.mode: cart")));
  for (const std::string& right : {joint, cartesian + task, cartesian}) {
    EXPECT_THAT(load(panda() + right).notes, IsEmpty());
  }
}

TEST(Config, FillsTheTask) {
  const auto gains =
      load(panda() +
           "gains:\n  task:\n    stiffness: [2000, 600, 2 kN/m, 100, 1 Nm/deg, 100]\n"
           "    damping:\n    - [9, 1, 0, 0, 0, 0]\n    - [1, 8, 0, 0, 0, 0]\n"
           "    - [0, 0, 7, 0, 0, 0]\n    - [0, 0, 0, 6, 0, 2]\n"
           "    - [0, 0, 0, 0, 5, 0]\n    - [0, 0, 0, 2, 0, 4]\n"
           "    frame: tool\n    directions: [z, rx]\n")
          .settings.initial.gains;
  VectorXd stiffness(6);
  stiffness << 2000, 600, 2000, 100, 1 / kDegree, 100;
  EXPECT_TRUE(gains.task_stiffness.isApprox(MatrixXd(stiffness.asDiagonal()), 1e-15));
  EXPECT_EQ(gains.task_damping(0, 1), 1);
  EXPECT_EQ(gains.task_damping(5, 3), 2);
  EXPECT_EQ(gains.frame, Frame::kTool);
  EXPECT_THAT(gains.directions, ::testing::ElementsAre(false, false, true, true, false, false));
}

TEST(Config, FillsLimits) {
  const auto limits = load(panda() +
                           "limits:\n  position_lower: [-90 deg, none, -1, -2, -1, 0, none]\n"
                           "  position_upper: none\n  torque: 10\n"
                           "  torque_rate: [1, 2, 3, 4, 5, 6, 7]\n  velocity: 30 rpm\n"
                           "  beyond_model: true\n")
                          .settings.limits;
  EXPECT_DOUBLE_EQ(limits.position_lower[0], -90 * kDegree);
  EXPECT_EQ(limits.position_lower[1], -kInfinity);
  EXPECT_EQ(limits.position_lower[6], -kInfinity);
  EXPECT_EQ(limits.position_upper, VectorXd::Constant(7, kInfinity));
  EXPECT_EQ(limits.torque, VectorXd::Constant(7, 10));
  EXPECT_EQ(limits.torque_rate, VectorXd::LinSpaced(7, 1, 7));
  EXPECT_TRUE(limits.velocity.isApprox(VectorXd::Constant(7, std::numbers::pi), 1e-15));
}

TEST(Config, FillsTheRest) {
  const Settings all =
      load(panda() +
           "control: {load: tool_wrench, null_projector: weighted, null_weights: 2,\n"
           "  jacobian_rate: true, subtract_friction: true}\n"
           "environment: {tip_stiffness: [1, 2, 3, 4, 5, 6], tip_damping: [1 N s/mm, 0, 0, 0, 0, "
           "7],\n"
           "  joint_stiffness: 8, joint_damping: [1, 2, 3, 4, 5, 6, 7]}\n"
           "motion: {velocity: 1, acceleration: 180 deg/s^2, linear_velocity: 100 mm/s,\n"
           "  linear_acceleration: 1, angular_velocity: 2, angular_acceleration: 3, smoothing: 20 "
           "ms,\n"
           "  gain_time: 1}\n"
           "limits: {stopping_time: 30 ms, tip_velocity: 2, power: 80 W,\n"
           "  external_torque: 9, external_force: 40, gain_margin: 3,\n"
           "  walls: [{point: [0, 0, 10 cm], normal: [0, 0, 2]}]}\n"
           "gains: {null_space: {stiffness: 4, damping: [1, 2, 3, 4, 5, 6, 7]}}\n"
           "feed_forward: {gravity: false, coriolis: false, friction: true, acceleration: false,\n"
           "  wrench: false, friction_at: measured, friction_share: 0.5, friction_rise: 3 deg/s}\n"
           "integral: {time: 800 ms, force: 5, moment: 0.5 N m, torque: [1, 2, 3, 4, 5, 6, 7]}\n"
           "watchdog: {setpoint_hold: 100 ms, setpoint_damp: 0, longest_gap: 5 ms, feedback: 1,\n"
           "  release_after: 3}\n"
           "analysis: {where: 'off', every: 7, share: 0.3, soft_frequency: 0.2 rad/s,\n"
           "  shapes: false,\n"
           "  sampled: {interval: 500 ms, delay: 2, cutoff: 30 Hz, difference_velocity: true}}\n")
          .settings;
  EXPECT_EQ(all.task_terms.load, controller::Load::kToolWrench);
  EXPECT_EQ(all.environment.tip_stiffness, VectorXd::LinSpaced(6, 1, 6));
  EXPECT_EQ(all.environment.tip_damping, (controller::Vector6{1000, 0, 0, 0, 0, 7}));
  EXPECT_EQ(all.environment.joint_stiffness, VectorXd::Constant(7, 8));
  EXPECT_EQ(all.environment.joint_damping, VectorXd::LinSpaced(7, 1, 7));
  EXPECT_TRUE(all.task_terms.jacobian_rate);
  EXPECT_EQ(all.initial.gains.null_projector, controller::NullProjector::kWeighted);
  EXPECT_EQ(all.null_weights, VectorXd::Constant(7, 2));
  EXPECT_TRUE(all.subtract_friction);
  EXPECT_EQ(all.motion.velocity, VectorXd::Ones(7));
  EXPECT_EQ(all.motion.acceleration, VectorXd::Constant(7, std::numbers::pi));
  EXPECT_DOUBLE_EQ(all.motion.linear_velocity, 0.1);
  EXPECT_EQ(all.motion.linear_acceleration, 1);
  EXPECT_EQ(all.motion.angular_velocity, 2);
  EXPECT_EQ(all.motion.angular_acceleration, 3);
  EXPECT_EQ(all.motion.smoothing, 0.02);
  EXPECT_EQ(all.motion.gain_time, 1);
  EXPECT_DOUBLE_EQ(all.limits.stopping_time, 0.03);
  EXPECT_EQ(all.limits.tip_velocity, 2);
  EXPECT_EQ(all.limits.power, 80);
  EXPECT_EQ(all.limits.external_torque, VectorXd::Constant(7, 9));
  EXPECT_EQ(all.limits.external_force, 40);
  EXPECT_EQ(all.limits.gain_margin, 3);
  ASSERT_EQ(all.limits.walls.size(), 1u);
  EXPECT_DOUBLE_EQ(all.limits.walls[0].distance(Eigen::Vector3d(5, 6, 0.3)), 0.2);
  EXPECT_EQ(all.initial.gains.null_stiffness, VectorXd::Constant(7, 4));
  EXPECT_EQ(all.initial.gains.null_damping, VectorXd::LinSpaced(7, 1, 7));
  EXPECT_FALSE(all.feed_forward.gravity || all.feed_forward.coriolis ||
               all.feed_forward.acceleration || all.feed_forward.wrench);
  EXPECT_TRUE(all.feed_forward.friction);
  EXPECT_EQ(all.feed_forward.friction_at, controller::FeedForward::FrictionAt::kMeasured);
  EXPECT_EQ(all.feed_forward.friction_share, 0.5);
  EXPECT_DOUBLE_EQ(all.feed_forward.friction_rise, 3 * kDegree);
  EXPECT_DOUBLE_EQ(all.integral.time, 0.8);
  EXPECT_EQ(all.integral.force, 5);
  EXPECT_EQ(all.integral.moment, 0.5);
  EXPECT_EQ(all.integral.torque, VectorXd::LinSpaced(7, 1, 7));
  EXPECT_DOUBLE_EQ(all.watchdog.setpoint_hold, 0.1);
  EXPECT_EQ(all.watchdog.setpoint_damp, 0);
  EXPECT_EQ(all.watchdog.longest_gap, 0.005);
  EXPECT_EQ(all.watchdog.feedback, 1);
  EXPECT_EQ(all.watchdog.release_after, 3);
  EXPECT_EQ(all.analysis.where, controller::Analysis::Where::kOff);
  EXPECT_EQ(all.analysis.every, 7);
  EXPECT_EQ(all.analysis.share, 0.3);
  EXPECT_EQ(all.analysis.soft_frequency, 0.2);
  EXPECT_FALSE(all.analysis.shapes);
  EXPECT_DOUBLE_EQ(all.analysis.sampled.interval, 0.5);
  EXPECT_EQ(all.analysis.sampled.delay, 2);
  EXPECT_EQ(all.analysis.sampled.cutoff, 30);
  EXPECT_TRUE(all.analysis.sampled.difference_velocity);
}

TEST(Config, TakesNoneForALimitThatMayBeLeftOut) {
  const controller::Limits limits =
      load(panda() + "limits: {power: none, external_force: none, external_torque: none}\n")
          .settings.limits;
  EXPECT_EQ(limits.power, kInfinity);
  EXPECT_EQ(limits.external_force, kInfinity);
  EXPECT_EQ(limits.external_torque, VectorXd::Constant(7, kInfinity));
  EXPECT_EQ(complaint(panda() + "limits: {tip_velocity: none}\n"),
            "limits.tip_velocity: is not a number but 'none' (line 2)");
}

/// The Panda's first line, with more keys.
std::string panda_with(const std::string& keys) {
  std::string text = panda();
  return text.insert(text.size() - 2, ", " + keys);
}

TEST(Config, GivesTheRobotReflectedInertiaAndFriction) {
  const Config plain = load(panda());
  const Config heavy =
      load(panda_with("reflected_inertia: [1, 2, 3, 4, 5, 6, 7 kg m^2], viscous_friction: 0.5, "
                      "coulomb_friction: 2 Nm"));
  const MatrixXd difference = mass_matrix(heavy) - mass_matrix(plain);
  EXPECT_TRUE(difference.isApprox(MatrixXd(VectorXd::LinSpaced(7, 1, 7).asDiagonal()), 1e-13));
  EXPECT_EQ(heavy.model.joints()[3].viscous_friction, 0.5);
  EXPECT_EQ(heavy.model.joints()[3].coulomb_friction, 2);
  EXPECT_EQ(load(panda_with("reflected_inertia: 0.1")).model.joints()[6].reflected_inertia, 0.1);
}

TEST(Config, GivesTheRobotGearsThatBend) {
  EXPECT_EQ(load(panda()).model.elastic_joints(), 0);
  const Config config = load(
      panda_with("reflected_inertia: 0.4, torque_loop_inertia_ratio: [1, 1, 1, 1, 1, 0.5, 0.25], "
                 "gear_stiffness: [1e4, 1e4, 1e4, 1e4, none, 5e3, 5e3 N m/rad], gear_damping: 3, "
                 "position_sensor: link"));
  EXPECT_EQ(config.model.elastic_joints(), 6);
  EXPECT_EQ(config.model.position_sensor(), controller::PositionSensor::kLink);
  const auto& joints = config.model.joints();
  EXPECT_EQ(joints[0].gear_stiffness, 1e4);
  EXPECT_FALSE(joints[4].elastic());
  EXPECT_EQ(joints[6].gear_stiffness, 5e3);
  EXPECT_EQ(joints[6].gear_damping, 3);
  EXPECT_EQ(joints[0].reflected_inertia, 0.4);
  EXPECT_EQ(joints[6].reflected_inertia, 0.1);
  const auto model = config.robot.model();  // once more, from what it was read from
  EXPECT_EQ(model.joints()[6].reflected_inertia, 0.1);
  EXPECT_EQ(load(panda_with("drives: panda, torque_loop_inertia_ratio: 0.5"))
                .model.joints()[2]
                .reflected_inertia,
            0.05);
}

TEST(Config, GivesTheRobotAPayloadAToolAndGravity) {
  const Config plain = load(panda());
  const Config loaded = load(panda_with(
      "payload: {mass: 500 g, center: [0, 0, 5 cm], inertia: 0.01}, gravity: [0, 9.81, 0],"
      "tool: {position: [0.1, 0, 0], rpy: [90 deg, 0, 90 deg]}"));
  const JointVector q = JointVector::Constant(7, 0.3);
  const JointVector rest = JointVector::Zero(7);
  const auto before = controller::evaluate(plain.model, q, rest);
  const auto after = controller::evaluate(loaded.model, q, rest);
  EXPECT_TRUE(loaded.model.gravity().isApprox(Vector3d(0, 9.81, 0)));
  // Kinetic energy of the payload: its centre moves as the tip's link does, at 5 cm from the tip.
  const Vector3d offset = before.R_BT * Vector3d(0, 0, 0.05);
  MatrixXd J = before.J.topRows(3);
  for (int i = 0; i < 7; ++i) J.col(i) += Vector3d(before.J.col(i).tail(3)).cross(offset);
  const MatrixXd W = before.J.bottomRows(3);
  const MatrixXd expected = 0.5 * J.transpose() * J + 0.01 * W.transpose() * W;
  EXPECT_TRUE((after.M - before.M).isApprox(expected, 1e-12));
  // rpy turns about fixed axes, x first: the tool's x, y, z axes are the tip's y, z, x.
  Matrix3d turn;
  turn << 0, 0, 1, 1, 0, 0, 0, 1, 0;
  EXPECT_TRUE(after.R_BT.isApprox(before.R_BT * turn, 1e-14));
  EXPECT_TRUE(after.p_BT_B.isApprox(before.p_BT_B + before.R_BT * Vector3d(0.1, 0, 0), 1e-14));
}

TEST(Config, MayDropWhatHangsOffTheChain) {
  const std::string robot =
      "robot: {urdf: " + urdf_path("panda.urdf") + ", base: panda_link0, tip: panda_link8";
  const MatrixXd with = mass_matrix(load(robot + "}\n"));
  const MatrixXd without = mass_matrix(load(robot + ", include_off_chain: false}\n"));
  EXPECT_GT((with - without).norm(), 1e-2);
}

TEST(Config, KnowsPrismaticJoints) {
  const std::string urdf = R"(<robot name="slide"><link name="rail"/>
    <link name="cart"><inertial><mass value="2"/>
      <inertia ixx="1" ixy="0" ixz="0" iyy="1" iyz="0" izz="1"/></inertial></link>
    <joint name="slider" type="prismatic"><parent link="rail"/><child link="cart"/>
      <limit lower="-1" upper="1" velocity="2" effort="50"/></joint></robot>)";
  const Scratch scratch;
  scratch.write("slide.urdf", urdf);
  const std::string head = "robot: {urdf: slide.urdf, base: rail, tip: cart}\n";
  const Config config = controller::load_config(
      scratch.write("arm.yaml", head + "gains: {joint: {stiffness: 500 N/m, damping: 3 N s/m}}\n"
                                       "limits: {torque: 40 N, position_upper: 50 cm}\n"));
  const Settings& settings = config.settings;
  EXPECT_EQ(settings.initial.gains.joint_stiffness(0, 0), 500);
  EXPECT_EQ(settings.limits.torque[0], 40);
  EXPECT_EQ(settings.limits.position_upper[0], 0.5);
  controller::Gains doubtful = settings.initial.gains;
  doubtful.joint_stiffness.setConstant(1, 1, 50);
  doubtful.joint_damping.setConstant(1, 1, 0.7);
  EXPECT_THAT(controller::doubtful_gains(config.model, doubtful),
              ::testing::ElementsAre(
                  ::testing::HasSubstr("beside a stiffness of 50 N/m: is it a damping ratio")));
  const std::string wrong = scratch.write("wrong.yaml", head + "limits: {torque: 40 Nm}\n");
  EXPECT_EQ(load_refusal(wrong),
            wrong + ": limits.torque: has a wrong unit: '40 Nm'; N is wanted (line 2)");
}

TEST(ConfigExample, Loads) {
  const Config config = controller::load_config(kExample);
  const Settings& settings = config.settings;
  EXPECT_EQ(config.model.dof(), 7);
  EXPECT_EQ(settings.initial.mode, Mode::kCartesian);
  EXPECT_EQ(settings.initial.gains.task_stiffness.diagonal()[1], 600);
  EXPECT_EQ(settings.limits.torque, config.model.joint_values(&controller::Joint::effort));
  EXPECT_EQ(settings.limits.velocity, config.model.joint_values(&controller::Joint::velocity));
}

/// Unless the example's comment gives another default, its value is the default.
TEST(ConfigExample, ShowsDefaults) {
  const Config config = controller::load_config(kExample);
  const Settings none = controller::default_settings(config.model);
  EXPECT_THAT(differences(config.settings, none),
              ElementsAre("control.mode", "limits.position_lower", "limits.position_upper",
                          "motion.velocity", "motion.acceleration"));
  EXPECT_EQ(config.settings.initial.gains.frame, none.initial.gains.frame);
  EXPECT_EQ(config.settings.initial.gains.directions, none.initial.gains.directions);
}

}  // namespace
}  // namespace dashpot::tests
