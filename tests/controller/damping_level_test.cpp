// Damping ratios in a sampled loop: how far they are lowered, and the margin that the loop then has
// by its eigenvalues.
#include <dashpot/analysis/sampled_loop.hpp>
#include <dashpot/analysis/spectrum.hpp>
#include <dashpot/controller/gain_judge.hpp>
#include <dashpot/controller/vibration/sampled_analysis.hpp>
#include <dashpot/tests/support/chains.hpp>
#include <dashpot/tests/support/led_arm.hpp>
#include <dashpot/tests/support/random.hpp>

#include <gtest/gtest.h>

#include <Eigen/Eigenvalues>
#include <Eigen/LU>
#include <algorithm>
#include <cmath>
#include <numbers>
#include <optional>

namespace dashpot::controller {
namespace {

using testing::LedArm;
using testing::Random;

/// The margin of the closed loop of an arm, if it is not far above `wanted`.
double margin_of(const LedArm& arm, double wanted) {
  const Settings& settings = arm.controller.settings();
  analysis::System<kMaxJoints> system;
  arm.controller.closed_loop(system);
  const analysis::SampledLoop loop =
      SampledArm(arm.model, timing_of(settings)).at(arm.state.position);
  analysis::Spectrum<kMaxJoints> spectrum;
  analysis::SpectrumSolver<kMaxJoints>().solve(system, spectrum);
  return gain_margin(system, spectrum, loop, 1.2 * wanted);
}

/// Nothing interferes, and gains act at once.
Settings plain(const RobotModel& model, Mode mode) {
  Settings settings = testing::in_mode(testing::unlimited_settings(model), mode);
  settings.motion.gain_time = settings.period;
  settings.analysis.where = Analysis::Where::kOff;
  settings.limits.torque *= 1e3;
  settings.limits.torque_rate *= 1e6;
  return settings;
}

/// The fastest mode without damping, rad/s.
double fastest(const LedArm& arm) {
  analysis::System<kMaxJoints> system;
  arm.controller.closed_loop(system);
  using Matrix = Eigen::MatrixXd;
  const Eigen::GeneralizedSelfAdjointEigenSolver<Matrix> modes(
      Matrix(system.stiffness), Matrix(system.mass), Eigen::EigenvaluesOnly);
  return std::sqrt(modes.eigenvalues().maxCoeff());
}

enum class What { kTip, kJoints, kFreeMotions, kSingular, kFriction, kPayload };

std::ostream& operator<<(std::ostream& out, What what) {
  constexpr const char* kNames[] = {"tip",      "joints",   "free motions",
                                    "singular", "friction", "payload"};
  return out << kNames[static_cast<int>(what)];
}

/// An arm with gains whose fastest mode is near the limit of the sampled loop.
class LevelCase {
 public:
  LevelCase(const testing::Arm& arm, What what, Random& random) : what_(what), random_(random) {
    const RobotModel bare = testing::smooth_arm(arm);
    const int n = bare.dof();
    ModelOptions options;
    options.viscous_friction = options.coulomb_friction = JointVector::Zero(n);
    if (what == What::kFriction) {  // of 0.3 to 10 1/s in each joint
      const JointVector bent = JointVector::Constant(n, 0.5);
      const Eigen::MatrixXd inverse =
          Eigen::MatrixXd(evaluate(bare, bent, JointVector::Zero(n)).M).inverse();
      for (int i = 0; i < n; ++i) {
        options.viscous_friction[i] = random.log_uniform(0.3, 10) / inverse(i, i);
      }
    }
    if (what == What::kPayload) {
      options.payload = {random.log_uniform(0.3, 5), 0.05 * random.vector(3),
                         0.01 * Eigen::Matrix3d::Identity()};
    }
    model = testing::arm_model(arm, options);
    settings = plain(*model, what == What::kJoints ? Mode::kJoint : Mode::kCartesian);
    Gains& gains = settings.initial.gains;
    gains.joint_damping_ratio = gains.task_damping_ratio = random.uniform(0.5, 1.5);
    gains.null_damping_ratio = 0.7;
    gains.null_stiffness.setConstant(n > 6 ? 5 : 0);
    if (what == What::kFreeMotions) {
      gains.directions = {true, true, true, false, random.integer(0, 1) == 1, false};
      for (double& k : gains.null_stiffness) k = random.log_uniform(1, 50);
    }
    Analysis::Sampled& loop = settings.analysis.sampled;
    loop.delay = random.integer(0, 3);
    if (random.integer(0, 2) == 0) loop.cutoff = random.log_uniform(30, 400);
    loop.difference_velocity = random.integer(0, 2) == 0;
    settings.limits.gain_margin = random.uniform(1.3, 3);
  }

