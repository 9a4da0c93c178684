// What update() never does: allocate, call the system, or put out a torque above its limits.
#include <dashpot/tests/support/arms.hpp>
#include <dashpot/tests/support/count_allocations.hpp>
#include <dashpot/tests/support/hostile_ticks.hpp>
#include <dashpot/tests/support/random_robot.hpp>

#include <gtest/gtest.h>
#include <linux/seccomp.h>
#include <sys/prctl.h>
#include <sys/syscall.h>
#include <sys/wait.h>
#include <unistd.h>

#include <csignal>
#include <set>

namespace dashpot::controller {
namespace {

using testing::allocations_of;
using testing::HostileTicks;
using testing::panda_model;

TEST(Realtime, UpdateNeverAllocates) {
  if (!DASHPOT_COUNTS_ALLOCATIONS) GTEST_SKIP() << "the sanitizer owns malloc";
  const RobotModel model = panda_model();
  Settings settings = HostileTicks::everything_on(model);
  settings.task_terms = {Load::kToolWrench, true};
  Controller controller(model, settings);
  HostileTicks input(model, settings, 341, 0.02);
  JointVector torque;
  static_assert(noexcept(controller.update(input.state, input.setpoint, torque)));
  const int count = allocations_of([&] {
    for (int k = 0; k < 1'000'000; ++k) {
      input.next();
      if (input.releases()) controller.release();
      controller.update(input.state, input.setpoint, torque);
    }
    controller.reset();
  });
  EXPECT_EQ(count, 0);
  EXPECT_GT(controller.snapshot().tick + 1, 0u);
}

/// With the spectrum in every tick, followed and solved directly, and on a thread.
TEST(Realtime, AnalysisNeverAllocates) {
  if (!DASHPOT_COUNTS_ALLOCATIONS) GTEST_SKIP() << "the sanitizer owns malloc";
  const RobotModel model = panda_model();
  for (const Analysis::Where where : {Analysis::Where::kInline, Analysis::Where::kBackground}) {
    Settings settings = HostileTicks::everything_on(model);
    settings.analysis.where = where;
    settings.analysis.every = 1;
    Controller controller(model, settings);
    HostileTicks input(model, settings, 344, 0.001);
    JointVector torque;
    const int count = allocations_of([&] {
      for (int k = 0; k < 200'000; ++k) {
        input.next();
        if (input.releases()) controller.release();
        controller.update(input.state, input.setpoint, torque);
      }
    });
    EXPECT_EQ(count, 0);
    if (where != Analysis::Where::kInline) continue;
    const VibrationCounters& counters = controller.vibration().counters;
    EXPECT_GT(counters.tracked, 25'000u);
    EXPECT_GT(counters.direct, 100u);
  }
}

TEST(Realtime, HostileInputNeverGivesHostileTorque) {
  std::set<Status> seen;
  for (const int n : {1, 2, 6, 7, 11, 16}) {
    SCOPED_TRACE(n);
    const RobotModel model =
        n == 7 ? panda_model()
               : RobotModel::from_urdf_text(
                     testing::RandomRobot(static_cast<unsigned>(n)).chain(n, 0.2), "link0", "tip");
    const Settings settings = HostileTicks::everything_on(model);
    Controller controller(model, settings);
    HostileTicks input(model, settings, 342, 0.01);
    testing::TorqueWatch watch(settings);
    JointVector torque;
    for (int k = 0; k < 50'000; ++k) {
      input.next();
      if (input.releases()) controller.release();
      seen.insert(controller.update(input.state, input.setpoint, torque));
      ASSERT_STREQ(watch.see(torque), nullptr) << "tick " << k;
    }
  }
  // All but what needs a setting (kCollision, kWall, kLittleMargin), a robot that is not there
  // (kInstability, kStateFrozen, kStateContradictory), or is not reached by finite input within its
  // limits.
  for (int i = 0; i < static_cast<int>(Status::kNotFinite); ++i) {
    const auto status = static_cast<Status>(i);
    const bool rare = status == Status::kCollision || status == Status::kWall ||
                      status == Status::kLittleMargin || status == Status::kInstability ||
                      status == Status::kStateFrozen || status == Status::kStateContradictory ||
                      status == Status::kWrongRate || status == Status::kTooManyRestarts;
    EXPECT_TRUE(rare || seen.count(status) > 0) << to_text(status);
  }
}

/// Signal that ended a process in which only read, write and exit are allowed while `act` runs; 0
/// if none did.
template <class Act>
int signal_without_system_calls(const Act& act) {
  const pid_t child = fork();
  if (child == 0) {
    if (prctl(PR_SET_SECCOMP, SECCOMP_MODE_STRICT) != 0) _exit(2);
    act();
    syscall(SYS_exit, 0);
  }
  int status = 0;
  waitpid(child, &status, 0);
  if (WIFEXITED(status) && WEXITSTATUS(status) == 2) return -1;
  return WIFSIGNALED(status) ? WTERMSIG(status) : 0;
}

TEST(Realtime, UpdateMakesNoSystemCall) {
  if (!DASHPOT_COUNTS_ALLOCATIONS) GTEST_SKIP() << "sanitizers call the system";
  const int forbidden = signal_without_system_calls([] { getppid(); });
  if (forbidden == -1) GTEST_SKIP() << "no seccomp here";
  ASSERT_EQ(forbidden, SIGKILL);  // the trap works
  const RobotModel model = panda_model();
  // The thread that analyses in the background stays behind in the parent process.
  for (const Analysis::Where where : {Analysis::Where::kInline, Analysis::Where::kBackground}) {
    Settings settings = HostileTicks::everything_on(model);
    settings.analysis.where = where;
    settings.analysis.every = 1;
    Controller controller(model, settings);
    HostileTicks input(model, settings, 343, 0.02);
    JointVector torque;
    EXPECT_EQ(signal_without_system_calls([&] {
                for (int k = 0; k < 100'000; ++k) {
                  input.next();
                  if (input.releases()) controller.release();
                  controller.update(input.state, input.setpoint, torque);
                }
              }),
              0);
  }
}

}  // namespace
}  // namespace dashpot::controller
