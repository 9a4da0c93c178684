// The C interface in real time: no allocation, two threads, several arms.
#include <dashpot/lcmtypes/plugin_publisher.h>
#include <dashpot/lcmtypes/log_file.hpp>
#include <dashpot/lcmtypes/modes_t.hpp>
#include <dashpot/lcmtypes/sampled_modes_t.hpp>
#include <dashpot/lcmtypes/state_t.hpp>
#include <dashpot/tests/plugin/panda_host.hpp>
#include <dashpot/tests/support/count_allocations.hpp>
#include <dashpot/tests/support/places.hpp>
#include <dashpot/tests/threads/live_run.hpp>

#include <gmock/gmock.h>

#include <array>
#include <atomic>
#include <cmath>
#include <limits>
#include <memory>
#include <thread>

namespace dashpot::tests {
namespace {

using ::testing::HasSubstr;

TEST(Plugin, AllocatesNothingInATick) {
  if (!DASHPOT_COUNTS_ALLOCATIONS) GTEST_SKIP() << "the sanitizer owns malloc";
  EXPECT_GE(testing::allocations_of([] { create(panda()); }), 1);
  for (const std::string& mode : {std::string(), std::string(kCartesian)}) {
    Host host(create(panda() + mode + "analysis: {every: 2}\n"), panda_posture());
    std::vector<double> goal = panda_posture();
    const dashpot_setpoint setpoint = host.joint_setpoint(goal);
    dashpot_gains gains = panda_gains();
    Eigen::Matrix<double, 6, 6> K_C = Eigen::Matrix<double, 6, 6>::Identity();
    gains.task_stiffness = K_C.data();
    for (int tick = 0; tick < 500; ++tick) {
      goal[0] = 1e-4 * tick;
      K_C(0, 0) = tick;
      if (tick % 7 == 1) plugin().set_gains(host.controller.get(), &gains);
      if (tick % 11 == 2) plugin().set_setpoint(host.controller.get(), &setpoint);
      ASSERT_EQ(testing::allocations_of([&] { host.tick(tick % 5 == 3 ? &setpoint : nullptr); }), 0)
          << "tick " << tick;
    }
  }
}

/// The other thread sets and reads while the real-time thread runs; what it reads was written by
/// one tick.
TEST(Plugin, ServesTwoThreads) {
  constexpr int kTicks = 3000;
  // However rarely the other thread has its turn, no set-point is too old.
  Host host(create(panda() + "analysis: {every: 4}\n"
                             "watchdog: {setpoint_hold: 0, setpoint_damp: 0, feedback: 0}\n"),
            panda_posture());
  ASSERT_NE(host.controller, nullptr) << plugin().last_error();
  std::vector<std::vector<double>> torques(kTicks + 1);
  std::atomic<bool> running{true};
  std::vector<dashpot_snapshot> snapshots;
  std::atomic<int> modes_read{0};

  std::thread other([&] {
    dashpot_controller* const arm = host.controller.get();
    std::vector<double> goal = panda_posture();
    Eigen::Matrix<double, 7, 7> K = Eigen::Matrix<double, 7, 7>::Identity();
    dashpot_gains gains = panda_gains();
    gains.joint_stiffness = K.data();
    const auto modes = std::make_unique<dashpot_modes>();
    std::uint64_t last = 0;
    for (int round = 0; running.load(); ++round) {
      goal[0] = 0.01 * (round % 10);
      K.diagonal().setConstant(100 + round % 50);
      const dashpot_setpoint setpoint = {sizeof(dashpot_setpoint),
                                         7,
                                         DASHPOT_ON_ARRIVAL,
                                         DASHPOT_MODE_JOINT,
                                         goal.data(),
                                         nullptr,
                                         nullptr,
                                         nullptr};
      EXPECT_EQ(plugin().set_setpoint(arm, &setpoint), DASHPOT_OK);
      EXPECT_EQ(plugin().set_gains(arm, &gains), DASHPOT_OK);
      auto snapshot = sized<dashpot_snapshot>();
      if (plugin().read_snapshot(arm, &snapshot) == DASHPOT_OK) {
        EXPECT_GE(snapshot.tick, last);
        if (snapshot.tick != last) snapshots.push_back(snapshot);
        last = snapshot.tick;
      }
      modes->struct_size = sizeof *modes;
      if (plugin().read_modes(arm, modes.get()) == DASHPOT_OK) ++modes_read;
    }
  });
  for (std::size_t tick = 1; tick <= kTicks; ++tick) {
    EXPECT_LE(host.tick(), DASHPOT_TORQUE_LIMITED);
    torques[tick] = host.torque;
    if (tick % 50 == 0) std::this_thread::yield();
  }
  while (modes_read.load() == 0) std::this_thread::yield();
  running = false;
  other.join();

  EXPECT_FALSE(snapshots.empty());
  for (const dashpot_snapshot& snapshot : snapshots) {
    ASSERT_LE(snapshot.tick, static_cast<std::uint64_t>(kTicks));
    EXPECT_EQ(std::vector<double>(snapshot.torque, snapshot.torque + 7), torques[snapshot.tick]);
  }
}

TEST(Plugin, RunsTwoArmsSideBySide) {
  const std::string ur5 =
      "robot: {urdf: " + urdf_path("ur5.urdf") + ", base: base_link, tip: ee_link}\n";
  const std::vector<double> posture = {0, -1, 1, 0, 1, 0};
  Host alone(create(panda()), panda_posture());
  Host first(create(panda()), panda_posture());
  Host second(create(ur5), posture);
  Host second_alone(create(ur5), posture);
  for (int tick = 0; tick < 50; ++tick) {
    alone.velocity[1] = first.velocity[1] = 0.01 * tick;
    ASSERT_LE(alone.tick(), DASHPOT_TORQUE_LIMITED);
  }
  for (int tick = 0; tick < 50; ++tick) ASSERT_LE(second_alone.tick(), DASHPOT_TORQUE_LIMITED);
  for (int tick = 0; tick < 50; ++tick) {
    first.velocity[1] = 0.01 * tick;
    ASSERT_LE(first.tick(), DASHPOT_TORQUE_LIMITED);
    ASSERT_LE(second.tick(), DASHPOT_TORQUE_LIMITED);
  }
  EXPECT_EQ(first.torque, alone.torque);
  EXPECT_EQ(second.torque, second_alone.torque);
}

// The publisher for hosts of the plugin: what it writes into a log while a loop runs.

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
