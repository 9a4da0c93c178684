// Refusals of `dashpot run` and their messages.
#include <dashpot/lcmtypes/publish/encode.hpp>
#include <dashpot/lcmtypes/sink.hpp>
#include <dashpot/tests/apps/scene_run.hpp>
#include <dashpot/tests/support/places.hpp>

#include <gtest/gtest.h>

#include <regex>

namespace dashpot::tests {
namespace {

using ::testing::HasSubstr;
using ::testing::Not;
using ::testing::StartsWith;

/// A scene, the replacement in it, and the message; an @ stands for a number.
struct BadScene {
  const char *scene, *from, *to, *message;
};

TEST(Run, RefusesScenesInOneLineThatNamesTheKey) {
  for (const BadScene& bad : std::vector<BadScene>{

           {"ur5", "duration:", "duratoin:",
            "scenario.duratoin: unknown key; the keys are duration, start, pushes, loads, "
            "tables, steps, faults, ring_down (line 17)"},
           {"ur5", "scenario:", "watchdog: {setpoint_hold: 0.1 ms}\nscenario:",
            "scenario.start: the controller refuses it: set-point stale, holding"},
           {"ur5", "duration: 6 s", "duration: 6 kg",
            "scenario.duration: has a wrong unit: '6 kg'; s is wanted (line 17)"},
           {"ur5", "duration: 6 s", "duration: -6 s",
            "scenario.duration: is -6 s, not positive (line 17)"},
           {"ur5", "[2 cm, 0, 0, 0, 0, 0]", "[3 m, 0, 0, 0, 0, 0]",
            "scenario.start.tip_displacement: is out of the arm's reach, by @ m and @ rad "
            "(line 20)"},
           {"panda", "point: [0, 0, 0.2 m]", "point: [0, 0, 0.9 m]",
            "scenario.start.tip_displacement: puts the tip @ m inside the wall (line 64)"},
           {"panda", "[5 cm, 5 cm, -5 cm, 0, 0, 20 deg]", "[5 cm, 1.5 m, -5 cm, 0, 0, 20 deg]",
            "scenario.steps[1].tip_displacement: is out of the arm's reach, by @ m and @ rad "
            "(line 76)"},
           {"panda", "position: [0, -45 deg", "position: [0, -145 deg",
            "scenario.start.position: joint 'panda_joint2' at -2.53073 rad is outside its limits "
            "-1.7628 to 1.7628 rad (line 63)"},
           {"panda", "velocity: [0, 0, 0,", "velocity: [0, 20, 0,",
            "scenario.start.velocity: joint 2 would start with @ rad/s, its limit is @ rad/s: "
            "'outside_limits: true' lets it (line 66)"},
           {"iiwa14", "    position: [0, 30 deg, 0, -80 deg, 0, 60 deg, 0]\n", "",
            "scenario.start.position: missing (line 20)"},
           {"ur5", "at: 4 s", "at: 1 s",
            "scenario.steps[2].at: is before the step above it (line 24)"},
           {"iiwa14", "joint_position: [0.3, 0.7", "joint_position: [9.3, 0.7",
            "scenario.steps[1].joint_position: joint 'iiwa_joint_1' at 9.3 rad is outside its "
            "limits "
            "-2.96706 to 2.96706 rad; if these are degrees, give each number its unit: 'deg' (line "
            "26)"},
           {"panda", "damping: [20 N s/m, 20", "damping: [-20 N s/m, 20",
            "scenario.steps: the controller refuses this: task_damping is not positive "
            "semidefinite (line 77)"},
           {"iiwa14", "end: 1.6 s", "end: 1.4 s",
            "scenario.pushes[1].end: is not after begin (line 23)"},
           {"iiwa14", "joint_displacement: [0.02, 0.02", "joint_displacement: [0.02",
            "scenario.start.joint_displacement: has 6 entries; a list of 7, or one number for "
            "all, is wanted (line 21)"},
           {"panda", "method: rk4", "method: rk5",
            "simulation.integrator.method: semi_implicit_euler, rk4, dormand_prince_8, "
            "implicit_midpoint or rosenbrock is wanted, not 'rk5' (line 25)"},
           {"ur5", "coulomb_friction: 0.1 N m", "gear_stiffness: 1e4",
            "simulation: gear_stiffness of joint 'shoulder_pan_joint': needs a reflected_inertia, "
            "of the drive"},
           {"ur5", "coulomb_friction: 0.1 N m}",
            "gear_stiffness: 2e4, reflected_inertia: 0.2}\n  integrator: {step: 0.5 ms}",
            "simulation.integrator.step: is 0.000500 s, too long for gears of 1.13e+03 rad/s: at "
            "most "
            "0.00044 s is possible, or adaptive steps, the default of such arms"},
           {"ur5", "  steps:", "  tables: [{begin: 1 s, stiffness: 1 N/m}]\n  steps:",
            "scenario.tables: need simulation.wall, which is their place (line 21)"},
           {"panda", "tables:", "tables:\n    - {begin: 5 s, end: 6 s, stiffness: 1 N/m}",
            "scenario.tables[2].begin: is before the end of the table above it (line 90)"},
           {"ur5", "  steps:", "  faults: [{begin: 1 s}]\n  steps:",
            "scenario.faults[1].begin: is of a fault that does nothing (line 21)"},
           {"ur5", "  steps:", "  faults: [{begin: 1 s, end: 0.5 s, frozen: true}]\n  steps:",
            "scenario.faults[1].end: is not after begin (line 21)"},
           {"ur5", "  steps:", "  faults: [{begin: 1 s, end: 2 s, moved_by: 0.1 rad}]\n  steps:",
            "scenario.faults[1].moved_by: goes with a pause that has an end (line 21)"},
           {"ur5", "  steps:", "  faults: [{begin: 1 s, pause: true, call_every: 2}]\n  steps:",
            "scenario.faults[1].call_every: stands beside pause, in which there are no calls "
            "(line 21)"},
           {"ur5", "../models/ur5.urdf", "/nonexistent/a.urdf",
            "robot: /nonexistent/a.urdf: cannot be read: No such file or directory (line 5)"}}) {
    const Scratch scratch;
    const std::string path = changed(scratch, bad.scene, bad.from, bad.to);
    const Outcome outcome = run_scene(path);
    expect_refusal(outcome, "dashpot run: ");
    std::string pattern = "dashpot run: " + path + ": " + bad.message + "\n";
    pattern = std::regex_replace(pattern, std::regex(R"([.()\[\]+?*\\])"), R"(\$&)");
    pattern = std::regex_replace(pattern, std::regex("@"), "[0-9.e-]+");
    EXPECT_TRUE(std::regex_match(outcome.err, std::regex(pattern))) << outcome.err << pattern;
  }
}

TEST(Run, SaysThatAConfigurationIsNoScene) {
  const std::string path = std::string(DASHPOT_SOURCE_DIR) + "/controller/examples/panda.yaml";
  const Outcome outcome = run_scene(path);
  expect_refusal(outcome, "dashpot run: " + path +
                              ": scenario: missing: this is a configuration of the controller, for "
                              "dashpot_create; ");
  EXPECT_THAT(outcome.err, HasSubstr("scenario: {start: {position: "));
}

TEST(Run, NamesTheKeyOfStepsThatAreTooLong) {
  const Scratch scratch;
  const std::string path =  // a damper that steps of a millisecond hardly follow
      changed(scratch, "ur5", "viscous_friction: 0.5 N m s/rad", "viscous_friction: 44 N m s/rad");
  const Outcome outcome = run_scene(path, {"--duration", "60ms"});
  EXPECT_EQ(outcome.status, 0) << outcome.err;
  EXPECT_THAT(outcome.out,
              HasSubstr("the integrator's steps are too long (simulation.integrator.step)\n"));
}

TEST(Run, NamesBadOptions) {
  expect_refusals(
      {"run", scene("ur5"), "--fast"},
      {
          {{"--duration", "-1"}, "--duration"},
          {{"--duration", "nan"}, "--duration"},
          {{"--duration", "1 m"}, "--duration: a time from 1e-6 to 1e7 s is wanted, not '1 m'"},
          {{"--realtime"}, "--realtime"},
          {{"--lcm-url", "carrier-pigeon://x"}, "carrier-pigeon://x"},
          {{"--log", "/nonexistent/a.lcm"}, "/nonexistent/a.lcm: cannot write the log"},
          {{"--csv", "/nonexistent/a.csv"},
           "--csv: /nonexistent/a.csv: cannot write: No such file or directory"},
          {{"--plugin", "/nonexistent/a.so"}, "--plugin: cannot load the controller"},
      });
}

// Commands to `dashpot run`: its option, its limits, and what the monitor shows.

std::string complaint_about(const std::vector<std::string>& words) {
  const Outcome outcome = run_program(words);
  expect_refusal(outcome, "");
  return outcome.err;
}

TEST(RunCommands, AreNotTakenWhereTheyMakeNoSense) {
  EXPECT_EQ(complaint_about({"run", scene("ur5"), "--fast", "--commands"}),
            "dashpot run: --commands: is for real time: with --fast commands would come at no "
            "particular time\n");
}

TEST(RunCommands, AreSaidNotToBeTaken) {
  EXPECT_THAT(run_scene(scene("ur5"), {"--duration", "0.1"}).out,
              HasSubstr("\n  Commands: not taken (--commands)\n"));
  const Json result = run_json(scene("ur5"), {"--duration", "0.1"});
  EXPECT_EQ(result["commands"]["taken"], false);
  EXPECT_EQ(result["commands"]["verdicts"], Json::object());
  EXPECT_EQ(result["faults"], 0);
  EXPECT_EQ(result["fault"], nullptr);
}

/// The error of a scene with `limits` under the key `commands`.
std::string complaint_about_limits(const std::string& limits) {
  const Scratch scratch;
  const std::string path =
      changed(scratch, "ur5", "simulation:", "commands: {" + limits + "}\nsimulation:");
  const std::string said = complaint_about({"run", path, "--fast"});
  const std::string begin = "dashpot run: " + path + ": ";
  EXPECT_TRUE(said.starts_with(begin)) << said;
  return said.substr(begin.size());
}

TEST(RunCommands, HaveLimitsInTheScene) {
  EXPECT_EQ(complaint_about_limits("reach: 0 m"),
            "commands.reach: is 0 m, not positive (line 14)\n");
  EXPECT_EQ(complaint_about_limits("force: 20 m"),
            "commands.force: has a wrong unit: '20 m'; N is wanted (line 14)\n");
  EXPECT_EQ(complaint_about_limits("silence: 2 m"),
            "commands.silence: has a wrong unit: '2 m'; s is wanted (line 14)\n");
  EXPECT_EQ(complaint_about_limits("oldest: 4000 s"),
            "commands.oldest: is more than an hour (line 14)\n");
  EXPECT_THAT(complaint_about_limits("burst: 0"), HasSubstr("commands.burst: "));
  const std::string known = complaint_about_limits("forces: 1 N");
  EXPECT_THAT(known, HasSubstr("commands.forces: unknown key; the keys are "));
  // Each of them stands in the example.
  const std::string example = text_of(scene("panda"));
  const std::string given = example.substr(example.find("\ncommands:"));
  std::istringstream words(known.substr(known.find("keys are ") + 9));
  int keys = 0;
  for (std::string word; words >> word && word != "(line"; ++keys) {
    if (word.ends_with(',')) word.pop_back();
    EXPECT_THAT(given, HasSubstr("\n  " + word + ": "));
  }
  EXPECT_EQ(keys, 19);
}

TEST(MonitorOfCommands, ShowsFaultCommanderAndVerdicts) {
  const Scratch scratch;
  const std::string path = scratch.path("commands.lcm");
  const auto write = [&path](controller::Status fault, std::int64_t commander) {
    lcmtypes::StateSample sample;
    sample.utime = 1'700'000'000'000'000;
    sample.snapshot.tick = 700;
    for (auto* vector : {&sample.snapshot.position, &sample.snapshot.velocity}) vector->setZero(7);
    sample.snapshot.fault = fault;
    sample.health.fault_tick = fault == controller::Status::kOk ? 0 : 345;
    lcmtypes::CommandTally& commands = sample.health.commands;
    commands.commander = commander;
    if (commander != 0) {
      commands.verdicts[0] = 5;
      commands.verdicts[static_cast<std::size_t>(lcmtypes::CommandVerdict::kStale)] = 2;
      commands.verdicts[static_cast<std::size_t>(lcmtypes::CommandVerdict::kOtherSender)] = 1;
      commands.last_refusal = lcmtypes::CommandVerdict::kOtherSender;
      commands.last_refusal_utime = sample.utime - 2'500'000;
      commands.last_refused_sender = 99;
    }
    state_t message{};
    lcmtypes::fill(sample, message);
    std::vector<std::uint8_t> bytes;
    lcmtypes::encode(message, bytes);
    std::remove(path.c_str());
    EXPECT_TRUE(lcmtypes::make_log_sink(path)->send(lcmtypes::kStateChannel, bytes, sample.utime));
  };
  write(controller::Status::kVelocityLimit, 17);
  const std::string troubled = run_program({"monitor", "--log", path}).out;
  const std::string line = troubled.substr(0, troubled.find('\n'));
  EXPECT_THAT(line, HasSubstr("FAULT LATCHED at tick 345: velocity limit exceeded"));
  const std::string summary = troubled.substr(troubled.find('\n'));
  EXPECT_THAT(summary, HasSubstr("\n  FAULT LATCHED at tick 345: velocity limit exceeded"));
  EXPECT_THAT(
      summary,
      HasSubstr("\n  commands: 5 accepted, 3 rejected (2 too old, 1 another sender commands);"
                " sender 17 commands\n  last rejected 2.5 s before: another sender "
                "commands, of sender 99\n"));
  write(controller::Status::kOk, 0);
  const std::string calm = run_program({"monitor", "--log", path}).out;
  EXPECT_THAT(calm, Not(HasSubstr("LATCHED")));
  EXPECT_THAT(calm, HasSubstr("\n  commands: 0 accepted, 0 rejected; no commander\n"));
  EXPECT_THAT(calm, Not(HasSubstr("last rejected")));
}

}  // namespace
}  // namespace dashpot::tests
