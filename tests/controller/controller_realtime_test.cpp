// update() never allocates, calls the system, or puts out a torque above its limits.
#include <dashpot/controller/dynamics.hpp>
#include <dashpot/controller/vibration/vibration.hpp>
#include <dashpot/tests/support/arms.hpp>
#include <dashpot/tests/support/count_allocations.hpp>
#include <dashpot/tests/support/hostile_ticks.hpp>
#include <dashpot/tests/support/led_arm.hpp>
#include <dashpot/tests/support/random.hpp>
#include <dashpot/tests/support/random_robot.hpp>

#include <gtest/gtest.h>
#include <sys/prctl.h>
#include <sys/syscall.h>
#include <sys/wait.h>
#include <unistd.h>
#include <csignal>

#include <linux/seccomp.h>
#include <algorithm>
#include <cmath>
#include <limits>
#include <optional>
#include <set>

namespace dashpot::controller {
namespace {

using testing::allocations_of;
using testing::HostileTicks;
using testing::LedArm;
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

// Terms that a tick leaves out because they are zero, beside an input next to zero, with which
// nothing may be left out: the same torques and modes.

/// Not zero, but without effect.
constexpr double kTiny = std::numeric_limits<double>::denorm_min();

struct LeftOut {
  const char* what;
  void (*settings)(Settings& lean, Settings& full);
  void (*full)(LedArm& arm, int tick);        ///< what the second arm gets
  std::uint64_t VibrationCounters::*counter;  ///< of the first; null: it is left out at every tick
  bool still = false;                         ///< both arms report no velocity
};
void PrintTo(const LeftOut& term, std::ostream* out) {
  *out << term.what;
}

/// The rotation of the null space only counts with a load, or under way.
void free_posture(Settings& settings) {
  settings.initial.gains.null_stiffness.setZero();
  settings.initial.gains.null_damping.setZero();
}
void free_postures(Settings& lean, Settings& full) {
  free_posture(lean);
  free_posture(full);
}

const LeftOut kTerms[] = {
    {"K_G without a wrench",
     [](Settings& lean, Settings& full) {
       free_postures(lean, full);
       lean.task_terms.load = full.task_terms.load = Load::kJointTorques;
     },
     [](LedArm& arm, int) { arm.state.external_wrench[2] = kTiny; }, &VibrationCounters::no_wrench},
    {"J' C_C Jdot at rest",
     [](Settings& lean, Settings& full) {
       free_postures(lean, full);
       lean.task_terms.jacobian_rate = full.task_terms.jacobian_rate = true;
     },
     [](LedArm& arm, int) { arm.state.velocity.setConstant(kTiny); }, &VibrationCounters::at_rest,
     true},
    {"all, standing still", [](Settings&, Settings&) {},
     [](LedArm& arm, int tick) {
       if (tick % 2 == 1) arm.state.position[0] = std::nextafter(arm.state.position[0], 10.0);
     },
     &VibrationCounters::unchanged},
    {"the null space of no gains",
     [](Settings& lean, Settings& full) {
       free_postures(lean, full);
       full.initial.gains.null_damping.setConstant(1e-14);
     },
     [](LedArm&, int) {}, nullptr},
    {"the feed-forward of no wrench",
     [](Settings& lean, Settings&) { lean.feed_forward.wrench = false; }, [](LedArm&, int) {},
     nullptr},
    {"the Coriolis torque at rest",
     [](Settings& lean, Settings&) { lean.feed_forward.coriolis = false; }, [](LedArm&, int) {},
     nullptr, true}};

class LeftOutOfATick : public ::testing::TestWithParam<LeftOut> {};
INSTANTIATE_TEST_SUITE_P(Terms, LeftOutOfATick, ::testing::ValuesIn(kTerms));

/// Each complex eigenvalue is one of the others, within both bounds and rounding of the matrices.
void expect_same_modes(const Vibration& lean, const Vibration& full) {
  ASSERT_EQ(lean.status, full.status);
  ASSERT_EQ(lean.count, full.count);
  for (int i = 0; i < lean.count; ++i) {
    const VibrationMode& mode = lean.modes[testing::at(i)];
    const analysis::Complex value = mode.eigenvalues[0];
    if (value.imag() == 0) continue;  // which real ones form a mode depends on the way there
    double beyond = std::numeric_limits<double>::infinity();
    for (int k = 0; k < full.count; ++k) {
      const VibrationMode& other = full.modes[testing::at(k)];
      beyond = std::min(beyond, std::abs(value - other.eigenvalues[0]) - other.error_bound);
    }
    EXPECT_LE(beyond, mode.error_bound + 1e-9 * std::abs(value)) << i;
  }
}

TEST_P(LeftOutOfATick, ChangesNothing) {
  const LeftOut& term = GetParam();
  for (const testing::Arm& arm : testing::arms()) {
    SCOPED_TRACE(arm.file);
    const RobotModel model = testing::arm_model(arm);
    Settings lean = testing::in_mode(testing::unlimited_settings(model), Mode::kCartesian);
    Settings full = lean;
    term.settings(lean, full);
    LedArm one(model, lean, testing::kSmallSwing), other(model, full, testing::kSmallSwing);
    double t = 0;
    for (int tick = 0; tick < 1000; ++tick) {  // a halt in every other tenth of a second
      const bool moves = tick / 100 % 2 == 0;
      if (moves) t += 1e-3;
      for (LedArm* each : {&one, &other}) {
        each->swing(t);
        if (!moves || term.still) each->state.velocity.setZero();
        if (each == &other) term.full(*each, tick);
        each->tick();
      }
      ASSERT_LE((one.torque - other.torque).cwiseAbs().maxCoeff(),
                1e-12 * other.torque.cwiseAbs().maxCoeff())
          << tick;
      expect_same_modes(one.modes(), other.modes());
      if (HasFailure()) return;
    }
    if (term.counter != nullptr) {
      EXPECT_GT(one.modes().counters.*term.counter, 200u);
      EXPECT_LT(other.modes().counters.*term.counter, 2u);
    }
  }
}

}  // namespace
}  // namespace dashpot::controller