  /// The arm at a random posture, at rest, with stiffness that makes the fastest mode about as fast
  /// as the loop tolerates.
  void meet() {
    JointVector q = 2 * random_.vector(model->dof()).cwiseMax(-1).cwiseMin(1);
    if (what_ == What::kSingular) q *= random_.log_uniform(1e-4, 0.1);  // stretched out
    Settings trial = settings;
    trial.limits.gain_margin = 1;
    LedArm first(*model, trial);
    first.place(q);
    first.settle();
    const Analysis::Sampled& loop = settings.analysis.sampled;
    double lag = loop.delay + 0.5 + (loop.difference_velocity ? 0.5 : 0);
    if (loop.cutoff > 0) lag += 1 / std::expm1(6.283 * loop.cutoff * settings.period);
    const double wanted = random_.uniform(0.2, 0.6) / (lag * settings.period);
    const double factor = std::pow(wanted / fastest(first), 2);
    for (Settings* one : {&settings, &trial}) {
      Gains& gains = one->initial.gains;
      gains.task_stiffness *= factor;
      gains.joint_stiffness *= factor;
      gains.null_stiffness *= factor;
    }
    for (auto* arm : {&held, &asked}) {
      arm->emplace(*model, arm == &held ? settings : trial);
      (*arm)->place(q);
      (*arm)->settle();
    }
    asked->tick();
    status = held->tick();
  }

  std::optional<RobotModel> model;
  Settings settings;
  std::optional<LedArm> held, asked;  ///< with the achievable damping, and with the given ratio
  Status status = Status::kOk;

