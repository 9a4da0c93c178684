// `dashpot run` with commands over a bus: whose are taken, which gains are, and what releases a
// fault.
#include <dashpot/tests/apps/scene_run.hpp>
#include <dashpot/tests/threads/live_run.hpp>

#include <gmock/gmock.h>

#include <cmath>

namespace dashpot::tests {
namespace {

using ::testing::HasSubstr;

/// The scene of a Panda with parts of its text replaced, and limits that a busy machine keeps.
std::string patient_scene(const Scratch& scratch, const std::string& from, const std::string& to) {
  return changed(scratch, "panda_release_c2",
                 {{from, to}, {"scenario:", "commands: {silence: 30 s, oldest: 20 s}\nscenario:"}});
}

TEST(RunWithCommands, TakesGoodCommandsAndKeepsTheLastOne) {
  LiveRun live(scene("panda_release_c2"));
  if (!live.heard()) GTEST_SKIP() << kNoMulticast;
  const command_t good = joint_command(live.state, 0.1, 1);
  live.publish(good);
  EXPECT_TRUE(live.until([&] { return live.state.commands_accepted == 1; }));
  EXPECT_EQ(live.state.commander, kMe);
  // A repetition, one that is not for this robot, one far beyond its limits, and noise.
  live.publish(good);
  command_t wrong = joint_command(live.state, 9, 2);
  live.publish(wrong);
  wrong = joint_command(live.state, 0.3, 3);
  wrong.utime -= 3'600'000'000;
  live.publish(wrong);
  const std::vector<std::uint8_t> noise(300, 0x5a);
  live.bus().publish(lcmtypes::kCommandChannel, noise.data(), 300U);
  EXPECT_TRUE(live.until([&] { return live.state.commands_rejected == 4; }));
  EXPECT_EQ(live.state.commands_accepted, 1);
  // No more commands come, and the robot goes to its last goal, without a complaint.
  EXPECT_TRUE(live.until([&] {
    return live.state.mode == state_t::JOINT &&
           std::abs(live.state.reference_joint_position[0] - 0.1) < 1e-9;
  }));
  EXPECT_TRUE(live.passed(1500));
  EXPECT_EQ(live.state.status, 0);  // not stale
  const Json result = live.end();
  const Json& commands = result["commands"];
  EXPECT_EQ(commands["taken"], true);
  EXPECT_EQ(commands["accepted"], 1);
  EXPECT_EQ(commands["rejected"], 4);
  EXPECT_EQ(commands["verdicts"], Json({{"accepted", 1},
                                        {"replayed or out of order", 1},
                                        {"out of limits", 1},
                                        {"too old", 1},
                                        {"not the bytes of a command", 1}}));
  EXPECT_EQ(commands["last_refusal"]["verdict"], "not the bytes of a command");
  EXPECT_EQ(commands["last_refusal"]["sender"], 0);
  EXPECT_EQ(commands["commander"], 0);  // none, by now
}

TEST(RunWithCommands, TakesNoCommandsUnlessItIsAskedTo) {
  LiveRun live(scene("panda_release_c2"), std::vector<std::string>{});
  if (!live.heard()) GTEST_SKIP() << kNoMulticast;
  const std::vector<std::uint8_t> noise(300, 0x5a);
  for (int i = 1; i <= 50; ++i) {
    const command_t good = joint_command(live.state, 0.1, i);
    live.publish(good);
    live.bus().publish(lcmtypes::kCommandChannel, noise.data(), 300U);
    ASSERT_TRUE(live.passed(10));
    for (const std::int64_t count : live.state.verdicts) ASSERT_EQ(count, 0);
    ASSERT_EQ(live.state.mode, state_t::CARTESIAN);
  }
  const Json commands = live.end()["commands"];
  EXPECT_EQ(commands["taken"], false);
  EXPECT_EQ(commands["accepted"], 0);
  EXPECT_EQ(commands["rejected"], 0);
  EXPECT_EQ(commands["last_refusal"], nullptr);
}

TEST(RunWithCommands, HoldsARatioCarriesAPayloadAndLowersTheTipsSpeed) {
  const Scratch scratch;
  LiveRun live(patient_scene(scratch, "scenario:", "scenario:"));
  if (!live.heard(1)) GTEST_SKIP() << kNoMulticast;
  EXPECT_EQ(live.state.task_damping_ratio, 0);
  command_t command = joint_command(live.state, 0, 1);
  command.parts = int{command_t::TASK_RATIO} + int{command_t::PAYLOAD} + int{command_t::TIP_SPEED};
  command.task_damping_ratio = 0.6;
  command.payload_mass = 0.5;
  command.payload_center[2] = 0.05;
  command.linear_velocity = 0.1;
  live.publish(command);
  ASSERT_TRUE(live.until([&] { return live.state.commands_accepted == 1; }));
  ASSERT_TRUE(live.until(
      [&] { return live.state.task_damping_ratio == 0.6 && live.state.payload_mass == 0.5; }));
  EXPECT_NEAR(live.state.payload_center[2], 0.05, 1e-12);
  const std::int64_t told = live.state.tick;
  ASSERT_TRUE(live.until([&] { return live.modes.tick > told + 10; }));
  // The scene's springs leave no direction of the tip free: six modes are the task's.
  int with_ratio = 0;
  for (const double ratio : live.modes.damping_ratio) {
    if (std::abs(ratio - 0.6) < 1e-3) ++with_ratio;
  }
  EXPECT_EQ(with_ratio, 6);
  // A body that cannot be is refused, with the gains beside it.
  command.parts = int{command_t::TASK_RATIO} + int{command_t::PAYLOAD};
  command.task_damping_ratio = 0.9;
  command.payload_inertia[0][0] = 0.4;
  command.sequence = 2;
  command.utime = utime();
  live.publish(command);
  ASSERT_TRUE(live.until([&] { return live.state.verdicts[state_t::UNSTABLE] == 1; }));
  ASSERT_TRUE(live.passed(600));
  EXPECT_EQ(live.state.task_damping_ratio, 0.6);
  EXPECT_EQ(live.state.payload_mass, 0.5);
  EXPECT_THAT(live.end()["commands"]["last_refusal"]["reason"],
              HasSubstr("refused by the controller: payload: "));
}

TEST(RunWithCommands, IsReleasedFromAFaultThatIsNamed) {
  const Scratch scratch;
  // A joint that may hardly move, and a push that moves it.
  const std::string file =
      patient_scene(scratch, "scenario:",
                    "limits: {velocity: 0.4 rad/s}\nscenario:\n"
                    "  pushes: [{begin: 0.6 s, end: 0.7 s, wrench: [60 N, 60 N, 0, 0, 0, 0]}]");
  LiveRun live(file);
  if (!live.heard()) GTEST_SKIP() << kNoMulticast;
  ASSERT_TRUE(live.until([&] { return live.state.fault != 0; }));
  const std::int64_t fault_tick = live.state.fault_tick;
  EXPECT_GT(fault_tick, 0);
  EXPECT_LE(fault_tick, live.state.tick);
  const auto release = [&](std::int64_t named, std::int64_t sequence) {
    command_t command = joint_command(live.state, 0, sequence);
    command.parts = command_t::RELEASE;
    command.fault_tick = named;
    live.publish(command);
  };
  release(fault_tick - 1, 1);
  ASSERT_TRUE(live.until([&] { return live.state.verdicts[state_t::NO_SUCH_FAULT] == 1; }));
  EXPECT_NE(live.state.fault, 0);
  // Once the arm is at rest the cause is over.
  ASSERT_TRUE(live.passed(1500));
  ASSERT_EQ(live.state.fault_tick, fault_tick) << int{live.state.fault};
  release(fault_tick, 2);
  ASSERT_TRUE(live.until([&] { return live.state.fault == 0; }))
      << "fault " << int{live.state.fault} << " since tick " << live.state.fault_tick << ", before "
      << fault_tick << ", accepted " << live.state.commands_accepted;
  EXPECT_EQ(live.state.fault_tick, 0);
  // It is held where it is, and does not go back by itself.
  const std::vector<double> where = live.state.joint_position;
  ASSERT_TRUE(live.passed(400));
  EXPECT_EQ(live.state.fault, 0);
  for (std::size_t i = 0; i < where.size(); ++i) {
    EXPECT_NEAR(live.state.joint_position[i], where[i], 0.02) << i;
  }
  // A second release finds nothing to release, and a set-point is followed.
  release(fault_tick, 3);
  ASSERT_TRUE(live.until([&] { return live.state.verdicts[state_t::NO_SUCH_FAULT] == 2; }));
  const command_t goal = joint_command(live.state, where[0] + 0.05, 4);
  live.publish(goal);
  EXPECT_TRUE(live.until([&] {
    return live.state.mode == state_t::JOINT &&
           std::abs(live.state.reference_joint_position[0] - where[0] - 0.05) < 1e-9;
  }));
  const Json result = live.end();
  EXPECT_GE(result["faults"].get<int>(), 1);
  EXPECT_EQ(result["fault"], nullptr);
}

/// A scenario's tip targets refer to the configuration's T, also after commands have changed T.
TEST(RunWithCommands, GoesWhereTheScenarioWantsTheTipLinkWithAnotherTool) {
  const Scratch scratch;
  const std::string file =
      patient_scene(scratch, "tip_displacement: [0, 2 cm, 0, 0, 0, 0]",
                    "tip_displacement: [0, 0, 0, 0, 0, 0]\n  steps:\n    - at: 2 s\n      "
                    "tip_displacement: [0, 3 cm, 0, 0, 0, 0]");
  LiveRun live(file);
  if (!live.heard()) GTEST_SKIP() << kNoMulticast;
  const state_t start = live.state;
  command_t command = joint_command(start, 0, 1);
  command.parts = command_t::TOOL_FRAME;
  command.tool_position[2] = 0.1;
  command.tool_quaternion[0] = 1;
  live.publish(command);
  ASSERT_TRUE(live.until([&] { return live.state.tool_position[2] == 0.1; }));
  const auto y = [&] { return live.state.reference_tip_position[1] - start.tip_position[1]; };
  EXPECT_TRUE(live.until([&] { return std::abs(y() - 0.03) < 1e-9; })) << y();
  // The tool points downward, as far as the tip link does.
  EXPECT_NEAR(live.state.reference_tip_position[2], start.tip_position[2] - 0.1, 1e-4);
  live.end();
}

}  // namespace
}  // namespace dashpot::tests
