// `dashpot run` in real time: beside a bus and whoever listens.
#include <dashpot/tests/apps/scene_run.hpp>
#include <dashpot/tests/support/places.hpp>
#include <dashpot/tests/threads/live_run.hpp>

#include <gmock/gmock.h>

#include <fstream>
#include <thread>

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

}  // namespace
}  // namespace dashpot::tests
