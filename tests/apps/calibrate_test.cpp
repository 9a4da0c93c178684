// `dashpot calibrate`: the arm that comes back, as a table, JSON, a configuration and drives.
#include <dashpot/tests/apps/scene_run.hpp>
#include <dashpot/tests/support/arms.hpp>
#include <dashpot/tests/support/torque_record.hpp>

namespace dashpot::tests {
namespace {

using ::testing::HasSubstr;

/// A Panda with rotors and friction, in a file beside its configuration.
class CalibrateProgram : public ::testing::Test {
 protected:
  CalibrateProgram() {
    testing::RecordedArm arm({testing::arm_path("panda"), "panda_link0", "panda_hand_tcp", {}});
    arm.center.resize(7);
    arm.center << 0.2, -0.4, 0.3, -1.9, 0.1, 1.7, 0.6;
    arm.coulomb << 0.8, 1.0, 0.6, 0.9, 0.4, 0.3, 0.2;
    arm.viscous << 0.5, 0.8, 0.3, 0.6, 0.2, 0.1, 0.05;
    arm.description.options.reflected_inertia = Eigen::VectorXd::Constant(7, 0.3);
    arm.description.options.reflected_inertia[6] = 0.008;
    arm.duration = 12;
    arm.rate = 100;
    arm.slowest = 0.25;
    const identification::TorqueRecord record = arm.record(31);
    std::string text = "time [s]";
    for (int j = 1; j <= 7; ++j) text += ",q" + std::to_string(j);
    for (int j = 1; j <= 7; ++j) text += ",tau" + std::to_string(j);
    for (Eigen::Index i = 0; i < record.time.size(); ++i) {
      text += "\n" + printed("%g", record.time[i]);
      for (const double value : record.position.col(i)) text += printed(",%.7f", value);
      for (const double value : record.torque.col(i)) text += printed(",%.7f", value);
    }
    file_ = scratch_.write("a.csv", text + "\n");
    config_ = scratch_.write("arm.yaml", "# mine\nrobot:\n  urdf: " + testing::arm_path("panda") +
                                             "\n  base: panda_link0\n  tip: panda_hand_tcp\n");
    gains_ =
        "control: {mode: joint}\ngains: {joint: {stiffness: [600, 600, 400, 300, 100, 60, 40], "
        "damping: [40, 40, 30, 20, 6, 4, 1.5]}}\n";
  }