 private:
  What what_;
  Random& random_;
};

class DampingLevel : public ::testing::TestWithParam<What> {};
INSTANTIATE_TEST_SUITE_P(OfAll, DampingLevel,
                         ::testing::Values(What::kTip, What::kJoints, What::kFreeMotions,
                                           What::kSingular, What::kFriction, What::kPayload));

TEST_P(DampingLevel, KeepsTheMarginOfEveryArm) {
  Random random(5200 + static_cast<std::uint64_t>(GetParam()));
  int kept = 0, lowered = 0, too_little = 0;
  for (const testing::Arm& arm : testing::all_arms()) {
    LevelCase one(arm, GetParam(), random);
    for (int posture = 0; posture < 2; ++posture) {
      one.meet();
      SCOPED_TRACE(arm.file);
      const double wanted = one.settings.limits.gain_margin;
      const double level = one.held->controller.snapshot().damping_level;
      ASSERT_GT(level, 0);
      ASSERT_LE(level, 1);
      if (one.status == Status::kLittleMargin) continue;
      ASSERT_EQ(one.status, Status::kOk);
      ++kept;
      EXPECT_GE(margin_of(*one.held, wanted), wanted);
      if (level == 1) {
        EXPECT_EQ(one.held->torque, one.asked->torque);
        continue;
      }
      ++lowered;
      too_little += margin_of(*one.asked, wanted) < wanted ? 1 : 0;
    }
  }
  EXPECT_GT(kept, 10);
  EXPECT_GT(lowered, 3);
  EXPECT_GT(too_little, lowered / 2);
}

/// A Panda whose torque arrives three ticks late, with a ratio of 1.
Settings late(Mode mode, double margin) {
  Settings settings = plain(testing::smooth_panda(), mode);
  settings.analysis.sampled.delay = 3;
  settings.limits.gain_margin = margin;
  Gains& gains = settings.initial.gains;
  gains.task_damping_ratio = gains.joint_damping_ratio = 1;
  gains.null_damping_ratio = 0.7;
  gains.task_stiffness = Vector6(7200, 7200, 7200, 72, 72, 72).asDiagonal();
  gains.joint_stiffness =
      JointVector{{2000, 500, 500, 500, 50, 50, 5}}.asDiagonal().toDenseMatrix();
  return settings;
}

JointVector drawn_in() {
  return JointVector{{0, -0.8, 0, -2.3, 0, 1.6, 0.8}};
}

/// From folded, where the loop tolerates the ratio, to stretched out upward, where the first joint
/// has little inertia, and back: the level falls before the margin would be too small.
TEST(HeldDamping, FallsAndRisesAlongAPath) {
  const RobotModel model = testing::smooth_panda();
  LedArm held(model, late(Mode::kJoint, 2)), asked(model, late(Mode::kJoint, 1));
  const JointVector in = drawn_in(), out{{0, -0.4, 0, -1.8, 0, 1.6, 0.8}};
  double least = 1, lost = 2, last = 1;
  int whole = 0, changes = 0;
  Eigen::MatrixXd before;
  for (int k = 0; k <= 2000; ++k) {
    const double t = 1e-3 * k, pi = std::numbers::pi;  // a swing of 2 s
    for (LedArm* arm : {&held, &asked}) {
      arm->state.position = in + 0.5 * (1 - std::cos(pi * t)) * (out - in);
      arm->state.velocity = 0.5 * pi * std::sin(pi * t) * (out - in);
      ASSERT_LE(arm->tick(), Status::kNearJointLimit) << k;
    }
    EXPECT_EQ(asked.controller.snapshot().damping_level, 1);
    const double level = held.controller.snapshot().damping_level;
    if (level == 1) {
      EXPECT_EQ(held.torque, asked.torque) << k;
    }
    if (k % 50 == 0) {
      EXPECT_GE(margin_of(held, 2), 2) << k;
      lost = std::min(lost, margin_of(asked, 2));
    }
    EXPECT_LT(std::abs(level - last), 0.01) << k;
    const Eigen::MatrixXd C = held.damping();
    if (before.size() > 0) {
      EXPECT_LT((C - before).norm(), 0.02 * C.norm()) << k;
    }
    least = std::min(least, level);
    whole += level == 1 ? 1 : 0;
    changes += (level == 1) != (last == 1) ? 1 : 0;
    last = level;
    before = C;
  }
  EXPECT_LT(least, 0.8);
  EXPECT_GT(whole, 500);
  EXPECT_EQ(changes, 2);
  EXPECT_LT(lost, 1.6);
}

/// While one mode takes over from the other, both have dampers.
TEST(HeldDamping, KeepsTheMarginWhileTheModeChanges) {
  const RobotModel model = testing::smooth_panda();
  double least = 2;
  for (const double margin : {2.0, 1.0}) {
    Settings settings = late(Mode::kJoint, margin);
    settings.motion.gain_time = 0.5;
    LedArm arm(model, settings);
    arm.place(drawn_in());
    arm.settle();
    arm.setpoint.mode = Mode::kCartesian;
    for (int k = 0; k < 600; ++k) {
      ASSERT_LE(arm.tick(), Status::kNearJointLimit) << k;
      if (k % 25 != 0) continue;
      const double found = margin_of(arm, 2);
      if (margin == 2) {
        EXPECT_GE(found, 2) << k;
      } else {
        least = std::min(least, found);
      }
    }
  }
  EXPECT_LT(least, 1.95);
}

/// Springs that grow from zero have the whole ratio.
TEST(HeldDamping, IsLeftAloneWhileSpringsStart) {
  const RobotModel model = testing::smooth_panda();
  for (const Mode mode : {Mode::kJoint, Mode::kCartesian}) {
    Settings settings = late(mode, 2);
    settings.initial.gains.task_stiffness *= 0.5;
    settings.motion.gain_time = 0.5;
    LedArm held(model, settings);
    settings.limits.gain_margin = 1;
    LedArm asked(model, settings);
    for (int k = 0; k < 600; ++k) {
      for (LedArm* arm : {&held, &asked}) {
        arm->place(drawn_in());
        arm->state.velocity.setConstant(0.1);
        ASSERT_EQ(arm->tick(), Status::kOk) << k;
      }
      ASSERT_EQ(held.controller.snapshot().damping_level, 1) << k;
      ASSERT_EQ(held.torque, asked.torque) << k;
    }
  }
}

/// A joint on its own. Without delay a damper c held for T is stable up to c T / I = 2 / margin,
/// whatever the spring.
class OneJoint : public ::testing::Test {
 protected:
  static constexpr double kInertia = testing::kLinkInertia, kPeriod = 0.001;  // s

