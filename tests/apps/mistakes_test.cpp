// Mistakes of a new user are answered in one line that says what to write.
#include <dashpot/tests/apps/run_program.hpp>
#include <dashpot/tests/apps/scene_run.hpp>
#include <dashpot/tests/support/arms.hpp>

#include <gmock/gmock.h>
#include <sys/stat.h>

#include <cmath>
#include <filesystem>
#include <sstream>

namespace dashpot::tests {
namespace {

const Words kStiffness = {"--stiffness", "200,200,200,20,20,20"};

TEST(Mistakes, InNamesOfSubcommandsAreGuessed) {
  for (const auto& [word, meant] : {std::pair("analyse", "analyze"),
                                    {"RUN", "run"},
                                    {"mointor", "monitor"},
                                    {"idnetify", "identify"},
                                    {"checkmodel", "check-model"},
                                    {"insp", "inspect"}}) {
    expect_refusal(run_program({word, "x"}),
                   std::string("'") + word + "' is not a subcommand; did you mean " + meant + "?");
  }
  for (const Words& words : {Words{}, Words{"--jsno"}})
    expect_refusal(run_program(words), "dashpot: ");
  expect_refusal(run_program({"help"}), "dashpot --help is meant");
  expect_refusal(run_program({"version"}), "dashpot --version is meant");
  expect_refusal(run_program({"x"}), "'x' is not a subcommand; there are analyze, inspect, ");
}

TEST(Mistakes, InNamesOfOptionsAreGuessed) {
  const std::string file = example("chain3.yaml");
  expect_refusal(run_program({"analyze", file, "--jsn"}), "--jsn; did you mean --json?");
  expect_refusal(run_program({"analyze", file, "--soft-freq=1"}), "did you mean --soft-frequency?");
  expect_refusal(run_program(joined(of_panda("audit", kStiffness), {"--damping_factor", "2"})),
                 "did you mean --damping-factor?");
  const Outcome other = run_program({"analyze", file, "--wrongness"});
  expect_refusal(other, "--wrongness");
  EXPECT_THAT(other.err, ::testing::Not(::testing::HasSubstr("did you mean")));
}

TEST(Mistakes, InListsOfNumbersAreNamed) {
  expect_refusal(run_program(of_panda("inspect", {"--q", "0 0 0 -1.5 0 1.5 0"})),
                 "--q: 1 number, expected 7, with commas between them");
  const Outcome one = run_program(of_panda("inspect", {"--q", "30 deg"}));
  expect_refusal(one, "--q: 1 number, expected 7");
  EXPECT_THAT(one.err, ::testing::Not(::testing::HasSubstr("commas")));
}

TEST(Mistakes, InWhatGoesTogetherAreNamed) {
  expect_refusal(run_program(joined({"design", example("chain3.yaml"), "--damping-ratio", "1"},
                                    {"--urdf", "a.urdf"})),
                 "FILE: does not go with --urdf: give one of them");
  expect_refusal(run_program({"design", "--damping-ratio", "1"}), "FILE: give a file, or --urdf");
  const Scratch scratch;
  expect_refusal(run_program({"export", scratch.write("a.lcm", "")}),
                 "dashpot export: --mcap, --csv: one of them is needed");
  expect_refusal(run_program(joined(of_panda("audit", kStiffness),
                                    {"--damping-factor", "2", "--samples", "5", "--seed", "-1"})),
                 "--seed");
}

TEST(Mistakes, InGainsOfTheTaskAreAskedAbout) {
  const auto said = [](const std::string& stiffness, const std::string& damping) {
    const Outcome done =
        run_program(of_panda("audit", {"--stiffness", stiffness, "--damping", damping}));
    EXPECT_EQ(done.status, 0) << done.err;
    return done.err;
  };
  EXPECT_EQ(said("200,200,200,20,20,20", "20,20,20,2,2,2"), "");
  EXPECT_EQ(said("200,200,200,20,20,20", "3,3,3,3,3,3"), "");
  EXPECT_EQ(said("3,3,3,0.2,0.2,0.2", "3,3,3,0.3,0.3,0.3"),
            "warning: task stiffness: 3 N/m hardly holds a tip: is it in N/mm?\n");
  EXPECT_EQ(
      run_program(of_panda("audit", {"--joint-stiffness", "600", "--joint-damping", "0.7"})).err,
      "warning: joint damping: 0.7 is little beside a stiffness of 600 N m/rad: is it a "
      "damping ratio?\n");
  EXPECT_THAT(said("200,200,200,20,20,20", "0.7,0.7,0.7,0.7,0.7,0.7"),
              ::testing::HasSubstr("task damping: 0.7 is little beside a stiffness"));
  EXPECT_THAT(said("200,200,200,20,20,20", "0.7,0.7,0.7,1,1,1"),
              ::testing::HasSubstr("a damping ratio?"));
  EXPECT_THAT(said("20,20,20,2000,2000,2000", "20,20,20,2,2,2"),
              ::testing::HasSubstr("task stiffness: 2000 N m/rad against rotation is much"));
  EXPECT_THAT(said("200,200,200,20,20,20", "2,2,2,300,300,300"),
              ::testing::HasSubstr("task damping: 300 N s m/rad against rotation is much"));
}

TEST(Mistakes, OfASimulationThatTheAnalysisDoesNotKnowAreNoted) {
  const Scratch scratch;
  const std::string changed_scene =
      changed(scratch, "iiwa14", "sampled: {delay: 1, difference_velocity: true}", "sampled: {}");
  const std::string said = run_scene(changed_scene, {"--duration", "0.05"}).err;
  EXPECT_THAT(said,
              ::testing::HasSubstr("note: the simulation has properties that analysis.sampled "
                                   "lacks: delay difference_velocity; the sampled modes and "));
  EXPECT_EQ(run_scene(scene("iiwa14"), {"--duration", "0.05"}).err, "");
}

TEST(Mistakes, InUnitsAreNamedWithTheLikelyOne) {
  const Words audit = joined(of_panda("audit", kStiffness), {"--damping-factor", "2"});
  const Words design = joined(of_panda("design", kStiffness), {"--damping-ratio"});
  for (const Words& words : {audit, joined(design, {"1"})}) {
    expect_refusal(run_program(joined(words, {"--period", "1"})),
                   "a period up to 0.1 s is wanted, not '1'; is '1 ms' meant?");
    const Outcome spread = run_program(joined(words, {"--samples", "5", "--spread", "20"}));
    expect_refusal(spread, "is wanted, not '20'; is '20 deg' meant?");
  }
  expect_refusal(run_program(joined(audit, {"--period", "2 s"})), "not '2 s' (dashpot");
  const Outcome heavy = run_program(joined(audit, {"--payload", "800"}));
  EXPECT_EQ(heavy.status, 0);
  EXPECT_THAT(heavy.err, ::testing::HasSubstr("warning: payload: its mass, 800 kg, "));
  EXPECT_THAT(heavy.err, ::testing::HasSubstr(": is it in g, or "));
  EXPECT_EQ(run_program(joined(audit, {"--payload", "0.8"})).err, "");
  EXPECT_THAT(
      run_program(joined(audit, {"--viscous-friction", "100"})).err,
      ::testing::HasSubstr("viscous friction, 100, takes 217.5 N m, its effort limit is 87"));
  expect_refusal(run_program(joined(audit, {"--period", "1ms", "--delay", "2ms"})),
                 "--delay: a whole number of ticks from 0 to 100 is wanted, not '2ms'");
  expect_refusal(run_program(joined(audit, {"--delay", ""})), "from 0 to 100 is wanted, not ''");
  const Outcome fast = run_program(of_panda("inspect", {"--qd", "30,20,20,20,0,0,0"}));
  EXPECT_THAT(fast.err, ::testing::HasSubstr("joint 'panda_joint1' is faster than its limit, 2.1"));
  const Outcome turned = run_program(
      of_panda("audit", {"--stiffness", "20,20,20,600,600,600", "--damping-factor", "2"}));
  EXPECT_THAT(turned.err, ::testing::HasSubstr("warning: task stiffness: 600 N m/rad against "));
  const Outcome percent = run_program(joined(design, {"7"}));
  EXPECT_EQ(percent.status, 0);
  EXPECT_THAT(percent.err, ::testing::HasSubstr("not a percentage: 7 % would be 0.07\n"));
  EXPECT_EQ(run_program(joined(design, {"2"})).err, "");
}

TEST(Mistakes, OfTwoDampingsOrNoneAreTold) {
  const Words audit = of_panda("audit", kStiffness);
  expect_refusal(run_program(audit), "--damping: missing; give it, or --damping-factor");
  expect_refusal(run_program(joined(audit, {"--damping-ratio", "0.7"})),
                 "or --damping-factor; dashpot design finds the damping for a --damping-ratio");
  expect_refusal(run_program(joined(audit, {"--damping", "1,1,1,1,1,1", "--damping-factor", "2"})),
                 "--damping: does not go with --damping-factor");
  expect_refusal(run_program(of_panda("audit", {"--joint-stiffness", "9", "--joint-damping", "1",
                                                "--damping-factor", "2"})),
                 "--joint-damping: does not go with --damping-factor");
}

TEST(Mistakes, OfOneFileForAnotherNameWhatTakesIt) {
  const std::string arm = DASHPOT_SOURCE_DIR "/sim/models/panda.urdf";
  for (const Words& words : {Words{"run", arm},
                             {"analyze", arm},
                             {"tune", arm},
                             {"check-model", "a.csv", "--config", arm},
                             joined(of_panda("audit", {}), {"--gains", arm})}) {
    expect_refusal(run_program(words),
                   ": is XML, such as a robot description, where YAML is wanted: ");
  }
  expect_refusal(
      run_program({"inspect", "--urdf", scene("panda"), "--base", "a", "--tip", "b"}),
      "it contains no XML; a configuration or scene names one under robot.urdf, and is read by ");
  expect_refusal(run_program({"analyze", scene("panda")}),
                 ": is a configuration or scene, which dashpot run, ");
  expect_refusal(run_program({"run", example("chain3.yaml")}),
                 ": is a system of matrices, which dashpot analyze and design take");
}

TEST(Mistakes, DoNotReplaceAConfigurationByATable) {
  const Scratch scratch;
  const std::string config = scratch.write("arm.yaml", "a: 1");
  expect_refusal(run_program(joined(of_panda("audit", kStiffness),
                                    {"--damping-factor", "2", "--samples", "5", "--csv", config})),
                 "--csv: " + config + ": exists, and is not a file of this kind");
  EXPECT_EQ(scratch.read("arm.yaml"), "a: 1");
}

TEST(Mistakes, InKindsOfFilesAreNamed) {
  const Scratch scratch;
  const std::string folder = scratch.path("folder");
  std::filesystem::create_directory(folder);
  for (const Words& words :
       {Words{"export", folder, "--csv", scratch.path("a.csv")}, Words{"monitor", "--log", folder},
        joined(of_panda("audit", kStiffness), {"--damping-factor", "2", "--log", folder})}) {
    const Outcome outcome = run_program(words);
    EXPECT_NE(outcome.status, 0) << words[0];
    EXPECT_THAT(outcome.err, ::testing::HasSubstr("cannot read the log: Is a directory"));
  }
  expect_refusal(run_program({"inspect", "--urdf", scratch.write("a.yaml", "mass: 1"), "--base",
                              "a", "--tip", "b"}),
                 "a.yaml: is not a robot description: it contains no XML");
}

TEST(Mistakes, OfACommandAreNamedBeforeALoopIsAwaited) {
  for (const auto& [words, text] :
       {std::pair(Words{}, "says nothing"),
        {Words{"--payload", "heavy"}, "--payload: "},
        {Words{"--stiffness", "1,2", "--damping-ratio", "1"}, "--stiffness: 2 numbers, expected "},
        {Words{"--tip-position", "1"}, "--tip-position: 1 number, expected 3"}}) {
    expect_refusal(run_program(joined(words.empty() ? Words{"command"} : joined({"command"}, words),
                                      {"--lcm-url", own_url(), "--timeout", "0.01"})),
                   text);
  }
}

/// A file without a line of names is read with what the command says of it.
TEST(Mistakes, OfACheckOfNumbersAloneCanBeMended) {
  const Scratch scratch;
  std::ostringstream text;
  text.precision(12);
  for (int i = 0; i < 4000; ++i) {
    for (int k = 0; k < 7; ++k) text << 0.3 * std::sin(0.001 * i * (k + 3)) << ",";
    for (int k = 0; k < 7; ++k) text << std::cos(0.002 * i * (k + 2)) << (k < 6 ? "," : "\n");
  }
  const Words check = {"check-model", scratch.write("a.csv", text.str()), "--config",
                       scene("panda_release_c1")};
  expect_refusal(run_program(check), "--positions: no columns are known to be");
  std::string names;
  for (const char* name : {"q", "tau"}) {
    for (int k = 1; k <= 7; ++k) {
      names += (names.empty() ? "" : ",") + std::string(name) + std::to_string(k) +
               (name[0] == 'q' ? " [rad]" : " [N m]");
    }
  }
  const Outcome outcome = run_program(joined(check, {"--rate", "1000", "--columns", names}));
  EXPECT_EQ(outcome.status, 0) << outcome.err;
  EXPECT_THAT(outcome.out, ::testing::HasSubstr("s of motion, means over"));
}

// Files that others wrote, or that are named by mistake: the program does not overwrite them, and
// does not print their control characters.

namespace fs = std::filesystem;
using ::testing::HasSubstr;

void expect_one_line(const Outcome& outcome, const std::string& text) {
  EXPECT_EQ(outcome.status, 2) << outcome.err;
  EXPECT_EQ(outcome.out, "");
  EXPECT_EQ(outcome.err, text + "\n");
}

/// Whether all of `text` is shown by a terminal, which does nothing else with it.
bool is_plain(const std::string& text) {
  return std::all_of(text.begin(), text.end(),
                     [](char c) { return c == '\n' || (c >= 0x20 && c < 0x7f); });
}

TEST(RunOutput, OverwritesNoSceneWhateverItIsCalled) {
  const Scratch scratch;
  const std::string path = changed(scratch, "ur5", "../models/", DASHPOT_SOURCE_DIR "/sim/models/");
  const std::string before = scratch.read("scene.yaml");
  fs::create_symlink(path, scratch.path("link"));
  fs::create_hard_link(path, scratch.path("hard"));
  fs::create_directory_symlink(scratch.path(""), scratch.path("again"));
  for (const std::string option : {"--csv", "--log"}) {
    for (const std::string& name :
         {path, scratch.path("link"), scratch.path("hard"), scratch.path("again/scene.yaml"),
          scratch.path("again/./again/scene.yaml")}) {
      expect_one_line(run_scene(path, {option, name}),
                      "dashpot run: " + option + ": is the same file as the scene");
      ASSERT_EQ(scratch.read("scene.yaml"), before) << option << " " << name;
    }
  }
  expect_one_line(run_scene(scratch.path("link"), {"--csv", path}),
                  "dashpot run: --csv: is the same file as the scene");
  expect_one_line(run_scene(path, {"--lcm-url", "file://" + path + "?mode=w"}),
                  "dashpot run: --lcm-url: is the same file as the scene");
  ASSERT_EQ(scratch.read("scene.yaml"), before);
}

TEST(RunOutput, OverwritesNoRobotAndNoOtherOutput) {
  const Scratch scratch;
  const std::string urdf = scratch.write("ur5.urdf", text_of(testing::arm_path("ur5")));
  const std::string path = changed(scratch, "ur5", "../models/ur5.urdf", "ur5.urdf");
  const std::string before = scratch.read("ur5.urdf");
  for (const std::string option : {"--csv", "--log"}) {
    expect_one_line(run_scene(path, {option, urdf}),
                    "dashpot run: " + option + ": is the same file as the robot description");
  }
  EXPECT_EQ(scratch.read("ur5.urdf"), before);

  fs::create_symlink("new", scratch.path("dangling"));
  for (const auto& [log, csv] : {std::pair("new", "new"), {"new", "./new"}, {"new", "dangling"}}) {
    expect_one_line(run_scene(path, {"--log", scratch.path(log), "--csv", scratch.path(csv)}),
                    "dashpot run: --csv: is the same file as --log");
  }
  EXPECT_FALSE(fs::exists(scratch.path("new")));
  expect_one_line(run_scene(path, {"--log", "/dev/null", "--csv", "/dev/null"}),
                  "dashpot run: --csv: is the same file as --log");
}

TEST(DesignOutput, OverwritesNoInput) {
  const Scratch scratch;
  const std::string text = text_of(example("baxter7.yaml"));
  const std::string file = scratch.write("a.yaml", "- " + text);
  fs::create_hard_link(file, scratch.path("hard"));
  for (const std::string& csv : {file, scratch.path("hard")}) {
    expect_one_line(
        run_program({"design", file, "--damping-ratio", "0.7", "--region", "--csv", csv}),
        "dashpot design: --csv: is the same file as FILE");
  }
  EXPECT_EQ(scratch.read("a.yaml"), "- " + text);
}

std::string hinge(const std::string& robot, const std::string& joint, const std::string& tip) {
  return "<robot name='" + robot + "'><link name='base'/><link name='" + tip +
         "'><inertial><mass value='1'/><inertia ixx='1' ixy='0' ixz='0' iyy='1' iyz='0' izz='1'/>"
         "</inertial></link><joint name='" +
         joint + "' type='continuous'><parent link='base'/><child link='" + tip +
         "'/></joint></robot>";
}

TEST(Names, AreShownWithoutSteeringTheTerminal) {
  const Scratch scratch;
  const std::string urdf =
      scratch.write("a.urdf", hinge("r&#27;[2J", "j&#27;]0;x&#7;&#10;y", "tip\u009b31m\u202e"));
  const auto inspect = [&](const std::string& tip) {
    return run_program({"inspect", "--urdf", urdf, "--base", "base", "--tip", tip});
  };
  const Outcome shown = inspect("tip\u009b31m\u202e");
  EXPECT_EQ(shown.status, 0) << shown.err;
  EXPECT_TRUE(is_plain(shown.out)) << shown.out;
  EXPECT_THAT(shown.out, HasSubstr("r\\x1b[2J: 1 joint from base to tip\\u009b31m\\u202e."));
  EXPECT_THAT(shown.out, HasSubstr("j\\x1b]0;x\\x07\\x0ay "));

  const Outcome refused = inspect("\033[2J");
  EXPECT_EQ(refused.status, 2);
  EXPECT_EQ(count_lines(refused.err), 1);
  EXPECT_THAT(refused.err, HasSubstr("link '\\x1b[2J': there is none"));
}

TEST(Names, OfScenesAreShownSoToo) {
  const Scratch scratch;
  changed(scratch, "ur5", "../models/", DASHPOT_SOURCE_DIR "/sim/models/");
  const std::string path = scratch.path("\033[31m\x9b\u009b\n.yaml");
  fs::copy_file(scratch.path("scene.yaml"), path);
  const Outcome shown = run_scene(path, {"--duration", "0.01"});
  EXPECT_EQ(shown.status, 0) << shown.err;
  EXPECT_TRUE(is_plain(shown.out)) << shown.out;
  EXPECT_THAT(shown.out, HasSubstr("\\x1b[31m\\x9b\\u009b\\x0a.yaml: 6 joints"));

  const Outcome object = run_scene(path, {"--duration", "0.01", "--json"});
  EXPECT_EQ(object.status, 0) << object.err;
  EXPECT_TRUE(is_plain(object.out)) << object.out;
  EXPECT_EQ(Json::parse(object.out)["scene"].get<std::string>(),
            scratch.path("\033[31m\ufffd\u009b\n.yaml"));
}

TEST(Inputs, ThatNeverEndOrKeepWaitingAreRefused) {
  const Scratch scratch;
  const std::string pipe = scratch.path("pipe");
  ASSERT_EQ(mkfifo(pipe.c_str(), 0600), 0);
  expect_one_line(run_scene(pipe), "dashpot run: " + pipe + ": is not a regular file");
  expect_one_line(run_scene("/dev/zero"), "dashpot run: /dev/zero: is not a regular file");
  expect_one_line(run_scene(changed(scratch, "ur5", "../models/ur5.urdf", pipe)),
                  "dashpot run: " + scratch.path("scene.yaml") + ": robot: " + pipe +
                      ": cannot be read: not a regular file (line 5)");
  expect_one_line(run_program({"analyze", "/dev/zero"}),
                  "dashpot analyze: /dev/zero: larger than 64 MiB");
}

}  // namespace
}  // namespace dashpot::tests