  Scratch scratch_;
  std::string file_, config_, gains_;
};

TEST_F(CalibrateProgram, GivesTheArmBack) {
  const std::string written = scratch_.path("new.yaml"), drives = scratch_.path("drives.yaml");
  const Json found =
      parse(run_program({"calibrate", file_, "--config", config_, "--payload", "known", "--write",
                         written, "--write-drives", drives, "--json"}));
  for (std::size_t j = 0; j < 6; ++j) {
    const Json& joint = found["joints"][j];
    EXPECT_TRUE(joint["determined"]["reflected_inertia"].get<bool>()) << j;
    EXPECT_NEAR(joint["reflected_inertia"].get<double>(), 0.3, 0.03);
    EXPECT_GT(joint["explained"]["after"].get<double>(),
              joint["explained"]["before"].get<double>());
    EXPECT_TRUE(joint["wanted"].is_null()) << joint["wanted"];
  }
  EXPECT_FALSE(found["joints"][6]["determined"]["reflected_inertia"].get<bool>());
  EXPECT_THAT(found["joints"][6]["wanted"].dump(), HasSubstr("reflected inertia: accelerate"));
  EXPECT_THAT(found["notes"].dump(), HasSubstr("sensors behind the gears"));
  EXPECT_NEAR(found["delay"].get<double>(), 0, 1e-3);
  EXPECT_NEAR(found["validation"].get<double>(), 0.2 * found["seconds"].get<double>(), 1e-9);
  EXPECT_EQ(found["information"]["rank"], found["information"]["parameters"]);
  const std::string text = scratch_.read("new.yaml");
  EXPECT_THAT(text, HasSubstr("# dashpot calibrate, 20"));
  EXPECT_THAT(text, HasSubstr("from a.csv\n"));
  EXPECT_THAT(text, HasSubstr("# mine\n"));
  EXPECT_THAT(text, HasSubstr("reflected_inertia: [0."));
  EXPECT_EQ(run_program({"check-model", file_, "--config", written}).status, 0);

  const Json inspected =
      parse(run_program({"inspect", "--urdf", testing::arm_path("panda"), "--base", "panda_link0",
                         "--tip", "panda_hand_tcp", "--drives", drives, "--json"}));
  EXPECT_NEAR(inspected["drives"]["reflected_inertia"][0].get<double>(), 0.3, 0.03);
  EXPECT_EQ(inspected["drives"]["reflected_inertia"][6], 0);
  EXPECT_NEAR(inspected["drives"]["coulomb_friction"][1].get<double>(), 1, 0.1);
  EXPECT_THAT(inspected["drives"]["doubt"].dump(), HasSubstr("joints 7 are not determined"));
}

TEST_F(CalibrateProgram, WritesARotorThatIsNearerThanTheConfigurations) {
  const std::string config = scratch_.write(
      "known.yaml", "robot:\n  urdf: " + testing::arm_path("panda") +
                        "\n  base: panda_link0\n  tip: panda_hand_tcp\n  drives: panda\n");
  const std::string written = scratch_.path("new.yaml");
  const Json found = parse(run_program({"calibrate", file_, "--config", config, "--payload",
                                        "known", "--write", written, "--json"}));
  EXPECT_FALSE(found["joints"][6]["determined"]["reflected_inertia"].get<bool>());
  const std::string text = scratch_.read("new.yaml");
  const std::size_t list = text.find("  reflected_inertia: [");
  const std::string last = text.substr(0, text.find(']', list));
  EXPECT_NEAR(std::stod(last.substr(last.rfind(' '))), 0.008, 0.004) << text;
}

TEST_F(CalibrateProgram, PrintsWhatIsDeterminedAndModes) {
  const Outcome table = run_program({"calibrate", file_, "--config", config_, "--validate", "0.3"});
  EXPECT_EQ(table.status, 0) << table.err;
  EXPECT_THAT(table.out, HasSubstr("of them kept for validation"));
  EXPECT_THAT(table.out, HasSubstr("The records tell all 39 parameters apart"));
  EXPECT_THAT(table.out, HasSubstr("joint 7: reflected inertia"));
  EXPECT_THAT(table.out, HasSubstr("Delay: the torques act"));
  EXPECT_THAT(table.out, HasSubstr("Modes of the calibrated loop, at q = "));
  expect_refusal(run_program({"calibrate", file_, "--config", config_, "--write-drives",
                              scratch_.path("drives.txt")}),
                 "--write-drives: the name has to end with .yaml");
}

TEST_F(CalibrateProgram, SaysThatTheLoopIsUnstableWithTheGainsAtHand) {
  const std::string robot = "robot:\n  urdf: " + testing::arm_path("panda") +
                            "\n  base: panda_link0\n  tip: panda_hand_tcp\n"
                            "  reflected_inertia: 30 kg m^2\n  torque_loop_inertia_ratio: 0.9\n";
  const auto loop_with = [&](const std::string& damping) {
    const std::string config =
        scratch_.write("gains.yaml", robot +
                                         "control: {mode: joint}\n"
                                         "gains: {joint: {stiffness: 100, damping: " +
                                         damping + "}}\n");
    return run_program({"calibrate", file_, "--config", config, "--payload", "known"});
  };
  const Outcome calm = loop_with("10"), fierce = loop_with("1000");
  EXPECT_EQ(calm.status, 0) << calm.err;
  EXPECT_THAT(calm.out, HasSubstr("with a delay of 0 ticks"));
  EXPECT_THAT(calm.out, ::testing::Not(HasSubstr("UNSTABLE")));
  EXPECT_THAT(fierce.out, HasSubstr("These gains make this loop UNSTABLE")) << fierce.err;
}

/// A UR5 under stiff springs in its joints, with friction, and rotors of which its controller knows
/// others: 1 and 0.3 kg m^2.
std::string ur5(const std::string& rotors, const std::string& steps) {
  return "robot:\n  urdf: " + testing::arm_path("ur5") +
         "\n  base: base_link\n  tip: ee_link\n  reflected_inertia: [1, 1, 1, 0.3, 0.3, 0.3]\n"
         "control: {mode: joint}\n"
         "gains: {joint: {stiffness: [400, 400, 300, 60, 40, 30], damping: [60, 60, 50, 8, 6, "
         "5]}}\n"
         "motion: {acceleration: 3 rad/s^2}\n"
         "simulation:\n  robot: {viscous_friction: 0.5 N m s/rad, coulomb_friction: 0.3 N m, "
         "reflected_inertia: " +
         rotors +
         "}\n  drives: {delay: 3}\n  sensors: {position_noise: 1e-5 rad}\n"
         "scenario:\n  duration: 12 s\n"
         "  start: {position: [0, -1.2, 1.5, -1.9, -1.5, 0]}\n  steps: [" +
         steps + "]\n";
}

constexpr const char* kMoves =
    "{at: 0.5, joint_position: [0.7, -1.8, 1, -1.2, -1, 0.9]}, "
    "{at: 2, joint_position: [-0.6, -0.8, 2, -2.5, -2, -0.5]}, "
    "{at: 3.5, joint_position: [0.3, -1.5, 1.2, -2, -0.8, 0.8]}, "
    "{at: 5, joint_position: [0.8, -1, 1.9, -1.3, -1.9, -0.9]}, "
    "{at: 6.5, joint_position: [-0.7, -1.7, 1.1, -2.6, -1.2, 0.2]}, "
    "{at: 8, joint_position: [0.1, -0.9, 1.7, -1.6, -2.1, -0.7]}, "
    "{at: 9.5, joint_position: [-0.2, -1.4, 1.4, -2.3, -0.9, 0.6]}";

class CalibrateScene : public ::testing::Test {
 protected:
  /// Runs a scene, and returns the name of its log.
  std::string logged(const std::string& name) {
    const std::string log = scratch_.path(name + ".lcm");
    const Outcome run = run_program({"run", scratch_.path(name), "--fast", "--log", log});
    EXPECT_EQ(run.status, 0) << run.err;
    return log;
  }
  Scratch scratch_;
};

TEST_F(CalibrateScene, WritesRotorsThatTheRecordContradictsAndTheDelay) {
  const std::string config =
      scratch_.write("ur5.yaml", ur5("[0, 0.5, 0.5, 0.1, 0.1, 0.02]", kMoves));
  const std::string log = logged("ur5.yaml"), written = scratch_.path("new.yaml");
  const Outcome table = run_program({"calibrate", log, "--config", config, "--write", written});
  EXPECT_EQ(table.status, 0) << table.err;
  EXPECT_THAT(table.out, HasSubstr("Note: joint 1: its reflected inertia stays 1 kg m^2"));
  const std::string text = scratch_.read("new.yaml");
  EXPECT_THAT(text, HasSubstr("reflected_inertia: [1, 0."));
  EXPECT_THAT(text, HasSubstr("# joint 1: its reflected inertia stays 1 kg m^2"));
  EXPECT_THAT(text, HasSubstr("sampled: {delay: 3}"));
  EXPECT_THAT(text, HasSubstr("#   delay: "));
  const Json again = parse(run_program({"calibrate", log, "--config", written, "--json"}));
  EXPECT_EQ(again["loop"]["delay"], 3);
  for (const Json& joint : again["joints"]) {
    const bool first = joint["name"] == "shoulder_pan_joint";
    EXPECT_EQ(joint["suspicious"].is_null(), !first) << joint.dump();
  }
}

TEST_F(CalibrateScene, SuggestsMotionThatDeterminesTheRest) {
  std::string some = kMoves;  // without joint 6
  for (std::size_t at = 0; (at = some.find(']', at)) != std::string::npos; ++at) {
    const std::size_t last = some.rfind(' ', at) + 1;
    some.replace(last, at - last, "0");
    at = some.find(']', last);
  }
  const std::string config = scratch_.write("ur5.yaml", ur5("0.2", some));
  const std::string log = logged("ur5.yaml"), motion = scratch_.path("motion.yaml");
  const auto undetermined = [](const Json& found) {
    int count = 0;
    for (const Json& joint : found["joints"]) count += joint["wanted"].is_null() ? 0 : 1;
    return count;
  };
  const Json before = parse(
      run_program({"calibrate", log, "--config", config, "--suggest-motion", motion, "--json"}));
  EXPECT_EQ(undetermined(before), 1);
  EXPECT_THAT(before["notes"].dump(), ::testing::Not(HasSubstr("suggested motion")));
  EXPECT_THAT(scratch_.read("motion.yaml"), HasSubstr("# Goals that determine"));
  const std::string moved = logged("motion.yaml");
  const Json after = parse(run_program({"calibrate", moved, "--config", config, "--json"}));
  EXPECT_EQ(undetermined(after), 0) << after["joints"].dump();
  for (const Json& joint : after["joints"]) {
    EXPECT_NEAR(joint["reflected_inertia"].get<double>(), 0.2, 0.02);
  }
  expect_refusal(run_program({"calibrate", moved, "--config", config, "--suggest-motion", motion}),
                 "--suggest-motion: the records determine everything");
}

TEST_F(CalibrateProgram, WritesDescriptionsByTheEndingOfTheName) {
  const std::string urdf = scratch_.path("new.urdf");
  EXPECT_EQ(
      run_program({"calibrate", file_, "--config", config_, "--payload", "known", "--write", urdf})
          .status,
      0);
  const std::string text = scratch_.read("new.urdf");
  EXPECT_THAT(text, HasSubstr("<!--\n# dashpot calibrate, 20"));
  const Json inspected = parse(run_program(
      {"inspect", "--urdf", urdf, "--base", "panda_link0", "--tip", "panda_hand_tcp", "--json"}));
  EXPECT_NEAR(inspected["joints"][0]["reflected_inertia"].get<double>(), 0.3, 0.03);
  EXPECT_EQ(inspected["joints"][6]["reflected_inertia"], 0);
  const std::size_t joint = text.find("name=\"panda_joint2\"");
  EXPECT_NEAR(std::stod(text.substr(text.find(" friction=\"", joint) + 11)), 1, 0.1);

  std::string model = "<mujoco><!-- mine --><worldbody>";
  for (int j = 1; j <= 7; ++j) {
    model += "<body><joint name=\"joint" + std::to_string(j) + "\" damping=\"9\"/>";
  }
  for (int j = 1; j <= 7; ++j) model += "</body>";
  const std::string from = scratch_.write("from.xml", model +
                                                          "</worldbody><equality><joint "
                                                          "name=\"joint1\"/></equality></mujoco>");
  const std::string to = scratch_.path("new.xml");
  EXPECT_EQ(run_program({"calibrate", file_, "--config", config_, "--payload", "known", "--mjcf",
                         from, "--write", to})
                .status,
            0);
  const std::string mjcf = scratch_.read("new.xml");
  EXPECT_THAT(mjcf, HasSubstr("<joint armature=\"0."));
  EXPECT_NEAR(std::stod(mjcf.substr(mjcf.find("frictionloss=\"") + 14)), 0.8, 0.05);
  EXPECT_THAT(mjcf, HasSubstr("<equality><joint name=\"joint1\"/>"));
  EXPECT_THAT(mjcf, HasSubstr("<!-- mine -->"));
  EXPECT_THAT(mjcf, ::testing::Not(HasSubstr("damping=\"9\"")));
  expect_refusal(run_program({"calibrate", file_, "--config", config_, "--write", to}),
                 "--write: the robot comes from a URDF");
  const std::string other = scratch_.write("other.xml", "<mujoco><worldbody/></mujoco>");
  expect_refusal(
      run_program({"calibrate", file_, "--config", config_, "--mjcf", other, "--write", to}),
      "has no joint 'panda_joint1'");
}

TEST_F(CalibrateProgram, TakesDrivesFilesWithUnitsAndFriction) {
  const std::string drives =
      scratch_.write("drives.yaml",
                     "reflected_inertia: [0.3 kg m^2, 300 g m^2, 0.3, 0.3, 0.3, 0.3, 0.3]\n"
                     "viscous_friction: [2 N m s/rad, 2, 2, 2, 2, 2, 2]\ncoulomb_friction: 0.1\n");
  const Words arm = {"audit",
                     "--urdf",
                     testing::arm_path("panda"),
                     "--base",
                     "panda_link0",
                     "--tip",
                     "panda_hand_tcp",
                     "--q",
                     "0,-45 deg,0,-135 deg,0,90 deg,45 deg",
                     "--stiffness",
                     "600,600,600,30,30,30",
                     "--damping-factor",
                     "2",
                     "--json",
                     "--drives",
                     drives};
  const auto ratio = [&](const Words& more) {
    return parse(run_program(joined(arm, more)))["posture"]["smallest_ratio"].get<double>();
  };
  EXPECT_DOUBLE_EQ(ratio({}), ratio({"--viscous-friction", "2"}));
  EXPECT_GT(ratio({}), 1.05 * ratio({"--viscous-friction", "0"}));
  scratch_.write("drives.yaml", "reflected_inertia: [0.3 N]\n");
  expect_refusal(run_program(arm), "reflected_inertia");
  const std::string slide = scratch_.write(
      "slide.urdf",
      "<robot name='slide'><link name='base'/><link name='car'><inertial><mass "
      "value='95'/><inertia "
      "ixx='1' ixy='0' ixz='0' iyy='1' iyz='0' izz='1'/></inertial></link><joint name='slide' "
      "type='prismatic'><parent link='base'/><child link='car'/><axis xyz='1 0 0'/><limit "
      "lower='-1' upper='1' effort='350' velocity='1'/></joint></robot>");
  scratch_.write("drives.yaml",
                 "reflected_inertia: [70 kg]\nviscous_friction: [200 N s/m]\n"
                 "coulomb_friction: [20 N]\n");
  const Outcome inspected = run_program({"inspect", "--urdf", slide, "--base", "base", "--tip",
                                         "car", "--drives", drives, "--q", "0"});
  EXPECT_THAT(inspected.out, HasSubstr("viscous friction, N s/m")) << inspected.err;
  EXPECT_THAT(inspected.out, HasSubstr("Coulomb friction, N "));
}

}  // namespace
}  // namespace dashpot::tests
