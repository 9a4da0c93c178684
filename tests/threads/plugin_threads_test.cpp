// The C interface in real time: no allocation, two threads, several arms.
#include <dashpot/tests/plugin/panda_host.hpp>
#include <dashpot/tests/support/count_allocations.hpp>

#include <gmock/gmock.h>

#include <atomic>
#include <memory>
#include <thread>

namespace dashpot::tests {
namespace {

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

}  // namespace
}  // namespace dashpot::tests
