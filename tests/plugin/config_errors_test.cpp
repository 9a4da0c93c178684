// What load_config says to a bad file: one line that names the key, the reason and the line.
#include <dashpot/tests/plugin/config_file.hpp>

#include <gmock/gmock.h>
#include <sys/stat.h>

#include <ostream>

namespace dashpot::tests {
namespace {

struct BadConfig {
  const char* name;
  const char* said;  ///< all of it, after the file's name
  std::string text;  ///< after the first line, which describes the robot
};

std::ostream& operator<<(std::ostream& out, const BadConfig& config) {
  return out << config.name;
}

class ConfigRefuses : public ::testing::TestWithParam<BadConfig> {};

TEST_P(ConfigRefuses, WithTheLine) {
  SCOPED_TRACE(GetParam().text);
  EXPECT_EQ(complaint(panda() + GetParam().text), GetParam().said);
}

std::string name_of(const ::testing::TestParamInfo<BadConfig>& info) {
  return info.param.name;
}

INSTANTIATE_TEST_SUITE_P(
    Keys, ConfigRefuses,
    ::testing::Values(
        BadConfig{
            "UnknownGroup",
            "gain: unknown key; the keys are robot, control, environment, gains, limits, motion, "
            "feed_forward, integral, watchdog, analysis, commands, simulation, scenario (line 2)",
            "gain: {}\n"},
        BadConfig{"UnknownKey",
                  "gains.joint.stifness: unknown key; the keys are stiffness, damping, "
                  "damping_ratio (line 4)",
                  "gains:\n  joint:\n    stifness: 600\n"},
        BadConfig{"DuplicateGroup", "limits: duplicate key (line 3)", "limits: {}\nlimits: {}\n"},
        BadConfig{"DuplicateKey", "limits.torque: duplicate key (line 4)",
                  "limits:\n  torque: 10\n  torque: 11\n"},
        BadConfig{"GroupIsNoMapping",
                  "motion: a mapping of keys to values is wanted, not 'fast' (line 2)",
                  "motion: fast\n"},
        BadConfig{"GroupIsNothing",
                  "motion: a mapping of keys to values is wanted, not nothing (line 2)",
                  "motion:\n"},
        BadConfig{"PeriodAndRate",
                  "control.rate: stands beside period, which says the same (line 2)",
                  "control: {period: 1 ms, rate: 1 kHz}\n"},
        BadConfig{"DampingMissing", "gains.joint.damping: missing; it goes with stiffness (line 3)",
                  "gains:\n  joint: {stiffness: 600}\n"},
        BadConfig{"TaskDampingMissing",
                  "gains.task.damping: missing; it goes with stiffness (line 2)",
                  "gains: {task: {stiffness: [1, 1, 1, 1, 1, 1]}}\n"},
        BadConfig{"DampingAndItsRatio",
                  "gains.task.damping_ratio: stands beside damping, in place of which it is meant "
                  "(line 5)",
                  "gains:\n  task:\n    damping: [0, 0, 0, 0, 0, 0]\n    damping_ratio: 0.7\n"},
        BadConfig{"JointDampingTwice",
                  "gains.joint.damping_ratio: stands beside damping, in place of which it is meant "
                  "(line 5)",
                  "gains:\n  joint:\n    damping: 1\n    damping_ratio: 0.7\n"},
        BadConfig{"JointDampingRatioTooLarge",
                  "gains.joint.damping_ratio: is 2.5, must be at most 2 (line 4)",
                  "gains:\n  joint:\n    damping_ratio: 2.5\n"},
        BadConfig{"DampingRatioOfNone", "gains.task.damping_ratio: is 0, not positive (line 2)",
                  "gains: {task: {damping_ratio: 0}}\n"},
        BadConfig{"DampingRatioTooLarge",
                  "gains.task.damping_ratio: is 2.5, must be at most 2 (line 4)",
                  "gains:\n  task:\n    damping_ratio: 2.5\n"},
        BadConfig{"DampingRatioNotFinite",
                  "gains.task.damping_ratio: is not finite: '.nan' (line 4)",
                  "gains:\n  task:\n    damping_ratio: .nan\n"},
        BadConfig{"StiffnessMissing",
                  "gains.null_space.stiffness: missing; it goes with damping (line 3)",
                  "gains:\n  null_space: {damping: 2}\n"}),
    name_of);

INSTANTIATE_TEST_SUITE_P(
    Numbers, ConfigRefuses,
    ::testing::Values(
        BadConfig{"WrongUnit", "control.period: has a wrong unit: '1 kHz'; s is wanted (line 2)",
                  "control: {period: 1 kHz}\n"},
        BadConfig{"WrongUnitInAList",
                  "gains.joint.stiffness: entry 3 has a wrong unit: '6 Nm'; N m/rad is wanted "
                  "(line 5)",
                  "gains:\n  joint:\n    damping: 1\n"
                  "    stiffness: [1, 2, 6 Nm, 4, 5, 6, 7]\n"},
        BadConfig{"WrongUnitInTheTask",
                  "gains.task.stiffness: entry 4 has a wrong unit: '2 N/m'; N m/rad is wanted "
                  "(line 2)",
                  "gains: {task: {damping: [0,0,0,0,0,0], stiffness: [1, 1, 1, 2 N/m, 1, 1]}}\n"},
        BadConfig{"UnknownUnit",
                  "limits.torque: is not a number but '80 lbf': unknown unit 'lbf' (line 2)",
                  "limits: {torque: 80 lbf}\n"},
        BadConfig{"UnitInAMatrix",
                  "gains.task.damping: row 2, entry 2 has a wrong unit: '1 N s/m'; a number "
                  "without unit is wanted (line 4)",
                  "gains: {task: {stiffness: [0,0,0,0,0,0], damping: [\n"
                  "  [1, 0, 0, 0, 0, 0],\n  [0, 1 N s/m, 0, 0, 0, 0]]}}\n"},
        BadConfig{"NotANumber", "control.period: is not a number but 'soon' (line 2)",
                  "control: {period: soon}\n"},
        BadConfig{"NotANumberButAList", "watchdog.longest_gap: is not a number but a list (line 2)",
                  "watchdog: {longest_gap: [1]}\n"},
        BadConfig{"Nothing", "watchdog.longest_gap: is not a number but nothing (line 3)",
                  "watchdog:\n  longest_gap:\n"},
        BadConfig{"NaN", "limits.torque: entry 2 is not finite: '.nan' (line 2)",
                  "limits: {torque: [1, .nan, 3, 4, 5, 6, 7]}\n"},
        BadConfig{"Infinity", "limits.velocity: is not finite: '.inf' (line 2)",
                  "limits: {velocity: .inf}\n"},
        BadConfig{"NoneWhereALimitIsNeeded", "limits.torque: is not a number but 'none' (line 2)",
                  "limits: {torque: none}\n"},
        BadConfig{"NegativeTorque", "limits.torque: entry 2 is -5 N m, not positive (line 2)",
                  "limits: {torque: [1, -5, 3, 4, 5, 6, 7]}\n"},
        BadConfig{"ZeroPeriod", "control.period: is 0 s, not positive (line 2)",
                  "control: {period: 0}\n"},
        BadConfig{"NegativeRate", "control.rate: is -1000 Hz, not positive (line 2)",
                  "control: {rate: -1 kHz}\n"},
        BadConfig{"NegativeHold", "watchdog.setpoint_hold: is -0.1 s, negative (line 2)",
                  "watchdog: {setpoint_hold: -100 ms}\n"},
        BadConfig{"NegativeNullDamping",
                  "gains.null_space.damping: is -1 N m s/rad, negative (line 2)",
                  "gains: {null_space: {stiffness: 1, damping: -1}}\n"},
        BadConfig{"NotWhole",
                  "analysis.every: is 2.5; a whole number, 1 or more, is wanted (line 2)",
                  "analysis: {every: 2.5}\n"},
        BadConfig{"CountTooSmall",
                  "analysis.every: is 0; a whole number, 1 or more, is wanted (line 2)",
                  "analysis: {every: 0}\n"},
        BadConfig{"MoreThanAPeriod", "analysis.share: is 1.5, must be at most 1 (line 2)",
                  "analysis: {share: 1.5}\n"},
        BadConfig{"LongDelay", "analysis.sampled.delay: is 21 ticks, must be at most 20 (line 2)",
                  "analysis: {sampled: {delay: 21}}\n"}),
    name_of);

INSTANTIATE_TEST_SUITE_P(
    Sizes, ConfigRefuses,
    ::testing::Values(
        BadConfig{"ListTooShort",
                  "limits.torque: has 6 entries; a list of 7, or one number for all, is wanted "
                  "(line 2)",
                  "limits: {torque: [1, 2, 3, 4, 5, 6]}\n"},
        BadConfig{"ListEmpty",
                  "limits.torque: has 0 entries; a list of 7, or one number for all, is wanted "
                  "(line 2)",
                  "limits: {torque: []}\n"},
        BadConfig{"TaskOfOneNumber",
                  "gains.task.stiffness: is not a list, and the unit of entry 1 is N/m, that of "
                  "entry 4 is N m/rad; a list of 6 is wanted (line 2)",
                  "gains: {task: {stiffness: 600, damping: 1}}\n"},
        BadConfig{"TaskTooShort",
                  "gains.task.stiffness: has 3 entries; a list of 6 is wanted (line 2)",
                  "gains: {task: {stiffness: [1, 2, 3], damping: 1}}\n"},
        BadConfig{"MatrixOfWrongSize",
                  "gains.joint.stiffness: is 2 x 2; 7 x 7, or a list of 7 numbers, is wanted "
                  "(line 2)",
                  "gains: {joint: {stiffness: [[1, 0], [0, 1]], damping: 1}}\n"},
        BadConfig{"MatrixWithARowTooShort",
                  "gains.task.stiffness: row 2 has 5 entries, row 1 has 6 (line 3)",
                  "gains: {task: {damping: [0,0,0,0,0,0], stiffness: [[1, 0, 0, 0, 0, 0],\n"
                  "  [0, 1, 0, 0, 0]]}}\n"}),
    name_of);

const std::string kTaskRows =
    "  - [0, 0, 1, 0, 0, 0]\n  - [0, 0, 0, 1, 0, 0]\n  - [0, 0, 0, 0, 1, 0]\n"
    "  - [0, 0, 0, 0, 0, 1]\n";

INSTANTIATE_TEST_SUITE_P(
    Values, ConfigRefuses,
    ::testing::Values(
        BadConfig{"NegativeStiffness",
                  "gains.joint.stiffness: is not positive semidefinite (line 2)",
                  "gains: {joint: {stiffness: -600, damping: 1}}\n"},
        BadConfig{"IndefiniteOfTheOtherMode",
                  "gains.task.damping: is not positive semidefinite (line 6)",
                  "gains:\n task:\n  stiffness: [0, 0, 0, 0, 0, 0]\n  damping:\n"
                  "  - [1, 2, 0, 0, 0, 0]\n  - [2, 1, 0, 0, 0, 0]\n" +
                      kTaskRows},
        BadConfig{"NotSymmetric", "gains.task.damping: is not symmetric (line 6)",
                  "gains:\n task:\n  stiffness: [0, 0, 0, 0, 0, 0]\n  damping:\n"
                  "  - [1, 0, 0, 0, 0, 0]\n  - [0.1, 1, 0, 0, 0, 0]\n" +
                      kTaskRows},
        BadConfig{"LimitsReversed",
                  "limits.position_lower[1]: is 2 rad, has to be below the upper limit (line 4)",
                  "limits:\n  torque: 10\n  position_lower: [-1, 2, -1, -2, -1, -1, -1]\n"},
        BadConfig{"RepulsionAboveOne", "limits.repulsion: is 1.5, must be at most 1 (line 2)",
                  "limits: {repulsion: 1.5}\n"},
        BadConfig{"GapBelowThePeriod",
                  "watchdog.longest_gap: is 0.001 s, has to exceed the period (line 3)",
                  "control: {period: 2 ms}\nwatchdog: {longest_gap: 1 ms}\n"},
        BadConfig{"UnknownMode", "control.mode: joint or cartesian is wanted, not 'Joint' (line 2)",
                  "control: {mode: Joint}\n"},
        BadConfig{"UnknownFrame", "gains.task.frame: base or tool is wanted, not 'world' (line 2)",
                  "gains: {task: {frame: world}}\n"},
        BadConfig{
            "UnknownDirection",
            "gains.task.directions: entry 2: x, y, z, rx, ry or rz is wanted, not 'w' (line 2)",
            "gains: {task: {directions: [x, w]}}\n"},
        BadConfig{"DirectionTwice", "gains.task.directions: entry 3 is given twice (line 2)",
                  "gains: {task: {directions: [x, y, x]}}\n"},
        BadConfig{"DirectionsNotAList", "gains.task.directions: a list is wanted, not 'x' (line 2)",
                  "gains: {task: {directions: x}}\n"},
        BadConfig{"NoSwitch", "feed_forward.gravity: true or false is wanted, not 'yes' (line 2)",
                  "feed_forward: {gravity: yes}\n"},
        BadConfig{"UnknownPlace",
                  "analysis.where: off, inline or background is wanted, not a list (line 2)",
                  "analysis: {where: []}\n"}),
    name_of);

INSTANTIATE_TEST_SUITE_P(
    Files, ConfigRefuses,
    ::testing::Values(BadConfig{"Yaml", "is not YAML: illegal flow end (line 2)", "limits: ]\n"},
                      BadConfig{"SecondDocument",
                                "holds several documents; give a list instead (line 3)",
                                "---\nlimits: {}\n"}),
    name_of);

/// What is wrong with the robot; `keys` follow urdf, base and tip.
std::string complaint_about(const std::string& keys) {
  std::string text = panda();
  text.insert(text.size() - 2, keys);
  return complaint("# A robot.\n" + text);
}

TEST(ConfigRobot, HasToBeThere) {
  EXPECT_EQ(complaint("control: {}\n"), "robot.urdf: missing");
  EXPECT_EQ(complaint("robot:\n  urdf: a.urdf\n  tip: hand\n"), "robot.base: missing (line 2)");
  EXPECT_EQ(complaint("robot: {urdf: a.urdf, base: ''}\n"),
            "robot.base: a text is wanted, not '' (line 1)");
  EXPECT_EQ(complaint("robot: {urdf: [a]}\n"), "robot.urdf: a text is wanted, not a list (line 1)");
}

TEST(ConfigRobot, HasKeysThatAreChecked) {
  EXPECT_EQ(complaint_about(", payload: {mass: -1 kg}"),
            "robot.payload.mass: is -1 kg, negative (line 2)");
  EXPECT_EQ(complaint_about(", payload: {weight: 1}"),
            "robot.payload.weight: unknown key; the keys are mass, center, inertia (line 2)");
  EXPECT_EQ(complaint_about(", payload: {inertia: [1, 2]}"),
            "robot.payload.inertia: has 2 entries; a list of 3, or one number for all, is wanted "
            "(line 2)");
  EXPECT_EQ(complaint_about(", gravity: 9.81"),
            "robot.gravity: a list of 3 numbers is wanted, not '9.81' (line 2)");
  EXPECT_EQ(complaint_about(", tool: {rpy: [0, 0, 1 m]}"),
            "robot.tool.rpy: entry 3 has a wrong unit: '1 m'; rad is wanted (line 2)");
  EXPECT_EQ(complaint_about(", viscous_friction: -1"),
            "robot.viscous_friction: is -1 N m s/rad, negative (line 2)");
  EXPECT_EQ(complaint_about(", reflected_inertia: 3 kg"),
            "robot.reflected_inertia: has a wrong unit: '3 kg'; kg m^2 is wanted (line 2)");
  EXPECT_EQ(complaint_about(", coulomb_friction: [1, 2]"),
            "robot.coulomb_friction: has 2 entries; a list of 7, or one number for all, is wanted "
            "(line 2)");
}

TEST(ConfigRobot, HasAUrdfThatIsInOrder) {
  const auto with = [](const std::string& urdf, const std::string& base) {
    return complaint("control: {}\nrobot: {urdf: " + urdf + ", base: " + base +
                     ", tip: panda_link8}\n");
  };
  EXPECT_THAT(with("/nowhere.urdf", "panda_link0"),
              ::testing::MatchesRegex("robot: /nowhere.urdf: .*No such file.* \\(line 2\\)"));
  EXPECT_THAT(with(urdf_path("panda.urdf"), "panda_link99"),
              ::testing::MatchesRegex("robot: .*panda.urdf: link 'panda_link99': .* \\(line 2\\)"));
  EXPECT_THAT(complaint_about(", reflected_inertia: [1, 2]"),
              ::testing::MatchesRegex("robot.*2 entries.* \\(line 2\\)"));
}

TEST(ConfigRobot, HasAUrdfThatAParserCanBear) {
  const Scratch scratch;
  std::string text = "<robot name='r'>";
  for (int i = 0; i < 100'000; ++i) text += "<a>";
  const std::string urdf = scratch.write("deep.urdf", text);
  EXPECT_EQ(complaint("robot: {urdf: " + urdf + ", base: a, tip: b}\n"),
            "robot: " + urdf + ": line 1: elements are nested more than 64 deep (line 1)");
}

TEST(ConfigFile, HasAnEnd) {
  const Scratch scratch;
  const std::string pipe = scratch.path("pipe");
  ASSERT_EQ(mkfifo(pipe.c_str(), 0600), 0);
  for (const std::string& path : {pipe, std::string("/dev/zero")}) {
    try {
      controller::load_config(path);
      ADD_FAILURE() << path;
    } catch (const controller::InputError& error) {
      EXPECT_EQ(error.what(), path + ": is not a regular file");
    }
  }
}

TEST(ConfigFile, HasToBeThere) {
  try {
    controller::load_config("no-such-file.yaml");
    FAIL();
  } catch (const controller::InputError& error) {
    EXPECT_STREQ(error.what(), "no-such-file.yaml: cannot be opened: No such file or directory");
  }
  EXPECT_EQ(complaint(""), "is empty");
  EXPECT_EQ(complaint("- 1\n"), "a mapping of keys to values is wanted, not a list (line 1)");
}

}  // namespace
}  // namespace dashpot::tests
