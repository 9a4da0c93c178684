// update() never allocates, calls the system, or puts out a torque above its limits.
#include <dashpot/controller/dynamics.hpp>
#include <dashpot/tests/support/arms.hpp>
#include <dashpot/tests/support/count_allocations.hpp>
#include <dashpot/tests/support/hostile_ticks.hpp>
#include <dashpot/tests/support/random.hpp>
#include <dashpot/tests/support/random_robot.hpp>

#include <gtest/gtest.h>
#include <linux/seccomp.h>
#include <sys/prctl.h>
#include <sys/syscall.h>
#include <sys/wait.h>
#include <unistd.h>

#include <csignal>
#include <optional>
#include <set>

namespace dashpot::controller {
namespace {

using testing::allocations_of;
using testing::HostileTicks;
using testing::panda_model;

/// A Panda with every feature on, driven by hostile ticks.
struct DrivenPanda {
  RobotModel model = panda_model();
  Settings settings = HostileTicks::everything_on(model);
  std::optional<Controller> controller;
  std::optional<HostileTicks> input;
  bool switches;  ///< the projector, every 300 ticks
  JointVector torque;

  DrivenPanda(Analysis::Where where, int every, double share, bool switches = false)
      : switches(switches) {
    settings.analysis.where = where;
    settings.analysis.every = every;
    if (every > 1) settings.task_terms = {Load::kToolWrench, true};
    controller.emplace(model, settings);
    input.emplace(model, settings, 341, share);
  }
  void run(int ticks) {
    static_assert(noexcept(controller->update(input->state, input->setpoint, torque)));
    for (int k = 0; k < ticks; ++k) {
      input->next();
      const auto switched = static_cast<std::size_t>(k / 300) % kNullProjectors.size();
      if (switches) input->setpoint.gains.null_projector = kNullProjectors[switched].second;
      if (input->releases()) controller->release();
      controller->update(input->state, input->setpoint, torque);
    }
  }
};

TEST(Realtime, UpdateNeverAllocates) {
  if (!DASHPOT_COUNTS_ALLOCATIONS) GTEST_SKIP() << "the sanitizer owns malloc";
  EXPECT_GE(allocations_of([] { ::operator delete(::operator new(100)); }), 1);
  DrivenPanda arm(Analysis::Where::kInline, 100, 0.02);
  EXPECT_EQ(allocations_of([&] { arm.run(150'000), arm.controller->reset(); }), 0);
  DrivenPanda other(Analysis::Where::kInline, 10, 0.02, true);
  EXPECT_EQ(allocations_of([&] { other.run(40'000); }), 0);
}

/// With the spectrum in every tick, followed and solved directly, and on a thread.
TEST(Realtime, AnalysisNeverAllocates) {
  if (!DASHPOT_COUNTS_ALLOCATIONS) GTEST_SKIP() << "the sanitizer owns malloc";
  for (const Analysis::Where where : {Analysis::Where::kInline, Analysis::Where::kBackground}) {
    DrivenPanda arm(where, 1, 0.001);
    EXPECT_EQ(allocations_of([&] { arm.run(50'000); }), 0);
    if (where != Analysis::Where::kInline) continue;
    EXPECT_GT(arm.controller->vibration().counters.tracked, 6'000u);
    EXPECT_GT(arm.controller->vibration().counters.direct, 25u);
  }
}

TEST(Realtime, DynamicsNeverAllocate) {
  if (!DASHPOT_COUNTS_ALLOCATIONS) GTEST_SKIP() << "the sanitizer owns malloc";
  testing::Random random(751);
  for (int n = 1; n <= kMaxJoints; ++n) {
    const DynamicsKernel kernel(RobotModel::from_urdf_text(
        testing::RandomRobot(random.engine()()).chain(n, 0.3), "link0", "tip"));
    const JointVector q = random.vector(n), qd = random.vector(n), far = 1e9 * q;
    DynamicsResult result;
    static_assert(noexcept(kernel.evaluate(q, qd, result)));
    const auto evaluate_both = [&] {
      kernel.evaluate(q, qd, result);
      kernel.evaluate(far, qd, result);
    };
    EXPECT_EQ(allocations_of(evaluate_both), 0) << n;
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
    for (int k = 0; k < 30'000; ++k) {
      input.next();
      if (input.releases()) controller.release();
      seen.insert(controller.update(input.state, input.setpoint, torque));
      ASSERT_STREQ(watch.see(torque), nullptr) << "tick " << k;
    }
  }
  // All statuses, except those that need a setting (kCollision, kWall, kLittleMargin) or a missing
  // robot (kInstability, kStateFrozen, kStateContradictory), or that finite input within its limits
  // does not reach.
  const std::set<Status> rare = {Status::kCollision,    Status::kWall,
                                 Status::kLittleMargin, Status::kInstability,
                                 Status::kStateFrozen,  Status::kStateContradictory,
                                 Status::kWrongRate,    Status::kTooManyRestarts};
  for (int i = 0; i < static_cast<int>(Status::kNotFinite); ++i) {
    const auto status = static_cast<Status>(i);
    EXPECT_TRUE(rare.count(status) + seen.count(status) > 0) << to_text(status);
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
  // The thread that analyses in the background stays behind in the parent process.
  for (const Analysis::Where where : {Analysis::Where::kInline, Analysis::Where::kBackground}) {
    DrivenPanda arm(where, 1, 0.02);
    EXPECT_EQ(signal_without_system_calls([&] { arm.run(25'000); }), 0);
  }
}

}  // namespace
}  // namespace dashpot::controller
