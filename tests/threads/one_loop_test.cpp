// One loop, whoever asks: the audit, the judge of gains, the loop at a posture and the analysis
// beside the tick say the same of the same gains on the same arm.
#include <dashpot/analysis/spectrum.hpp>
#include <dashpot/controller/audit.hpp>
#include <dashpot/controller/controller.hpp>
#include <dashpot/controller/gain_judge.hpp>
#include <dashpot/tests/support/led_arm.hpp>
#include <dashpot/tests/support/random.hpp>

#include <gtest/gtest.h>

#include <algorithm>
#include <chrono>
#include <cmath>
#include <cstdio>
#include <optional>
#include <stdexcept>
#include <string>
#include <thread>
#include <utility>
#include <vector>

namespace dashpot::controller {
namespace {

using testing::Random;

/// Gains on an arm, in a loop.
struct Case {
  RobotModel model;
  Settings settings;
  JointVector q;
  Mode mode = Mode::kJoint;
};

RobotModel random_arm(Random& random, int k) {
  const testing::Arm arm = testing::all_arms()[static_cast<std::size_t>(k % 6)];
  const int n = testing::arm_model(arm).dof();
  const auto some = [&](double low, double high) {
    JointVector values(n);
    for (double& one : values) one = random.uniform(low, high);
    return values;
  };
  ModelOptions options;
  options.viscous_friction = k % 3 == 0 ? JointVector(JointVector::Zero(n)) : some(0.02, 0.5);
  if (k / 6 % 2 == 0) options.reflected_inertia = some(0.05, 0.4);
  if (k / 6 % 4 == 0) {
    options.gear_stiffness = some(5e3, 2e4);
    options.gear_damping = some(5, 20);
  }
  if (k % 5 < 2) options.payload.mass = random.uniform(0.2, 2);
  return testing::arm_model(arm, options);
}

Case random_case(Random& random, int k) {
  RobotModel model = random_arm(random, k);
  const int n = model.dof();
  Settings settings = testing::unlimited_settings(model);
  settings.period = 1e-3 * random.integer(1, 4);
  settings.motion.gain_time = settings.period;
  settings.motion.smoothing = 0.02;
  settings.watchdog.longest_gap = 0.1;
  settings.analysis.sampled.delay = random.integer(0, 4);
  settings.analysis.sampled.cutoff = k % 7 == 0 ? random.uniform(30, 100) : 0;
  settings.integral.time = k % 9 == 0 ? random.uniform(1, 3) : 0;
  settings.feed_forward.gravity = k % 6 != 5;
  settings.limits.gain_margin = 1e6;  // as far as the audit looks
  Gains& gains = settings.initial.gains;
  for (int i = 0; i < n; ++i) {
    gains.joint_stiffness(i, i) = random.log_uniform(10, 200);
    gains.joint_damping(i, i) = random.log_uniform(0.1, 10);
    gains.null_stiffness[i] = k % 4 < 2 ? random.uniform(1, 10) : 0;
    gains.null_damping[i] = k % 4 == 3 ? 0 : random.uniform(0.1, 2);
  }
  for (int i = 0; i < 6; ++i) {
    const double unit = i < 3 ? 1 : 0.05;
    gains.task_stiffness(i, i) = unit * random.log_uniform(50, 1500);
    gains.task_damping(i, i) = unit * random.log_uniform(2, 60);
  }
  if (k % 10 == 3) gains.frame = Frame::kTool;
  Setpoint setpoint = settings.initial;
  setpoint.mode = Mode::kCartesian;
  // The most regular of some postures: without rotors a wrist is nearly singular everywhere.
  JointVector q(n);
  double most = -1;
  for (int tries = 0; tries < 200; ++tries) {
    JointVector there(n);
    for (double& one : there) one = random.uniform(-1.5, 1.5);
    NullSpace null_space;
    null_space.compute(evaluate(model, there, JointVector::Zero(n)), Impedance(setpoint, n));
    if (null_space.inertia().regularity() <= most) continue;
    most = null_space.inertia().regularity();
    q = there;
  }
  return {std::move(model), settings, q, k % 2 == 0 ? Mode::kJoint : Mode::kCartesian};
}

AuditOptions stated(const Settings& settings, Mode mode) {
  AuditOptions options;
  static_cast<LoopTiming&>(options) = timing_of(settings);
  options.mode = mode;
  options.gains = settings.initial.gains;
  return options;
}

/// Modes and margin of the loop at a posture.
struct Said {
  analysis::Spectrum<> modes;
  analysis::SampledSpectrum sampled;
  double margin;
};

Said said_of(const LoopAt& loop) {
  Said said{analysis::analyze(loop.system), {}, 0};
  said.sampled = analysis::sample_loop(loop.system, said.modes, loop.sampled);
  said.margin = analysis::gain_margin(loop.system, said.modes, loop.sampled);
  return said;
}

void expect_same_margin(double found, double wanted) {
  if (std::isinf(wanted)) {
    EXPECT_EQ(found, wanted);
  } else {
    EXPECT_NEAR(found, wanted, 1e-5 * wanted);
  }
}

/// Which real eigenvalues form a mode may differ where several modes are overdamped.
std::vector<analysis::Complex> eigenvalues_of(const analysis::Spectrum<>& spectrum) {
  std::vector<analysis::Complex> values;
  for (const analysis::Mode<>& mode : spectrum.modes) {
    values.insert(values.end(), mode.eigenvalues.begin(), mode.eigenvalues.end());
  }
  std::sort(values.begin(), values.end(), [](const auto& a, const auto& b) {
    return std::pair(std::abs(a), a.imag()) < std::pair(std::abs(b), b.imag());
  });
  return values;
}

void expect_same_modes(const analysis::Spectrum<>& found, const analysis::Spectrum<>& wanted) {
  const auto all = eigenvalues_of(found), others = eigenvalues_of(wanted);
  ASSERT_EQ(all.size(), others.size());
  for (std::size_t i = 0; i < all.size(); ++i) {
    // Two of a pair have one modulus but for rounding.
    const double apart =
        std::min(std::abs(all[i] - others[i]), std::abs(std::conj(all[i]) - others[i]));
    EXPECT_LT(apart, 1e-7 * (1 + std::abs(others[i])));
  }
}

/// The latest result of a controller that stands at the posture; null if it refuses the settings.
void expect_of_tick(const Case& one, const Said& wanted, int& ticked) {
  Settings settings = one.settings;
  settings.initial.mode = one.mode;
  settings.limits.gain_margin = 2;  // lowers ratios alone, and there are none
  settings.analysis.where = Analysis::Where::kOff;
  settings.analysis.sampled.interval = 1;
  std::optional<testing::LedArm> arm;
  try {
    arm.emplace(one.model, settings);
  } catch (const InvalidSettings&) {
    if (one.model.elastic_joints() == 0) throw;
    return;  // no brake is stable with these gears
  }
  arm->place(one.q);
  const auto there = evaluate(one.model, one.q, arm->state.velocity);
  arm->setpoint.joint_position = one.q;
  arm->setpoint.tip_pose = {there.p_BT_B, there.R_BT};
  const SampledVibration* found = nullptr;
  const auto end = std::chrono::steady_clock::now() + std::chrono::minutes(20);
  while (found == nullptr && std::chrono::steady_clock::now() < end) {
    arm->tick();
    found = arm->controller.sampled_vibration();
    if (found == nullptr) std::this_thread::sleep_for(std::chrono::milliseconds(1));
  }
  ASSERT_NE(found, nullptr);
  expect_same_margin(found->gain_margin, wanted.margin);
  EXPECT_NEAR(found->spectral_radius, wanted.sampled.spectral_radius, 1e-9);
  ASSERT_EQ(static_cast<std::size_t>(found->count), wanted.sampled.modes.size());
  EXPECT_EQ(found->status, analysis::Status::kOk);
  EXPECT_EQ(found->position, one.q);
  for (std::size_t i = 0; i < wanted.sampled.modes.size(); ++i) {
    const SampledVibrationMode& mode = found->modes[i];
    const analysis::SampledMode& sampled = wanted.sampled.modes[i];
    const double frequency = sampled.natural_frequency;
    if (!std::isfinite(frequency)) continue;
    EXPECT_EQ(mode.kind, sampled.kind);
    EXPECT_NEAR(mode.natural_frequency, frequency, 1e-6 * (1 + frequency));
    EXPECT_NEAR(mode.damping_ratio, sampled.damping_ratio, 1e-6 * (1 + sampled.damping_ratio));
    EXPECT_NEAR(mode.damped_frequency, sampled.damped_frequency, 1e-6 * (1 + frequency));
    const analysis::Mode<>& origin = wanted.modes.modes[static_cast<int>(i)];
    if (!std::isfinite(origin.natural_frequency)) continue;
    EXPECT_NEAR(mode.continuous_frequency, origin.natural_frequency,
                1e-6 * (1 + origin.natural_frequency));
    EXPECT_NEAR(mode.continuous_ratio, origin.damping_ratio, 1e-6 * (1 + origin.damping_ratio));
  }
  ++ticked;
}

/// 216 cases in twelve parts.
class AnyLoop : public ::testing::TestWithParam<int> {};
INSTANTIATE_TEST_SUITE_P(OneLoop, AnyLoop, ::testing::Range(0, 12));

TEST_P(AnyLoop, IsTheSameForAllWhoAsk) {
  const auto seed = static_cast<std::uint64_t>(5501 + GetParam());
  std::printf("seed %lu\n", static_cast<unsigned long>(seed));
  Random random(seed);
  int ticked = 0;
  for (int k = 18 * GetParam(); k < 18 * (GetParam() + 1); ++k) {
    SCOPED_TRACE(k);
    const Case one = random_case(random, k);
    const Gains& gains = one.settings.initial.gains;
    PostureLoop loop(one.model, one.settings);
    double least = one.settings.limits.gain_margin;
    Mode weaker = Mode::kJoint;
    for (const Mode mode : {Mode::kJoint, Mode::kCartesian}) {
      SCOPED_TRACE(mode == Mode::kJoint ? "joint" : "cartesian");
      const Said said = said_of(loop.at(one.q, gains, mode));
      const Audit audit(one.model, stated(one.settings, mode));
      const PostureAudit audited = audit.audit(one.q);
      expect_same_modes(audited.spectrum, said.modes);
      expect_same_margin(audited.numbers.gain_margin, said.margin);
      const PostureNumbers quick = audit.numbers(one.q);
      expect_same_margin(quick.gain_margin, said.margin);
      EXPECT_NEAR(quick.smallest_ratio, audited.numbers.smallest_ratio, 1e-6);
      if (said.margin < least) {
        least = said.margin;
        weaker = mode;
      }
      if (mode == one.mode) expect_of_tick(one, said, ticked);
    }
    const GainJudge::Verdict verdict = GainJudge(one.model, one.settings).judge(one.q, gains);
    EXPECT_EQ(verdict.mode, weaker);
    expect_same_margin(verdict.margin, least);
  }
  EXPECT_GE(ticked, 12);  // all but gears with which no brake is stable
}

/// A Panda with its rotors and soft joints: what the torque against gravity does that comes late.
TEST(OneLoop, CountsThatGravityIsCompensatedLate) {
  ModelOptions options;
  options.drives = "panda";
  const RobotModel model = testing::arm_model(testing::arms()[0], options);
  Settings settings = testing::unlimited_settings(model);
  settings.analysis.sampled.delay = 4;
  settings.limits.gain_margin = 100;
  Gains& gains = settings.initial.gains;
  JointVector K(7), D(7), q(7);
  K << 60, 60, 60, 60, 10, 10, 10;
  D << 0.3, 0.3, 0.3, 0.3, 0.1, 0.1, 0.1;
  q << 0, 0.9, 0, -0.5, 0, 1.6, 0.8;
  gains.joint_stiffness = K.asDiagonal();
  gains.joint_damping = D.asDiagonal();
  const auto audited = [&](bool ideal) {
    AuditOptions stated_options = stated(settings, Mode::kJoint);
    stated_options.ideal_gravity = ideal;
    return Audit(model, stated_options).numbers(q).gain_margin;
  };
  EXPECT_NEAR(audited(true), 35.0, 0.1);
  EXPECT_LT(audited(false), 0.01);
  const GainJudge::Verdict verdict = GainJudge(model, settings).judge(q, gains);
  EXPECT_EQ(verdict.mode, Mode::kJoint);
  expect_same_margin(verdict.margin, audited(false));
}

/// The names of the parts that are left out.
TEST(OneLoop, SaysWhatItLeavesOut) {
  const RobotModel bare = testing::smooth_panda();
  ModelOptions options;
  options.drives = "panda";
  options.gear_stiffness = JointVector::Constant(7, 1e4);
  options.viscous_friction = JointVector::Constant(7, 0.1);
  const RobotModel known = testing::arm_model(testing::arms()[0], options);
  using Names = std::vector<std::string>;
  LoopTiming timing;
  EXPECT_EQ(loop_assumptions(timing, &bare),
            (Names{"continuous", "rotors unknown", "gears rigid", "friction none"}));
  timing.period = 1e-3;
  EXPECT_EQ(loop_assumptions(timing, &known), Names{"delay none"});
  timing.delay = 2;
  EXPECT_EQ(loop_assumptions(timing, &known), Names{});
  timing.ideal_gravity = true;
  EXPECT_EQ(loop_assumptions(timing, &known), Names{"gravity ideal"});
  EXPECT_EQ(loop_assumptions(timing, nullptr), Names{"gravity ideal"});
}

}  // namespace
}  // namespace dashpot::controller
