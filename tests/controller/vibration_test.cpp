// Modes from within the tick: right, with proved bounds, each with its number.
#include <dashpot/tests/support/arms.hpp>
#include <dashpot/tests/support/led_arm.hpp>
#include <dashpot/tests/support/tracked.hpp>

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <map>
#include <numbers>
#include <set>

namespace dashpot::controller {
namespace {

using testing::at;
using testing::in_mode;
using testing::kSmallSwing;
using testing::LedArm;
using testing::LongComplex;
using testing::LongMatrix;
using testing::panda_model;
using testing::unlimited_settings;

/// At joint position q, with the textbook's null-space projector: away from singularities.
std::vector<LongComplex> textbook_eigenvalues(const RobotModel& model, const Settings& settings,
                                              const JointVector& q) {
  const Eigen::Index n = q.size();
  const DynamicsResult robot = evaluate(model, q, JointVector::Zero(n));
  const Eigen::MatrixXd M = robot.M, J = robot.J, Minv = M.inverse();
  const Gains& gains = settings.initial.gains;
  Eigen::MatrixXd K = J.transpose() * gains.task_stiffness * J;
  Eigen::MatrixXd C = J.transpose() * gains.task_damping * J;
  if (n > 6) {
    const Eigen::MatrixXd N = Eigen::MatrixXd::Identity(n, n) -
                              Minv * J.transpose() * (J * Minv * J.transpose()).inverse() * J;
    K += N.transpose() * gains.null_stiffness.asDiagonal() * N;
    C += N.transpose() * gains.null_damping.asDiagonal() * N;
  }
  const Eigen::VectorXd friction = model.joint_values(&Joint::viscous_friction);
  C += friction.asDiagonal();
  return testing::true_eigenvalues(testing::system_from(M, C, K));
}

/// Returns the eigenvalues of the closed loop as the law's matrices give it.
std::vector<LongComplex> eigenvalues_now(const Controller& controller) {
  analysis::System<kMaxJoints> system;
  controller.closed_loop(system);
  return testing::true_eigenvalues(
      testing::system_from(system.mass, system.damping, system.stiffness));
}

/// Each published eigenvalue is one of `truth`, one to one. Returns the largest relative error;
/// eigenvalues near zero count as a millionth of the largest eigenvalue.
double worst_error(const Vibration& modes, std::vector<LongComplex> truth) {
  double worst = 0;
  long double largest = 0;
  for (const LongComplex& value : truth) largest = std::max(largest, std::abs(value));
  for (int i = 0; i < modes.count; ++i) {
    for (const analysis::Complex& value : modes.modes[at(i)].eigenvalues) {
      const LongComplex computed(value);
      const auto nearest = testing::nearest_to(computed, truth);
      const auto size = std::abs(computed) + 1e-6L * largest;
      worst = std::max(worst, static_cast<double>(std::abs(*nearest - computed) / size));
      truth.erase(nearest);
    }
  }
  return worst;
}

TEST(VibrationInTheTick, IsWhatADirectSolutionGivesThere) {
  for (const testing::Arm& arm : testing::arms()) {
    const RobotModel model = testing::arm_model(arm);
    for (const Mode mode : {Mode::kJoint, Mode::kCartesian}) {
      SCOPED_TRACE(std::string(arm.file) + (mode == Mode::kJoint ? " joint" : " cartesian"));
      const Settings settings = in_mode(unlimited_settings(model), mode);
      LedArm led(model, settings, kSmallSwing);
      led.settle();
      for (int k = 1; k <= 1000; ++k) {
        led.swing(1e-3 * k);
        ASSERT_LE(led.tick(), Status::kTorqueLimited);
        const Vibration& modes = led.modes();
        ASSERT_EQ(modes.tick, led.controller.snapshot().tick);
        ASSERT_EQ(modes.position, led.state.position);
        ASSERT_EQ(modes.status, analysis::Status::kOk);
        ASSERT_EQ(modes.count, model.dof());
        for (int i = 1; i < modes.count; ++i) {
          const auto size = [&](int j) {
            const auto& values = modes.modes[at(j)].eigenvalues;
            return std::abs(values[0]) * std::abs(values[1]);
          };
          ASSERT_GE(size(i - 1), size(i));
        }
        if (k % 50 != 0) continue;
        EXPECT_LE(worst_error(modes, eigenvalues_now(led.controller)), 1e-9) << "tick " << k;
        // The Baxter's wrist is so light that its null space counts as nearly singular.
        if (mode == Mode::kJoint || std::string(arm.file) == "baxter_left") continue;
        const auto textbook = textbook_eigenvalues(model, settings, modes.position);
        EXPECT_LE(worst_error(modes, textbook), 1e-9) << "tick " << k;
      }
      const VibrationCounters& counters = led.modes().counters;
      EXPECT_GE(counters.tracked, 990u);
      EXPECT_EQ(counters.failed + counters.missed, 0u);
    }
  }
}

// Which two real eigenvalues form a mode must not depend on the history of the gains.
TEST(VibrationInTheTick, PairsRealEigenvaluesAsADirectSolutionDoes) {
  for (const testing::Arm& description : testing::arms()) {
    const RobotModel model = testing::arm_model(description);
    Settings settings = unlimited_settings(model);
    settings.analysis.share = 1;                // all within the tick
    settings.initial.gains.joint_damping *= 4;  // most modes are overdamped
    settings.initial.gains.task_damping *= 4;
    for (const Mode mode : {Mode::kJoint, Mode::kCartesian}) {
      LedArm arm(model, in_mode(settings, mode), kSmallSwing);
      arm.settle();
      for (int k = 0; k < 3; ++k) arm.tick();
      analysis::System<kMaxJoints> system;
      arm.controller.closed_loop(system);
      analysis::SpectrumOptions options;
      options.soft_frequency = settings.analysis.soft_frequency;
      analysis::SpectrumSolver<kMaxJoints> solver(options);
      analysis::Spectrum<kMaxJoints> direct;
      ASSERT_EQ(solver.solve(system, direct), analysis::Status::kOk);
      ASSERT_EQ(arm.modes().count, direct.modes.size()) << description.file;
      int overdamped = 0;
      for (int i = 0; i < arm.modes().count; ++i) {
        const VibrationMode& found = arm.modes().modes[at(i)];
        overdamped += found.kind == analysis::ModeKind::kOverdamped ? 1 : 0;
        EXPECT_NEAR(found.natural_frequency, direct.modes[i].natural_frequency,
                    1e-9 * direct.modes[i].natural_frequency)
            << description.file;
        EXPECT_NEAR(found.damping_ratio, direct.modes[i].damping_ratio,
                    1e-9 * direct.modes[i].damping_ratio)
            << description.file;
      }
      EXPECT_GT(overdamped, 1) << description.file;
    }
  }
}

/// The modes' numbers stay with them: no eigenvalue jumps from tick to tick, even where the order
/// of frequencies changes.
TEST(VibrationInTheTick, KeepsTheNumbersOfModes) {
  std::size_t crossings = 0;
  for (const testing::Arm& arm : testing::arms()) {
    SCOPED_TRACE(arm.file);
    const RobotModel model = testing::arm_model(arm);
    LedArm led(model, in_mode(unlimited_settings(model), Mode::kCartesian), kSmallSwing);
    led.settle();
    std::map<int, VibrationMode> last;
    std::set<std::vector<int>> orders;
    for (int k = 1; k <= 2000; ++k) {
      led.swing(1e-3 * k);
      led.tick();
      std::map<int, VibrationMode> now;
      std::vector<int> order;
      for (int i = 0; i < led.modes().count; ++i) {
        const VibrationMode& mode = led.modes().modes[at(i)];
        now[mode.label] = mode;
        order.push_back(mode.label);
      }
      orders.insert(order);
      ASSERT_EQ(static_cast<int>(now.size()), led.modes().count) << "a number twice";
      for (const auto& [label, mode] : last) {
        ASSERT_TRUE(now.count(label)) << "tick " << k << " lost mode " << label;
        // Sum and product are smooth where two real eigenvalues meet.
        const auto& [a, b] = mode.eigenvalues;
        const auto& [c, d] = now[label].eigenvalues;
        EXPECT_LT(std::abs(c + d - a - b), 0.05 * (std::abs(a) + std::abs(b))) << "tick " << k;
        EXPECT_LT(std::abs(c * d - a * b), 0.05 * std::abs(a * b)) << "tick " << k;
      }
      last = now;
    }
    crossings += orders.size() - 1;
  }
  EXPECT_GE(crossings, 3u);
}

/// Published shapes solve the equation of motion and have unit kinetic energy; bounds are proved.
TEST(VibrationInTheTick, ShapesBelongToTheClosedLoop) {
  const RobotModel model = panda_model();
  LedArm led(model, in_mode(unlimited_settings(model), Mode::kCartesian), kSmallSwing);
  led.settle();
  for (int k = 1; k <= 500; ++k) {
    led.swing(1e-3 * k);
    led.tick();
    for (int i = 0; i < led.modes().count; ++i) {
      const VibrationMode& mode = led.modes().modes[at(i)];
      EXPECT_GT(mode.error_bound, 0);
      EXPECT_LT(mode.error_bound, 1e-9 * std::abs(mode.eigenvalues[1]));
    }
  }
  analysis::System<kMaxJoints> system;
  led.controller.closed_loop(system);
  for (int i = 0; i < led.modes().count; ++i) {
    const VibrationMode& mode = led.modes().modes[at(i)];
    const Eigen::VectorXcd u = mode.shape;
    const Eigen::MatrixXd M = system.mass, C = system.damping, K = system.stiffness;
    const std::complex<double> l = mode.eigenvalues[0];
    const Eigen::VectorXcd residual = l * l * (M * u) + l * (C * u) + K * u;
    EXPECT_LT(residual.norm(),
              1e-10 * (std::norm(l) * M.norm() + std::abs(l) * C.norm() + K.norm()) * u.norm());
    EXPECT_NEAR((u.adjoint() * M * u).value().real(), 1, 1e-9);
  }
}

/// Through the stretched posture and back, where the arm loses a direction.
TEST(VibrationInTheTick, GoesThroughASingularity) {
  const RobotModel model = panda_model();
  Settings settings = unlimited_settings(model);
  for (const double null_stiffness : {0.0, 20.0}) {
    SCOPED_TRACE(null_stiffness);
    settings.initial.gains.null_stiffness.setConstant(null_stiffness);
    LedArm led(model, in_mode(settings, Mode::kCartesian), kSmallSwing);
    led.settle();
    const JointVector start = led.center;
    JointVector stretched = start;
    stretched << 0, 0, 0, 0, 0, 0.3, 0;
    for (int k = 1; k <= 4000; ++k) {
      const double s = 0.5 - 0.5 * std::cos(std::numbers::pi * k / 2000.0);
      led.place(start + s * (stretched - start));
      led.tick();
      const Vibration& modes = led.modes();
      ASSERT_TRUE(modes.status == analysis::Status::kOk ||
                  modes.status == analysis::Status::kUncertified)
          << analysis::to_text(modes.status) << " at tick " << k;
      ASSERT_EQ(modes.count + modes.zero_modes, 7);
      ASSERT_GE(modes.count, 5);
      if (k % 10 == 0) {
        EXPECT_LE(worst_error(modes, eigenvalues_now(led.controller)), 1e-6) << "tick " << k;
      }
    }
    const VibrationCounters& counters = led.modes().counters;
    EXPECT_EQ(counters.failed, 0u);
    EXPECT_LE(counters.direct, 40u);
    EXPECT_GE(counters.tracked, 4000u);
  }
}

}  // namespace
}  // namespace dashpot::controller
