// Errors of load_config for a bad file: one line that names the key, the reason and the line.
#include <dashpot/tests/plugin/config_file.hpp>

#include <gmock/gmock.h>
#include <sys/stat.h>

#include <string>
#include <vector>

namespace dashpot::tests {
namespace {

using ::testing::HasSubstr;

struct BadConfig {
  const char* said;  ///< all of it, after the file's name
  std::string text;  ///< after the first line, which describes the robot
};

const std::string kTaskRows =
    "  - [0, 0, 1, 0, 0, 0]\n  - [0, 0, 0, 1, 0, 0]\n  - [0, 0, 0, 0, 1, 0]\n"
    "  - [0, 0, 0, 0, 0, 1]\n";

const BadConfig kBadConfigs[] = {

    {"gain: unknown key; the keys are robot, control, environment, gains, limits, motion, "
     "feed_forward, integral, watchdog, analysis, commands, simulation, scenario (line 2)",
     "gain: {}\n"},
    {"gains.joint.stifness: unknown key; the keys are stiffness, damping, damping_ratio (line 4)",
     "gains:\n  joint:\n    stifness: 600\n"},
    {"limits: duplicate key (line 3)", "limits: {}\nlimits: {}\n"},
    {"limits.torque: duplicate key (line 4)", "limits:\n  torque: 10\n  torque: 11\n"},
    {"motion: a mapping of keys to values is wanted, not 'fast' (line 2)", "motion: fast\n"},
    {"motion: a mapping of keys to values is wanted, not nothing (line 2)", "motion:\n"},
    {"control.rate: stands beside period, which says the same (line 2)",
     "control: {period: 1 ms, rate: 1 kHz}\n"},
    {"gains.joint.damping: missing; it goes with stiffness (line 3)",
     "gains:\n  joint: {stiffness: 600}\n"},
    {"gains.task.damping: missing; it goes with stiffness (line 2)",
     "gains: {task: {stiffness: [1, 1, 1, 1, 1, 1]}}\n"},
    {"gains.task.damping_ratio: stands beside damping; give only one of them (line 5)",
     "gains:\n  task:\n    damping: [0, 0, 0, 0, 0, 0]\n    damping_ratio: 0.7\n"},
    {"gains.joint.damping_ratio: stands beside damping; give only one of them (line 5)",
     "gains:\n  joint:\n    damping: 1\n    damping_ratio: 0.7\n"},
    {"gains.joint.damping_ratio: is 2.5, must be at most 2 (line 4)",
     "gains:\n  joint:\n    damping_ratio: 2.5\n"},
    {"gains.task.damping_ratio: is 0, not positive (line 2)",
     "gains: {task: {damping_ratio: 0}}\n"},
    {"gains.task.damping_ratio: is 2.5, must be at most 2 (line 4)",
     "gains:\n  task:\n    damping_ratio: 2.5\n"},
    {"gains.task.damping_ratio: is not finite: '.nan' (line 4)",
     "gains:\n  task:\n    damping_ratio: .nan\n"},
    {"gains.null_space.stiffness: missing; it goes with damping (line 3)",
     "gains:\n  null_space: {damping: 2}\n"},

    {"control.period: has a wrong unit: '1 kHz'; s is wanted (line 2)",
     "control: {period: 1 kHz}\n"},
    {"gains.joint.stiffness: entry 3 has a wrong unit: '6 Nm'; N m/rad is wanted (line 5)",
     "gains:\n  joint:\n    damping: 1\n"
     "    stiffness: [1, 2, 6 Nm, 4, 5, 6, 7]\n"},
    {"gains.task.stiffness: entry 4 has a wrong unit: '2 N/m'; N m/rad is wanted (line 2)",
     "gains: {task: {damping: [0,0,0,0,0,0], stiffness: [1, 1, 1, 2 N/m, 1, 1]}}\n"},
    {"limits.torque: is not a number but '80 lbf': unknown unit 'lbf' (line 2)",
     "limits: {torque: 80 lbf}\n"},
    {"gains.task.damping: row 2, entry 2 has a wrong unit: '1 N s/m'; a number "
     "without unit is wanted (line 4)",
     "gains: {task: {stiffness: [0,0,0,0,0,0], damping: [\n"
     "  [1, 0, 0, 0, 0, 0],\n  [0, 1 N s/m, 0, 0, 0, 0]]}}\n"},
    {"control.period: is not a number but 'soon' (line 2)", "control: {period: soon}\n"},
    {"watchdog.longest_gap: is not a number but a list (line 2)", "watchdog: {longest_gap: [1]}\n"},
    {"watchdog.longest_gap: is not a number but nothing (line 3)", "watchdog:\n  longest_gap:\n"},
    {"limits.torque: entry 2 is not finite: '.nan' (line 2)",
     "limits: {torque: [1, .nan, 3, 4, 5, 6, 7]}\n"},
    {"limits.velocity: is not finite: '.inf' (line 2)", "limits: {velocity: .inf}\n"},
    {"limits.torque: is not a number but 'none' (line 2)", "limits: {torque: none}\n"},
    {"limits.torque: entry 2 is -5 N m, not positive (line 2)",
     "limits: {torque: [1, -5, 3, 4, 5, 6, 7]}\n"},
    {"control.period: is 0 s, not positive (line 2)", "control: {period: 0}\n"},
    {"control.rate: is -1000 Hz, not positive (line 2)", "control: {rate: -1 kHz}\n"},
    {"watchdog.setpoint_hold: is -0.1 s, negative (line 2)",
     "watchdog: {setpoint_hold: -100 ms}\n"},
    {"gains.null_space.damping: is -1 N m s/rad, negative (line 2)",
     "gains: {null_space: {stiffness: 1, damping: -1}}\n"},
    {"analysis.every: is 2.5; a whole number, 1 or more, is wanted (line 2)",
     "analysis: {every: 2.5}\n"},
    {"analysis.every: is 0; a whole number, 1 or more, is wanted (line 2)",
     "analysis: {every: 0}\n"},
    {"analysis.share: is 1.5, must be at most 1 (line 2)", "analysis: {share: 1.5}\n"},
    {"analysis.sampled.delay: is 21 ticks, must be at most 20 (line 2)",
     "analysis: {sampled: {delay: 21}}\n"},

    {"limits.torque: has 6 entries; a list of 7, or one number for all, is wanted (line 2)",
     "limits: {torque: [1, 2, 3, 4, 5, 6]}\n"},
    {"limits.torque: has 0 entries; a list of 7, or one number for all, is wanted (line 2)",
     "limits: {torque: []}\n"},
    {"gains.task.stiffness: is not a list, and the unit of entry 1 is N/m, the unit of "
     "entry 4 is N m/rad; a list of 6 is wanted (line 2)",
     "gains: {task: {stiffness: 600, damping: 1}}\n"},
    {"gains.task.stiffness: has 3 entries; a list of 6 is wanted (line 2)",
     "gains: {task: {stiffness: [1, 2, 3], damping: 1}}\n"},
    {"gains.joint.stiffness: is 2 x 2; 7 x 7, or a list of 7 numbers, is wanted (line 2)",
     "gains: {joint: {stiffness: [[1, 0], [0, 1]], damping: 1}}\n"},
    {"gains.task.stiffness: row 2 has 5 entries, row 1 has 6 (line 3)",
     "gains: {task: {damping: [0,0,0,0,0,0], stiffness: [[1, 0, 0, 0, 0, 0],\n"
     "  [0, 1, 0, 0, 0]]}}\n"},

    {"gains.joint.stiffness: is not positive semidefinite (line 2)",
     "gains: {joint: {stiffness: -600, damping: 1}}\n"},
    {"gains.task.damping: is not positive semidefinite (line 6)",
     "gains:\n task:\n  stiffness: [0, 0, 0, 0, 0, 0]\n  damping:\n"
     "  - [1, 2, 0, 0, 0, 0]\n  - [2, 1, 0, 0, 0, 0]\n" +
         kTaskRows},
    {"gains.task.damping: is not symmetric (line 6)",
     "gains:\n task:\n  stiffness: [0, 0, 0, 0, 0, 0]\n  damping:\n"
     "  - [1, 0, 0, 0, 0, 0]\n  - [0.1, 1, 0, 0, 0, 0]\n" +
         kTaskRows},
    {"limits.position_lower[1]: is 2 rad, has to be below the upper limit (line 4)",
     "limits:\n  torque: 10\n  position_lower: [-1, 2, -1, -2, -1, 0, -1]\n"},
    {"limits.stopping_time: is 0 s, not positive (line 2)", "limits: {stopping_time: 0}\n"},
    {"limits.damping: is gone: limits.stopping_time replaces it (line 3)",
     "limits:\n  damping: 5\n"},
    {"watchdog.longest_gap: is 0.001 s, has to exceed the period (line 3)",
     "control: {period: 2 ms}\nwatchdog: {longest_gap: 1 ms}\n"},
    {"control.mode: joint or cartesian is wanted, not 'Joint' (line 2)",
     "control: {mode: Joint}\n"},
    {"gains.task.frame: base or tool is wanted, not 'world' (line 2)",
     "gains: {task: {frame: world}}\n"},
    {"gains.task.directions: entry 2: x, y, z, rx, ry or rz is wanted, not 'w' (line 2)",
     "gains: {task: {directions: [x, w]}}\n"},
    {"gains.task.directions: entry 3 is given twice (line 2)",
     "gains: {task: {directions: [x, y, x]}}\n"},
    {"gains.task.directions: a list is wanted, not 'x' (line 2)",
     "gains: {task: {directions: x}}\n"},
    {"feed_forward.gravity: true or false is wanted, not 'yes' (line 2)",
     "feed_forward: {gravity: yes}\n"},
    {"analysis.where: off, inline or background is wanted, not a list (line 2)",
     "analysis: {where: []}\n"},
    {"is not YAML: illegal flow end (line 2)", "limits: ]\n"},
    {"holds several documents; give a list instead (line 3)", "---\nlimits: {}\n"}};

TEST(ConfigRefuses, WithTheLine) {
  for (const BadConfig& bad : kBadConfigs) {
    EXPECT_EQ(complaint(panda() + bad.text), bad.said) << bad.text;
  }
}

/// A setting in another unit, or off by a zero, would switch a protection off.
TEST(ConfigRefuses, WhatIsBeyondTheModel) {
  struct Beyond {
    const char* settings;  ///< on line 2
    const char* said;
  };
  for (const auto& [settings, said] : std::vector<Beyond>{
           {"limits: {velocity: 150}",
            "limits.velocity[0]: is 150 rad/s, beyond the model's limit of joint 'panda_joint1', "
            "2.175 rad/s; is it in deg/s? Write '150 deg/s'"},
           {"limits: {torque: 870}",
            "limits.torque[0]: is 870 N m, beyond the model's limit of joint 'panda_joint1', "
            "87 N m"},
           {"limits: {position_lower: -10}",
            "limits.position_lower[0]: is -10 rad, beyond the model's limit of joint "
            "'panda_joint1', -2.8973 rad; is it in deg? Write '-10 deg'"},
           {"limits: {position_upper: none}",
            "limits.position_upper[0]: is inf rad, beyond the model's limit of joint "
            "'panda_joint1', 2.8973 rad"},
           {"limits: {angular_error: 60}",
            "limits.angular_error: is 60 rad, beyond half a turn, 3.14159 rad; is it in deg? Write "
            "'60 deg'"},
           {"motion: {velocity: 30}",
            "motion.velocity[0]: is 30 rad/s, beyond the model's limit of joint 'panda_joint1', "
            "2.175 rad/s; is it in deg/s? Write '30 deg/s'"},
           {"integral: {torque: 100}",
            "integral.torque[0]: is 100 N m, beyond the model's limit of joint 'panda_joint1', "
            "87 N m"},
           {"limits: {stopping_time: 50}",
            "limits.stopping_time: is 50 s, beyond a reasonable time, 5 s; is it in ms? Write "
            "'50 ms'"},
           {"watchdog: {longest_gap: 10}",
            "watchdog.longest_gap: is 10 s, beyond a reasonable time, 1 s; is it in ms? Write "
            "'10 ms'"}}) {
    EXPECT_EQ(complaint(panda() + settings),
              std::string(said) + "; limits.beyond_model: true accepts it (line 2)");
    std::string accepted = settings;
    if (accepted.starts_with("limits")) {
      accepted.insert(accepted.size() - 1, ", beyond_model: true");
    } else {
      accepted += "\nlimits: {beyond_model: true}";
    }
    EXPECT_NO_THROW(load(panda() + accepted)) << accepted;
  }
  for (const char* key :
       {"limits: {tip_velocity: 250", "limits: {linear_error: 300", "motion: {linear_velocity: 250",
        "motion: {angular_velocity: 90", "watchdog: {setpoint_hold: 500",
        "watchdog: {setpoint_damp: 2000", "watchdog: {feedback: 500",
        "watchdog: {release_after: 2000", "integral: {time: 500", "motion: {gain_time: 500",
        "motion: {linear_acceleration: 2000", "motion: {acceleration: 340",
        "motion: {angular_acceleration: 340", "watchdog: {start_torque: 25"}) {
    EXPECT_THAT(complaint(panda() + key + "}"), HasSubstr("; is it in ")) << key;
  }
  for (const char* key :
       {"limits: {external_torque: 300", "limits: {external_force: 6000", "limits: {power: 200000",
        "limits: {torque_rate: 1e9", "integral: {force: 10000", "integral: {moment: 5000"}) {
    EXPECT_THAT(complaint(panda() + key + "}"), HasSubstr(", beyond ")) << key;
  }
  EXPECT_THAT(complaint(panda() + "limits: {walls: [{point: [0, 0, -50], normal: [0, 0, 1]}]}"),
              HasSubstr("limits.walls: is 50 m, from the base, beyond the arm's reach"));
  EXPECT_THAT(complaint(panda() + "watchdog: {setpoint_hold: 2, setpoint_damp: 0.5}"),
              HasSubstr("before setpoint_hold, 2 s, so that hold would never act"));
  EXPECT_NO_THROW(load(panda() + "limits: {velocity: 2.18, torque: 12, position_lower: [-2.9, -1, "
                                 "-1, -2, -1, 0, -1]}"));
}

/// Returns the error of the robot; `keys` follow urdf, base and tip.
std::string complaint_about(const std::string& keys) {
  std::string text = panda();
  text.insert(text.size() - 2, keys);
  return complaint("# A robot.\n" + text);
}

TEST(ConfigRobot, HasKeysThatAreChecked) {
  for (const auto& [said, text] : std::vector<BadConfig>{
           {"robot.urdf: missing", "control: {}\n"},
           {"robot.base: missing (line 2)", "robot:\n  urdf: a.urdf\n  tip: hand\n"},
           {"robot.base: a text is wanted, not '' (line 1)", "robot: {urdf: a.urdf, base: ''}\n"},
           {"robot.urdf: a text is wanted, not a list (line 1)", "robot: {urdf: [a]}\n"}}) {
    EXPECT_EQ(complaint(text), said);
  }
  for (const auto& [said, keys] : std::vector<BadConfig>{
           {"robot.payload.mass: is -1 kg, negative (line 2)", ", payload: {mass: -1 kg}"},
           {"robot.payload.weight: unknown key; the keys are mass, center, inertia (line 2)",
            ", payload: {weight: 1}"},
           {"robot.payload: has a centre or inertia, and no mass (line 2)",
            ", payload: {center: [0, 0, 0.05]}"},
           {"robot.payload.inertia: has 2 entries; a list of 3, or one number for all, is wanted "
            "(line 2)",
            ", payload: {inertia: [1, 2]}"},
           {"robot.gravity: a list of 3 numbers is wanted, not '9.81' (line 2)", ", gravity: 9.81"},
           {"robot.tool.rpy: entry 3 has a wrong unit: '1 m'; rad is wanted (line 2)",
            ", tool: {rpy: [0, 0, 1 m]}"},
           {"robot.tool.rpy: has an angle beyond a turn, in rad; degrees are written as '90 deg' "
            "(line 2)",
            ", tool: {rpy: [0, 90, 0]}"},
           {"robot.viscous_friction: is -1 N m s/rad, negative (line 2)", ", viscous_friction: -1"},
           {"robot.reflected_inertia: has a wrong unit: '3 kg'; kg m^2 is wanted (line 2)",
            ", reflected_inertia: 3 kg"},
           {"robot.coulomb_friction: has 2 entries; a list of 7, or one number for all, is wanted "
            "(line 2)",
            ", coulomb_friction: [1, 2]"},
           {"robot.gear_stiffness: is 0 N m/rad, not positive (line 2)",
            ", reflected_inertia: 1, gear_stiffness: 0"},
           {"robot.gear_damping: is -1 N m s/rad, negative (line 2)",
            ", reflected_inertia: 1, gear_stiffness: 1e4, gear_damping: -1"},
           {"robot.gear_damping: needs gear_stiffness, N m/rad (line 2)", ", gear_damping: 1"},
           {"robot.position_sensor: motor or link is wanted, not 'both' (line 2)",
            ", position_sensor: both"},
           {"robot.torque_loop_inertia_ratio: is 2, must be at most 1 (line 2)",
            ", reflected_inertia: 1, torque_loop_inertia_ratio: 2"},
           {"robot.torque_loop_inertia_ratio: needs reflected_inertia, kg m^2, or drives (line 2)",
            ", torque_loop_inertia_ratio: 0.5"}}) {
    EXPECT_EQ(complaint_about(keys), said);
  }
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
  EXPECT_THAT(complaint_about(", gear_stiffness: 1e4"),
              ::testing::HasSubstr("joint 'panda_joint1': a gear stiffness of 10000 N m/rad needs "
                                   "the reflected inertia (kg m^2) of the motor behind it"));
  EXPECT_THAT(complaint_about(", reflected_inertia: [1, 2]"),
              ::testing::MatchesRegex("robot.*2 entries.* \\(line 2\\)"));
}

TEST(ConfigFile, HasAnEnd) {
  const Scratch scratch;
  const std::string pipe = scratch.path("pipe");
  ASSERT_EQ(mkfifo(pipe.c_str(), 0600), 0);
  for (const std::string& path : {pipe, std::string("/dev/zero")}) {
    EXPECT_EQ(load_refusal(path), path + ": is not a regular file");
  }
}

TEST(ConfigFile, HasToBeThere) {
  EXPECT_EQ(load_refusal("no-such-file.yaml"),
            "no-such-file.yaml: cannot be opened: No such file or directory");
  EXPECT_EQ(complaint(""), "is empty");
  EXPECT_EQ(complaint("- 1\n"), "a mapping of keys to values is wanted, not a list (line 1)");
}

}  // namespace
}  // namespace dashpot::tests
