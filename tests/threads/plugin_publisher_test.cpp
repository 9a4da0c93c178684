// The publisher for hosts of the plugin: what it writes into a log while a loop runs.
#include <dashpot/lcmtypes/plugin_publisher.h>
#include <dashpot/lcmtypes/log_file.hpp>
#include <dashpot/lcmtypes/modes_t.hpp>
#include <dashpot/lcmtypes/sampled_modes_t.hpp>
#include <dashpot/lcmtypes/state_t.hpp>
#include <dashpot/tests/support/places.hpp>
#include <dashpot/tests/threads/live_run.hpp>

#include <gmock/gmock.h>

#include <array>
#include <cmath>
#include <limits>
#include <thread>

namespace dashpot::tests {
namespace {

using ::testing::HasSubstr;

struct HostDestroy {
  void operator()(dashpot_controller* controller) const { dashpot_destroy(controller); }
  void operator()(dashpot_publisher* publisher) const { dashpot_publisher_destroy(publisher); }
};
using HostedArm = std::unique_ptr<dashpot_controller, HostDestroy>;
using HostPublisher = std::unique_ptr<dashpot_publisher, HostDestroy>;

HostedArm hosted_panda() {
  const std::string folder = std::string(DASHPOT_SOURCE_DIR) + "/controller/examples";
  return HostedArm(dashpot_create_from_text(
      "robot: {urdf: ../../sim/models/panda.urdf, base: panda_link0, tip: panda_hand_tcp}\n"
      "analysis: {sampled: {interval: 50 ms, delay: 1}}\n",
      folder.c_str()));
}

/// The messages of one channel in a log.
template <class Message>
std::vector<Message> logged(const std::string& path, const std::string& channel) {
  std::vector<Message> found;
  lcmtypes::LogFile log(path);
  while (log.read()) {
    const auto& event = log.event();
    if (event.channel != channel) continue;
    found.emplace_back();
    EXPECT_EQ(found.back().decode(event.data.data(), 0, static_cast<int>(event.size)),
              static_cast<int>(event.size));
  }
  return found;
}

TEST(PluginPublisher, PublishesWhatTheLoopFinds) {
  const Scratch scratch;
  const std::string path = scratch.path("arm.lcm");
  const HostedArm arm = hosted_panda();
  ASSERT_TRUE(arm) << dashpot_last_error();
  std::array<double, 7> position = {0, -0.785, 0, -2.356, 0, 1.571, 0.785};
  const std::array<double, 7> velocity{};
  std::array<double, 7> torque{};
  ASSERT_EQ(dashpot_start(arm.get(), position.data(), nullptr), DASHPOT_OK);
  HostPublisher publisher(
      dashpot_publisher_create(arm.get(), ("file://" + path + "?mode=w").c_str()));
  ASSERT_TRUE(publisher) << dashpot_publisher_error();
  const std::int64_t begin = utime();
  constexpr int kTicks = 900;  // sampled modes come once the gains have grown
  int latched = 0;
  for (int tick = 1; tick <= kTicks; ++tick) {
    std::this_thread::sleep_for(std::chrono::milliseconds(1));
    position[0] = 0.001 * std::sin(0.01 * tick);
    if (tick > kTicks - 50) position[0] = std::numeric_limits<double>::quiet_NaN();
    const dashpot_state state = {
        sizeof state, 7, std::int64_t{1'000'000} * tick, position.data(), velocity.data(), nullptr};
    dashpot_output output = {sizeof output, 7, torque.data()};
    ASSERT_GE(dashpot_update(arm.get(), &state, nullptr, &output), DASHPOT_OK);
  }
  publisher.reset();

  const auto states = logged<state_t>(path, "DASHPOT_STATE");
  ASSERT_GT(states.size(), 50u);
  EXPECT_EQ(states.back().tick, kTicks);
  for (std::size_t i = 1; i < states.size(); ++i) ASSERT_GT(states[i].tick, states[i - 1].tick);
  for (const state_t& state : states) {
    EXPECT_EQ(state.n, 7);
    EXPECT_GE(state.utime, begin);
    EXPECT_LE(state.utime, utime());
    if (state.tick <= kTicks - 50) {
      EXPECT_EQ(state.joint_position[0], 0.001 * std::sin(0.01 * static_cast<double>(state.tick)));
    }
    EXPECT_EQ(state.fault_tick == 0, state.fault == DASHPOT_OK);
    if (state.fault != DASHPOT_OK) ++latched;
  }
  EXPECT_GT(latched, 0);
  const auto modes = logged<modes_t>(path, "DASHPOT_MODES");
  ASSERT_FALSE(modes.empty());
  EXPECT_EQ(modes.back().num_modes, 7);
  EXPECT_GE(modes.front().utime, begin - 100'000);
  EXPECT_FALSE(logged<sampled_modes_t>(path, "DASHPOT_SAMPLED_MODES").empty());
}

TEST(PluginPublisher, SaysWhyThereIsNone) {
  EXPECT_EQ(dashpot_publisher_create(nullptr, nullptr), nullptr);
  EXPECT_THAT(dashpot_publisher_error(), HasSubstr("there is no controller"));
  const HostedArm arm = hosted_panda();
  EXPECT_EQ(dashpot_publisher_create(arm.get(), "nowhere"), nullptr);
  EXPECT_THAT(dashpot_publisher_error(), HasSubstr("cannot open the LCM bus nowhere"));
  const Scratch scratch;
  const std::string url = "file://" + scratch.path("empty.lcm") + "?mode=w";
  const HostPublisher publisher(dashpot_publisher_create(arm.get(), url.c_str()));
  EXPECT_TRUE(publisher);
  EXPECT_STREQ(dashpot_publisher_error(), "");
  dashpot_publisher_destroy(nullptr);
}

}  // namespace
}  // namespace dashpot::tests
