// Files that others wrote, or that are named by mistake: the program does not overwrite them, and
// does not print their control characters.
#include <dashpot/tests/apps/scene_run.hpp>
#include <dashpot/tests/support/arms.hpp>

#include <gmock/gmock.h>
#include <sys/stat.h>

#include <filesystem>

namespace dashpot::tests {
namespace {

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