  OneJoint() : settings(plain(model, Mode::kJoint)) { settings.limits.gain_margin = 2.5; }
  Status hold(double omega, double ratio) {
    settings.initial.gains.joint_stiffness(0, 0) = omega * omega * kInertia;
    settings.initial.gains.joint_damping_ratio = ratio;
    arm.emplace(model, settings);
    arm->settle();
    return arm->tick();
  }
  double level() const { return arm->controller.snapshot().damping_level; }

  const RobotModel model = testing::one_link();
  Settings settings;
  std::optional<LedArm> arm;
};

TEST_F(OneJoint, HasTheDampingThatItBears) {
  for (const double omega : {50.0, 200.0, 700.0, 1100.0}) {
    for (const double ratio : {0.4, 0.7, 2.0}) {
      ASSERT_EQ(hold(omega, ratio), Status::kOk);
      const double whole = 2 * ratio * omega * kPeriod;
      EXPECT_NEAR(level(), std::min(1.0, 2 / (1.02 * 2.5) / whole), 1e-6);
      EXPECT_EQ(arm->controller.snapshot().joint_damping_ratio, ratio);
      EXPECT_NEAR(arm->damping()(0, 0), level() * whole * kInertia / kPeriod,
                  1e-6 * whole * kInertia / kPeriod);
    }
  }
}

/// A spring is too stiff beyond k T^2 / I = 4 / margin, or with less damping than k T / 2.
TEST_F(OneJoint, SaysWhereNoShareKeepsTheMargin) {
  EXPECT_EQ(hold(1200, 0.7), Status::kOk);
  EXPECT_EQ(hold(1300, 0.7), Status::kLittleMargin);
  EXPECT_EQ(hold(400, 0.11), Status::kOk);
  EXPECT_EQ(hold(400, 0.09), Status::kLittleMargin);
  EXPECT_EQ(level(), 1);
  settings.limits.gain_margin = 1;  // all gains are accepted
  EXPECT_EQ(hold(1900, 2), Status::kOk);
  EXPECT_EQ(level(), 1);
}

/// The gains that will be active are judged.
TEST_F(OneJoint, IsJudgedWithTheDampingThatItBears) {
  Gains& gains = settings.initial.gains;
  gains.joint_damping_ratio = 2;
  gains.task_stiffness.setZero();
  const auto margin = [&](double omega) {
    gains.joint_stiffness(0, 0) = omega * omega * kInertia;
    return GainJudge(model, settings).judge(JointVector::Constant(1, 0.4), gains).margin;
  };
  EXPECT_EQ(margin(1100), 2.5);
  EXPECT_LT(margin(1500), 2);
}

}  // namespace
}  // namespace dashpot::controller
