// Terms that a tick leaves out because they are zero, beside an input next to zero, with which
// nothing may be left out: the same torques and modes.
#include <dashpot/controller/vibration/vibration.hpp>
#include <dashpot/tests/support/led_arm.hpp>

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <limits>

namespace dashpot::controller {
namespace {

using testing::LedArm;

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
