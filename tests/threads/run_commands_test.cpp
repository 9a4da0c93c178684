// `dashpot run` with commands over a bus: whose are taken, which gains are, and what releases a
// fault.
#include <dashpot/tests/apps/scene_run.hpp>
#include <dashpot/tests/threads/live_run.hpp>

#include <gmock/gmock.h>

namespace dashpot::tests {
namespace {

using ::testing::HasSubstr;

/// The scene of a Panda with parts of its text replaced, and limits that a busy machine keeps.
std::string patient_scene(const Scratch& scratch, const std::string& from, const std::string& to) {
  return changed(scratch, "panda_release_c2",
                 {{from, to}, {"scenario:", "commands: {silence: 30 s, oldest: 20 s}\nscenario:"}});
}

TEST(RunWithCommands, TakesGoodCommandsAndKeepsTheLastOne) {
  const std::string url = own_url();
  Listener listener(url);
  Running run({"run", scene("panda_release_c2"), "--commands", "--lcm-url", url, "--duration", "60",
               "--json"});
  if (!listener.until([&] { return listener.states > 100; })) {
    GTEST_SKIP() << "multicast does not work on this machine: " << url;
  }
  const command_t good = joint_command(listener.state, 0.1, 1);
  listener.bus().publish(lcmtypes::kCommandChannel, &good);
  EXPECT_TRUE(listener.until([&] { return listener.state.commands_accepted == 1; }));
  // A repetition, one that is not for this robot, one far beyond its limits, and noise.
  listener.bus().publish(lcmtypes::kCommandChannel, &good);
  command_t wrong = joint_command(listener.state, 9, 2);
  listener.bus().publish(lcmtypes::kCommandChannel, &wrong);
  wrong = joint_command(listener.state, 0.3, 3);
  wrong.utime -= 3'600'000'000;
  listener.bus().publish(lcmtypes::kCommandChannel, &wrong);
  const std::vector<std::uint8_t> noise(300, 0x5a);
  listener.bus().publish(lcmtypes::kCommandChannel, noise.data(), 300U);
  EXPECT_TRUE(listener.until([&] { return listener.state.commands_rejected == 4; }));
  EXPECT_EQ(listener.state.commands_accepted, 1);
  // Nobody sends any more, and the robot goes where it was told, without a complaint.
  EXPECT_TRUE(listener.until([&] {
    return listener.state.mode == state_t::JOINT &&
           std::abs(listener.state.reference_joint_position[0] - 0.1) < 1e-9;
  }));
  const std::int64_t tick = listener.state.tick;
  EXPECT_TRUE(listener.until([&] { return listener.state.tick > tick + 2500; }));
  EXPECT_EQ(listener.state.status, 0);  // not stale
  run.send(SIGTERM);
  EXPECT_EQ(run.finish(), 0);
  const Json result = Json::parse(run.output());
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
  EXPECT_EQ(commands["commander"], 0);  // nobody, by now
}

TEST(RunWithCommands, TakesNoCommandsUnlessItIsAskedTo) {
  const std::string url = own_url();
  Listener listener(url);
  Running run({"run", scene("panda_release_c2"), "--lcm-url", url, "--duration", "60", "--json"});
  if (!listener.until([&] { return listener.states > 100; })) {
    GTEST_SKIP() << "multicast does not work on this machine: " << url;
  }
  const std::vector<std::uint8_t> noise(300, 0x5a);
  for (int i = 1; i <= 50; ++i) {
    const command_t good = joint_command(listener.state, 0.1, i);
    listener.bus().publish(lcmtypes::kCommandChannel, &good);
    listener.bus().publish(lcmtypes::kCommandChannel, noise.data(), 300U);
    const std::int64_t tick = listener.state.tick;
    ASSERT_TRUE(listener.until([&] { return listener.state.tick > tick + 10; }));
    for (const std::int64_t count : listener.state.verdicts) ASSERT_EQ(count, 0);
    ASSERT_EQ(listener.state.mode, state_t::CARTESIAN);
  }
  run.send(SIGTERM);
  EXPECT_EQ(run.finish(), 0);
  const Json commands = Json::parse(run.output())["commands"];
  EXPECT_EQ(commands["taken"], false);
  EXPECT_EQ(commands["accepted"], 0);
  EXPECT_EQ(commands["rejected"], 0);
  EXPECT_EQ(commands["last_refusal"], nullptr);
}

TEST(RunWithCommands, ObeysOneSenderAtATime) {
  const std::string url = own_url();
  Listener listener(url);
  const Scratch scratch;
  Running run({"run", patient_scene(scratch, "scenario:", "scenario:"), "--commands", "--lcm-url",
               url, "--duration", "60", "--json"});
  if (!listener.until([&] { return listener.states > 100; })) {
    GTEST_SKIP() << "multicast does not work on this machine: " << url;
  }
  const auto send = [&](std::int64_t sender, double first_joint, std::int64_t sequence,
                        std::int32_t more_parts) {
    command_t command = joint_command(listener.state, first_joint, sequence);
    command.sender = sender;
    command.parts |= more_parts;
    listener.bus().publish(lcmtypes::kCommandChannel, &command);
  };
  EXPECT_EQ(listener.state.commander, 0);
  send(kMe, 0.1, 1, 0);
  ASSERT_TRUE(listener.until([&] { return listener.state.commander == kMe; }));
  constexpr std::int64_t kOther = 43;
  send(kOther, -0.1, 1'000'000, 0);
  ASSERT_TRUE(listener.until([&] { return listener.state.verdicts[state_t::OTHER_SENDER] == 1; }));
  EXPECT_EQ(listener.state.last_refusal, state_t::OTHER_SENDER);
  EXPECT_EQ(listener.state.last_refused_sender, kOther);
  EXPECT_EQ(listener.state.commander, kMe);
  send(kMe, 0.2, 2, command_t::GIVE_UP);
  ASSERT_TRUE(listener.until([&] { return listener.state.commands_accepted == 2; }));
  EXPECT_EQ(listener.state.commander, 0);
  send(kOther, -0.1, 1, 0);
  ASSERT_TRUE(listener.until([&] { return listener.state.commander == kOther; }));
  EXPECT_TRUE(listener.until(
      [&] { return std::abs(listener.state.reference_joint_position[0] + 0.1) < 1e-9; }));
  run.send(SIGTERM);
  EXPECT_EQ(run.finish(), 0);
  const Json commands = Json::parse(run.output())["commands"];
  EXPECT_EQ(commands["commander"], kOther);
  EXPECT_EQ(commands["last_refusal"]["verdict"], "another sender commands");
  EXPECT_EQ(commands["last_refusal"]["sender"], kOther);
}

TEST(RunWithCommands, RefusesGainsThatTheSampledLoopDoesNotBear) {
  const std::string url = own_url();
  Listener listener(url);
  const Scratch scratch;
  Running run({"run", patient_scene(scratch, "scenario:", "scenario:"), "--commands", "--lcm-url",
               url, "--duration", "60", "--json"});
  if (!listener.until([&] { return listener.states > 100 && listener.modes_messages > 0; })) {
    GTEST_SKIP() << "multicast does not work on this machine: " << url;
  }
  command_t command = joint_command(listener.state, 0, 1);
  command.parts = command_t::TASK_GAINS;
  for (std::size_t i = 0; i < 6; ++i) {
    command.directions[i] = 1;
    command.task_stiffness[i][i] = 50000;  // no damping
  }
  listener.bus().publish(lcmtypes::kCommandChannel, &command);
  ASSERT_TRUE(listener.until([&] { return listener.state.verdicts[state_t::UNSTABLE] == 1; }));
  EXPECT_EQ(listener.state.last_refusal, state_t::UNSTABLE);
  EXPECT_EQ(listener.state.commander, 0);
  for (std::size_t i = 0; i < 6; ++i) {
    command.task_stiffness[i][i] = i < 3 ? 500 : 20;
    command.task_damping[i][i] = i < 3 ? 30 : 2;
  }
  command.sequence = 2;
  command.utime = utime();
  listener.bus().publish(lcmtypes::kCommandChannel, &command);
  ASSERT_TRUE(listener.until([&] { return listener.state.commands_accepted == 1; }));
  // They are in force, once they have blended over.
  const double before = listener.modes.natural_frequency.at(0);
  EXPECT_TRUE(
      listener.until([&] { return listener.modes.natural_frequency.at(0) < 0.8 * before; }));
  run.send(SIGTERM);
  EXPECT_EQ(run.finish(), 0);
  const Json result = Json::parse(run.output());
  const std::string reason = result["commands"]["last_refusal"]["reason"];
  EXPECT_THAT(reason, HasSubstr("refused by the controller: "));
  EXPECT_THAT(reason, HasSubstr("margin"));
}

TEST(RunWithCommands, HoldsARatioCarriesAPayloadAndLowersTheTipsSpeed) {
  const std::string url = own_url();
  Listener listener(url);
  const Scratch scratch;
  Running run({"run", patient_scene(scratch, "scenario:", "scenario:"), "--commands", "--lcm-url",
               url, "--duration", "60", "--json"});
  if (!listener.until([&] { return listener.states > 100 && listener.modes_messages > 0; })) {
    GTEST_SKIP() << "multicast does not work on this machine: " << url;
  }
  EXPECT_EQ(listener.state.task_damping_ratio, 0);
  command_t command = joint_command(listener.state, 0, 1);
  command.parts = int{command_t::TASK_RATIO} + int{command_t::PAYLOAD} + int{command_t::TIP_SPEED};
  command.task_damping_ratio = 0.6;
  command.payload_mass = 0.5;
  command.payload_center[2] = 0.05;
  command.linear_velocity = 0.1;
  listener.bus().publish(lcmtypes::kCommandChannel, &command);
  ASSERT_TRUE(listener.until([&] { return listener.state.commands_accepted == 1; }));
  ASSERT_TRUE(listener.until([&] {
    return listener.state.task_damping_ratio == 0.6 && listener.state.payload_mass == 0.5;
  }));
  EXPECT_NEAR(listener.state.payload_center[2], 0.05, 1e-12);
  const std::int64_t told = listener.state.tick;
  ASSERT_TRUE(listener.until([&] { return listener.modes.tick > told + 10; }));
  // The scene's springs leave no direction of the tip free: six modes are the task's.
  int with_ratio = 0;
  for (const double ratio : listener.modes.damping_ratio) {
    if (std::abs(ratio - 0.6) < 1e-3) ++with_ratio;
  }
  EXPECT_EQ(with_ratio, 6);
  // A body that cannot be is refused, with the gains beside it.
  command.parts = int{command_t::TASK_RATIO} + int{command_t::PAYLOAD};
  command.task_damping_ratio = 0.9;
  command.payload_inertia[0][0] = 0.4;
  command.sequence = 2;
  command.utime = utime();
  listener.bus().publish(lcmtypes::kCommandChannel, &command);
  ASSERT_TRUE(listener.until([&] { return listener.state.verdicts[state_t::UNSTABLE] == 1; }));
  const std::int64_t refused = listener.state.tick;
  ASSERT_TRUE(listener.until([&] { return listener.state.tick > refused + 600; }));
  EXPECT_EQ(listener.state.task_damping_ratio, 0.6);
  EXPECT_EQ(listener.state.payload_mass, 0.5);
  run.send(SIGTERM);
  EXPECT_EQ(run.finish(), 0);
  EXPECT_THAT(Json::parse(run.output())["commands"]["last_refusal"]["reason"],
              HasSubstr("refused by the controller: payload: "));
}

TEST(RunWithCommands, IsReleasedFromAFaultThatIsNamed) {
  const std::string url = own_url();
  Listener listener(url);
  const Scratch scratch;
  // A joint that may hardly move, and a push that moves it.
  const std::string file =
      patient_scene(scratch, "scenario:",
                    "limits: {velocity: 0.4 rad/s}\nscenario:\n"
                    "  pushes: [{begin: 1 s, end: 1.1 s, wrench: [60 N, 60 N, 0, 0, 0, 0]}]");
  Running run({"run", file, "--commands", "--lcm-url", url, "--duration", "60", "--json"});
  if (!listener.until([&] { return listener.states > 100; })) {
    GTEST_SKIP() << "multicast does not work on this machine: " << url;
  }
  ASSERT_TRUE(listener.until([&] { return listener.state.fault != 0; }));
  const std::int64_t fault_tick = listener.state.fault_tick;
  EXPECT_GT(fault_tick, 0);
  EXPECT_LE(fault_tick, listener.state.tick);
  const auto release = [&](std::int64_t named, std::int64_t sequence) {
    command_t command = joint_command(listener.state, 0, sequence);
    command.parts = command_t::RELEASE;
    command.fault_tick = named;
    listener.bus().publish(lcmtypes::kCommandChannel, &command);
  };
  release(fault_tick - 1, 1);
  ASSERT_TRUE(listener.until([&] { return listener.state.verdicts[state_t::NO_SUCH_FAULT] == 1; }));
  EXPECT_NE(listener.state.fault, 0);
  // Once the arm is at rest the cause is over.
  const std::int64_t tick = listener.state.tick;
  ASSERT_TRUE(listener.until([&] { return listener.state.tick > tick + 1500; }));
  ASSERT_EQ(listener.state.fault_tick, fault_tick);
  release(fault_tick, 2);
  ASSERT_TRUE(listener.until([&] { return listener.state.fault == 0; }))
      << "fault " << int{listener.state.fault} << " since tick " << listener.state.fault_tick
      << ", before " << fault_tick << ", accepted " << listener.state.commands_accepted;
  EXPECT_EQ(listener.state.fault_tick, 0);
  // It is held where it is, and does not go back by itself.
  const std::vector<double> where = listener.state.joint_position;
  const std::int64_t released = listener.state.tick;
  ASSERT_TRUE(listener.until([&] { return listener.state.tick > released + 1000; }));
  EXPECT_EQ(listener.state.fault, 0);
  for (std::size_t i = 0; i < where.size(); ++i) {
    EXPECT_NEAR(listener.state.joint_position[i], where[i], 0.02) << i;
  }
  // The same again finds nothing to release, and a set-point is followed.
  release(fault_tick, 3);
  ASSERT_TRUE(listener.until([&] { return listener.state.verdicts[state_t::NO_SUCH_FAULT] == 2; }));
  const command_t goal = joint_command(listener.state, where[0] + 0.05, 4);
  listener.bus().publish(lcmtypes::kCommandChannel, &goal);
  EXPECT_TRUE(listener.until([&] {
    return listener.state.mode == state_t::JOINT &&
           std::abs(listener.state.reference_joint_position[0] - where[0] - 0.05) < 1e-9;
  }));
  run.send(SIGTERM);
  EXPECT_EQ(run.finish(), 0);
  const Json result = Json::parse(run.output());
  EXPECT_GE(result["faults"].get<int>(), 1);
  EXPECT_EQ(result["fault"], nullptr);
}

}  // namespace
}  // namespace dashpot::tests
