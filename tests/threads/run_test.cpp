// `dashpot run` in real time: beside a bus and whoever listens.
#include <dashpot/tests/apps/run_program.hpp>
#include <dashpot/tests/apps/scene_run.hpp>
#include <dashpot/tests/support/places.hpp>
#include <dashpot/tests/threads/live_run.hpp>

#include <gmock/gmock.h>
#include <csignal>

#include <cmath>
#include <fstream>
#include <string>
#include <thread>
#include <tuple>
#include <utility>

namespace dashpot::tests {
namespace {

using ::testing::HasSubstr;

TEST(RunInRealTime, PublishesStatesAndModesUntilCtrlC) {
  LiveRun live(scene("panda_release_c2"), std::vector<std::string>{});
  if (!live.heard(6)) GTEST_SKIP() << kNoMulticast;
  EXPECT_EQ(live.malformed(), 0);
  EXPECT_EQ(live.state.n, 7);
  EXPECT_EQ(live.state.mode, state_t::CARTESIAN);
  EXPECT_EQ(live.modes.zero_modes, 1);
  EXPECT_EQ(live.modes.num_modes, 6);
  EXPECT_NEAR(static_cast<double>(live.state.utime), static_cast<double>(utime()), 20e6);
  const Json result = live.end(SIGINT);
  EXPECT_EQ(result["interrupted"], true);
  EXPECT_EQ(result["real_time"], true);
  EXPECT_LT(result["ticks"].get<int>(), 60'000);
  EXPECT_EQ(result["messages"]["states"], result["ticks"]);
}

TEST(RunInRealTime, PublishesTheSampledLoop) {
  LiveRun live(scene("panda"), std::vector<std::string>{});
  if (!live.heard()) GTEST_SKIP() << kNoMulticast;
  ASSERT_TRUE(live.until([&] { return live.sampled_messages >= 2; }));
  EXPECT_EQ(live.malformed(), 0);
  const Json result = live.end();
  const sampled_modes_t& sampled = live.sampled;
  EXPECT_EQ(sampled.n, 7);
  EXPECT_EQ(sampled.status, 0);
  EXPECT_LT(sampled.spectral_radius, 1);
  EXPECT_GT(sampled.gain_margin, 1);
  ASSERT_GE(sampled.num_modes, 6);
  for (std::size_t i = 0; i < 6; ++i) {  // a mode that is slow changes little
    if (sampled.continuous_frequency[i] > 30) continue;
    EXPECT_NEAR(sampled.natural_frequency[i], sampled.continuous_frequency[i],
                0.1 * sampled.continuous_frequency[i]);
  }
  EXPECT_GE(result["messages"]["sampled_modes"].get<int>(), 2);
}

TEST(RunInRealTime, DoesNotNoticeWhoListens) {
  LiveRun live(scene("ur5"), {"--duration", "1.5"});
  if (!live.heard()) GTEST_SKIP() << kNoMulticast;
  for (int i = 0; i < 3; ++i) {
    Running monitor({"monitor", "--lcm-url", live.url});
    std::this_thread::sleep_for(std::chrono::milliseconds(150));
    monitor.send(SIGKILL);
    EXPECT_EQ(monitor.finish(), 128 + SIGKILL);
  }
  const Json result = live.end(0);
  EXPECT_EQ(result["ticks"], 1500);
  EXPECT_EQ(result["status"], Json({{"ok", 1500}}));
  EXPECT_EQ(result["messages"]["errors"], 0);
}

/// Waits for the first row of a table that a run writes; false if there is none before a hang is
/// sure.
bool has_a_row(const std::string& csv) {
  const auto end = Clock::now() + kHang;
  while (Clock::now() < end) {
    std::ifstream table(csv);
    std::string heading, row;
    if (std::getline(table, heading) && std::getline(table, row)) return true;
    std::this_thread::sleep_for(std::chrono::milliseconds(10));
  }
  return false;
}

// Whoever takes the processor away for longer than a period makes no tick slower.
TEST(RunInFastMotion, CountsItsOwnComputingAlone) {
  Running run({"run", scene("panda_release_c2"), "--fast", "--duration", "60", "--json"});
  for (int i = 0; i < 100; ++i) {
    run.send(SIGSTOP);
    std::this_thread::sleep_for(std::chrono::milliseconds(2));
    run.send(SIGCONT);
    std::this_thread::sleep_for(std::chrono::milliseconds(5));
  }
  EXPECT_EQ(run.finish(), 0) << run.complaints();
  const Json result = Json::parse(run.output());
  EXPECT_EQ(result["ticks"], 60'000);
  EXPECT_LT(result["overruns"], 35);  // of 100 interruptions, each longer than a period
}

// The releases take long with a period this short; the run itself is over when its table is there.
TEST(RunInFastMotion, EndsItsRingDownOnCtrlC) {
  const Scratch scratch;
  std::string text = text_of(scene("panda_release_c1"));
  text.replace(text.find("../models"), 9, std::string(DASHPOT_SOURCE_DIR) + "/sim/models");
  const std::string control = "control:\n";
  ASSERT_NE(text.find(control), std::string::npos);
  text.insert(text.find(control) + control.size(), "  period: 100 us\n");
  text.insert(text.find(control), "motion: {smoothing: 10 ms}\n");
  const std::string file = scratch.write("slow.yaml", text), csv = scratch.path("states.csv");
  Running run(
      {"run", file, "--fast", "--ring-down", "--duration", "0.0001", "--csv", csv, "--json"});
  ASSERT_TRUE(has_a_row(csv)) << run.complaints();
  run.send(SIGINT);
  EXPECT_EQ(run.finish(), 0) << run.complaints();
  const Json result = Json::parse(run.output());
  EXPECT_EQ(result["ticks"], 1);
  EXPECT_EQ(result["interrupted"], true);
  EXPECT_FALSE(result.contains("ring_down"));
}

TEST(RunInRealTime, LastsAsLongAsItIsTold) {
  Running run({"run", scene("ur5"), "--duration", "2.5", "--lcm-url", own_url()});
  EXPECT_EQ(run.finish(), 0);
  EXPECT_THAT(run.output(), HasSubstr("2500 ticks of 1.00 ms, in real time; "));
}

// `dashpot command` beside a loop that runs.

Outcome command(const LiveRun& live, const Words& words) {
  return run_program(joined(joined({"command"}, words), {"--lcm-url", live.url}));
}

TEST(CommandProgram, MovesAnArmAndSetsItsGains) {
  const Scratch scratch;
  // No fault, also where a busy machine makes the loop slow, and no command that ends by silence or
  // by what the scene has to be done later.
  LiveRun live(changed(
      scratch, "panda_release_c2",
      {{"tip: panda_hand_tcp", "tip: panda_hand_tcp\n  drives: panda"},
       {"scenario:", "commands: {silence: 30 s, oldest: 20 s}\nscenario:"},
       {"control:", "watchdog: {feedback: 0, longest_gap: 1 s}\ncontrol:\n  period: 4 ms"}}));
  if (!live.heard(1)) GTEST_SKIP() << kNoMulticast;
  const Outcome moved = command(
      live, {"--mode", "joint", "--joint-position", "0,-45 deg,0,-135 deg,0,90 deg,40 deg"});
  EXPECT_EQ(moved.out, "accepted\n") << moved.err;
  EXPECT_TRUE(live.until([&] { return std::abs(live.state.joint_position[6] - 0.6981) < 0.01; }))
      << live.state.joint_position[6];
  const Outcome softer =
      command(live, {"--mode", "cartesian", "--stiffness", "200,200,200,10,10,10",
                     "--damping-ratio", "0.9", "--payload", "0 kg"});
  EXPECT_EQ(softer.out, "accepted\n") << softer.err;
  EXPECT_TRUE(live.until([&] {
    return live.modes.num_modes >= 6 && std::abs(live.modes.damping_ratio[0] - 0.9) < 0.05;
  })) << "fault "
      << int{live.state.fault} << ", mode " << int{live.state.mode};
  // A command that the loop refuses is an error of the program, with the number and its limits.
  for (const auto& [option, numbers, reason] :
       {std::tuple("--joint-position", "0,-0.8,0,-2.4,0,1.6,40",
                   "--joint-position is beyond limits.position_lower, _upper, or in deg without"),
        {"--tip-position", "500,0,400",
         "tip_position's distance is 640.312, the limits are 0 to "
         "3: is it in mm?"},
        {"--wrench", "300,0,0,0,0,0", "wrench's force is 300, the limits are -200 to 200"}}) {
    const Outcome far = command(live, {option, numbers});
    EXPECT_EQ(far.status, 1);
    EXPECT_THAT(far.err,
                AllOf(HasSubstr("dashpot command: refused: out of limits: "), HasSubstr(reason)));
  }
  // A command that is likely to be meant otherwise does not reach the loop.
  std::string last;
  for (const int i : {1, 2, 3, 0}) {
    last += (last.empty() ? "" : ",") + std::to_string(live.state.reference_tip_quaternion[i]);
  }
  for (const auto& [words, reason] :
       {std::pair(Words{"--stiffness", "20,20,20,200,200,200", "--damping-ratio", "0.7"},
                  "is much beside 20 N/m against translation, which stands first"),
        {Words{"--stiffness", "400,400,400,20,20,20", "--damping", "0.7,0.7,0.7,1,1,1"},
         "task damping: 0.7 is little beside a stiffness of 400 N/m: is it a damping ratio?"},
        {Words{"--joint-stiffness", "300", "--joint-damping", "0.7"},
         "joint damping: 0.7 is little beside a stiffness of 300 N m/rad"},
        {Words{"--tip-quaternion", last}, "w comes first; --anyway sends it"}}) {
    expect_refusal(command(live, words), reason);
  }
  EXPECT_EQ(
      command(live, {"--stiffness", "20,20,20,200,200,200", "--damping-ratio", "0.7", "--anyway"})
          .out,
      "accepted\n");
  const Outcome soft = command(live, {"--stiffness", "3,3,3,1,1,1", "--damping-ratio", "0.7"});
  EXPECT_EQ(soft.out, "accepted\n") << soft.err;
  EXPECT_THAT(soft.err, HasSubstr("warning: task stiffness: 3 N/m hardly holds a tip"));
  expect_refusal(command(live, {"--release"}), "--release: no fault is latched");
  expect_refusal(command(live, {}), "says nothing");
  expect_refusal(command(live, {"--stiffness", "1,1,1,1,1,1"}),
                 "--stiffness: needs --damping or --damping-ratio");
  expect_refusal(command(live, {"--joint-position", "1,2"}), "2 numbers, expected 7");
  live.end();
}

TEST(CommandProgram, TakesNoOtherCommandForItsOwn) {
  const std::string url = own_url();
  Listener loop(url);  // and, below, a loop that accepts commands, but of somebody else
  state_t state{};
  state.n = 1;
  for (auto* list : {&state.joint_position, &state.joint_velocity, &state.joint_torque,
                     &state.law_torque, &state.reference_joint_position}) {
    list->assign(1, 0);
  }
  state.reference_tip_quaternion[0] = state.tip_quaternion[0] = state.tool_quaternion[0] = 1;
  const auto publish = [&] {
    state.utime = utime();
    ++state.tick;
    state.verdicts[state_t::ACCEPTED] = ++state.commands_accepted;
    loop.bus().publish(lcmtypes::kStateChannel, &state);
  };
  publish();
  if (!loop.until([&] { return loop.states > 0; })) GTEST_SKIP() << kNoMulticast;
  Running program({"command", "--mode", "joint", "--lcm-url", url, "--timeout", "0.5 s"});
  while (!program.ended()) {
    publish();
    usleep(10000);
  }
  EXPECT_EQ(program.finish(), 1) << program.output();
  EXPECT_THAT(program.complaints(), HasSubstr("no answer"));
}

TEST(CommandProgram, IsForOneLoopOnABus) {
  LiveRun one(scene("panda"));
  if (!one.heard()) GTEST_SKIP() << kNoMulticast;
  expect_refusal(run_program({"run", scene("panda"), "--commands", "--lcm-url", one.url}),
                 "--commands: another loop publishes states on this bus");
  Running other({"run", scene("panda"), "--lcm-url", one.url});
  Outcome both;  // the command listens for a tenth of a second, in which one may not get its turn
  EXPECT_TRUE(one.until([&] { return (both = command(one, {"--mode", "joint"})).status == 1; }));
  EXPECT_THAT(both.err, HasSubstr("several loops publish states on " + one.url));
  other.send(SIGTERM);
  other.finish();
  one.end();
}

TEST(CommandProgram, SaysWhereNobodyListens) {
  const std::string url = own_url();
  const Outcome nobody =
      run_program({"command", "--release", "--lcm-url", url, "--timeout", "0.2 s"});
  EXPECT_EQ(nobody.status, 1);
  EXPECT_THAT(nobody.err, HasSubstr("no loop publishes states on " + url));
  LiveRun deaf(scene("panda"), {});
  if (!deaf.heard()) GTEST_SKIP() << kNoMulticast;
  const Outcome ignored = command(deaf, {"--mode", "joint", "--timeout", "0.3 s"});
  EXPECT_EQ(ignored.status, 1);
  EXPECT_THAT(ignored.err, HasSubstr("no answer; does the loop take commands"));
  deaf.end();
}

}  // namespace
}  // namespace dashpot::tests
