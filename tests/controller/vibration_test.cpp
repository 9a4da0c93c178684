// Modes from within the tick: right, each with its number, and without work that is not needed.
#include <dashpot/tests/support/arms.hpp>
#include <dashpot/tests/support/hostile_ticks.hpp>
#include <dashpot/tests/support/simulated_arm.hpp>
#include <dashpot/tests/support/true_spectrum.hpp>

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <map>
#include <numbers>
#include <set>

namespace dashpot::controller {
namespace {

using analysis::SpectrumOrigin;
using testing::LongComplex;
using testing::LongMatrix;

RobotModel panda() {
  return testing::arm_model(testing::arms()[0]);
}

std::size_t at(int i) {
  return static_cast<std::size_t>(i);
}

/// No limit or watchdog interferes.
Settings inline_settings(const RobotModel& model) {
  Settings settings = default_settings(model);
  settings.analysis.where = Analysis::Where::kInline;
  settings.watchdog.setpoint_hold = settings.watchdog.setpoint_damp = 0;
  settings.limits.velocity.setConstant(1e3);
  settings.limits.position_lower.setConstant(-10);
  settings.limits.position_upper.setConstant(10);
  return settings;
}

/// The arm is led along a path; nothing but its state matters.
struct LedArm {
  LedArm(const RobotModel& robot, const Settings& settings, Mode mode)
      : model(robot), controller(robot, settings), setpoint(settings.initial) {
    setpoint.mode = mode;
    center = settings.initial.joint_position;
    if (model.dof() == 7) {
      center << 0, -0.785, 0.1, -2.2, 0.2, 1.7, 0.785;
    } else {
      center = JointVector::LinSpaced(model.dof(), 0.3, 1.2);
    }
    place(center);
    const DynamicsResult there = evaluate(model, center, JointVector::Zero(model.dof()));
    setpoint.joint_position = center;
    setpoint.tip_pose = {there.p_BT_B, there.R_BT};
  }

  void place(const JointVector& q) {
    state.position = q;
    state.velocity = JointVector::Zero(q.size());
  }
  /// Swings of 0.2 rad, one in 2 s.
  void swing(double t) {
    for (Eigen::Index i = 0; i < center.size(); ++i) {
      const double phase = std::numbers::pi * t + static_cast<double>(i);
      state.position[i] = center[i] + 0.2 * (std::sin(phase) - std::sin(static_cast<double>(i)));
      state.velocity[i] = 0.2 * std::numbers::pi * std::cos(phase);
    }
  }
  Status tick() {
    setpoint.time = state.time += 1'000'000;
    return controller.update(state, setpoint, torque);
  }
  /// Until the gains have grown.
  void settle() {
    const int ticks = static_cast<int>(controller.settings().motion.gain_time * 1000) + 2;
    for (int k = 0; k < ticks; ++k) tick();
  }
  const Vibration& modes() const { return controller.vibration(); }

  RobotModel model;
  Controller controller;
  RobotState state;
  Setpoint setpoint;
  JointVector center, torque;
};

/// Eigenvalues of M q'' + C q' + K q = 0, by a solver of their own in long double.
std::vector<LongComplex> eigenvalues_of(const Eigen::MatrixXd& M, const Eigen::MatrixXd& C,
                                        const Eigen::MatrixXd& K) {
  const Eigen::Index n = M.rows();
  LongMatrix A = LongMatrix::Zero(2 * n, 2 * n);
  const auto inverse = LongMatrix(M.cast<long double>()).inverse().eval();
  A.topRightCorner(n, n).setIdentity();
  A.bottomLeftCorner(n, n) = -inverse * K.cast<long double>();
  A.bottomRightCorner(n, n) = -inverse * C.cast<long double>();
  const auto values = Eigen::EigenSolver<LongMatrix>(A, false).eigenvalues().eval();
  return {values.begin(), values.end()};
}

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
  const Eigen::VectorXd friction = model.joint_values(&Joint::damping);
  C += friction.asDiagonal();
  return eigenvalues_of(M, C, K);
}

/// Of the closed loop as the law's matrices give it.
std::vector<LongComplex> eigenvalues_now(const Controller& controller) {
  analysis::System<kMaxJoints> system;
  controller.closed_loop(system);
  return eigenvalues_of(system.mass, system.damping, system.stiffness);
}

/// Each published eigenvalue is one of `truth`, one to one. Returns the largest relative error;
/// what is as good as zero counts as a millionth of the largest eigenvalue.
double worst_error(const Vibration& modes, std::vector<LongComplex> truth) {
  double worst = 0;
  long double largest = 0;
  for (const LongComplex& value : truth) largest = std::max(largest, std::abs(value));
  for (int i = 0; i < modes.count; ++i) {
    for (const analysis::Complex& value : modes.modes[at(i)].eigenvalues) {
      const LongComplex computed(value);
      const auto nearest = std::min_element(
          truth.begin(), truth.end(), [&](const LongComplex& a, const LongComplex& b) {
            return std::abs(a - computed) < std::abs(b - computed);
          });
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
      Settings settings = inline_settings(model);
      settings.initial.mode = mode;
      LedArm led(model, settings, mode);
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

// Which two real eigenvalues form a mode must not depend on how the gains came to be what they are.
TEST(VibrationInTheTick, PairsRealEigenvaluesAsADirectSolutionDoes) {
  for (const testing::Arm& description : testing::arms()) {
    const RobotModel model = testing::arm_model(description);
    Settings settings = inline_settings(model);
    settings.initial.gains.joint_damping *= 4;  // most modes are overdamped
    settings.initial.gains.task_damping *= 4;
    for (const Mode mode : {Mode::kJoint, Mode::kCartesian}) {
      LedArm arm(model, settings, mode);
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

TEST(VibrationInTheTick, ProvesItsBounds) {
  const RobotModel model = panda();
  const Settings settings = inline_settings(model);
  LedArm led(model, settings, Mode::kCartesian);
  led.settle();
  double largest = 0;
  for (int k = 1; k <= 500; ++k) {
    led.swing(1e-3 * k);
    led.tick();
    const Vibration& modes = led.modes();
    for (int i = 0; i < modes.count; ++i) {
      const VibrationMode& mode = modes.modes[at(i)];
      EXPECT_GT(mode.error_bound, 0);
      largest = std::max(largest, mode.error_bound / std::abs(mode.eigenvalues[1]));
    }
  }
  EXPECT_LT(largest, 1e-9);
}

/// The modes' numbers stay with them: no eigenvalue jumps from tick to tick, even where the order
/// of frequencies changes.
TEST(VibrationInTheTick, KeepsTheNumbersOfModes) {
  std::size_t crossings = 0;
  for (const testing::Arm& arm : testing::arms()) {
    SCOPED_TRACE(arm.file);
    const RobotModel model = testing::arm_model(arm);
    LedArm led(model, inline_settings(model), Mode::kCartesian);
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
        // Of the sum and product, which are smooth where two real eigenvalues meet.
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

TEST(VibrationInTheTick, ComputesNothingWhileNothingChanges) {
  const RobotModel model = panda();
  LedArm led(model, inline_settings(model), Mode::kCartesian);
  led.settle();
  const Vibration before = led.modes();
  for (int k = 0; k < 100; ++k) led.tick();
  const Vibration& after = led.modes();
  EXPECT_EQ(after.counters.unchanged, before.counters.unchanged + 100);
  EXPECT_EQ(after.counters.tracked, before.counters.tracked);
  EXPECT_EQ(after.counters.direct, before.counters.direct);
  EXPECT_EQ(after.origin, SpectrumOrigin::kReused);
  EXPECT_EQ(after.tick, before.tick + 100);
  EXPECT_EQ(after.time, led.state.time);
  for (int i = 0; i < after.count; ++i) {
    EXPECT_EQ(after.modes[at(i)].eigenvalues, before.modes[at(i)].eigenvalues);
  }
  // The smallest motion that there is: the bounds grow to include it.
  led.state.position[3] = std::nextafter(led.state.position[3], 0.0);
  led.tick();
  EXPECT_EQ(led.modes().counters.unchanged, after.counters.unchanged);
  EXPECT_EQ(led.modes().counters.reused, before.counters.reused + 1);
  EXPECT_EQ(led.modes().origin, SpectrumOrigin::kReused);
  EXPECT_GE(led.modes().modes[0].error_bound, before.modes[0].error_bound);
  // And one that matters.
  led.state.position[3] += 1e-4;
  led.tick();
  EXPECT_EQ(led.modes().origin, SpectrumOrigin::kTracked);
}

/// A change of gains is no standing still.
TEST(VibrationInTheTick, SeesGainsChange) {
  const RobotModel model = panda();
  LedArm led(model, inline_settings(model), Mode::kJoint);
  led.settle();
  led.tick();
  const Vibration before = led.modes();
  led.setpoint.gains.joint_stiffness *= 4;
  led.settle();
  const Vibration& after = led.modes();
  ASSERT_EQ(after.count, 7);
  double ratio = 1;
  for (std::size_t i = 0; i < 7; ++i) {
    ratio *= after.modes[i].natural_frequency / before.modes[i].natural_frequency;
  }
  EXPECT_NEAR(ratio, 128, 1e-6);
  std::set<int> labels, old;
  for (std::size_t i = 0; i < 7; ++i) {
    labels.insert(after.modes[i].label);
    old.insert(before.modes[i].label);
  }
  EXPECT_EQ(labels, old);
}

TEST(VibrationInTheTick, IsNotThereIfOff) {
  const RobotModel model = panda();
  Settings settings = inline_settings(model);
  settings.analysis.where = Analysis::Where::kOff;
  LedArm led(model, settings, Mode::kCartesian);
  led.settle();
  EXPECT_EQ(led.modes().tick, 0u);
  EXPECT_EQ(led.modes().count, 0);
  const VibrationCounters& counters = led.modes().counters;
  EXPECT_EQ(counters.tracked + counters.reused + counters.direct + counters.unchanged +
                counters.no_springs + counters.failed + counters.missed,
            0u);
}

TEST(VibrationInTheTick, LeavesOutShapesThatNobodyWants) {
  const RobotModel model = panda();
  Settings settings = inline_settings(model);
  settings.analysis.shapes = false;
  LedArm led(model, settings, Mode::kCartesian);
  settings.analysis.shapes = true;
  LedArm full(model, settings, Mode::kCartesian);
  for (int k = 0; k < 600; ++k) {
    led.swing(1e-3 * k);
    full.swing(1e-3 * k);
    led.tick();
    full.tick();
  }
  ASSERT_EQ(led.modes().count, 7);
  EXPECT_GE(led.modes().counters.no_shapes, led.modes().counters.tracked);
  EXPECT_EQ(full.modes().counters.no_shapes, 0u);
  for (std::size_t i = 0; i < 7; ++i) {
    EXPECT_EQ(led.modes().modes[i].shape.size(), 0);
    EXPECT_EQ(full.modes().modes[i].shape.size(), 7);
    EXPECT_EQ(led.modes().modes[i].eigenvalues, full.modes().modes[i].eigenvalues);
  }
}

/// Published shapes solve the equation of motion and have unit kinetic energy.
TEST(VibrationInTheTick, ShapesBelongToTheClosedLoop) {
  const RobotModel model = panda();
  LedArm led(model, inline_settings(model), Mode::kCartesian);
  led.settle();
  for (int k = 1; k <= 100; ++k) {
    led.swing(1e-3 * k);
    led.tick();
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

TEST(VibrationInTheTick, HasNothingToSolveWithoutSprings) {
  const RobotModel model = panda();
  Settings settings = inline_settings(model);
  settings.watchdog.setpoint_damp = 0.01;
  LedArm led(model, settings, Mode::kJoint);
  led.settle();
  const std::uint64_t solved = led.modes().counters.tracked + led.modes().counters.direct;
  for (int k = 1; k <= 50; ++k) {
    led.swing(1e-3 * k);
    led.state.time += 1'000'000;
    led.controller.update(led.state, led.setpoint, led.torque);
  }
  EXPECT_EQ(led.controller.snapshot().status, Status::kSetpointLost);
  EXPECT_EQ(led.modes().tick, led.controller.snapshot().tick);
  EXPECT_EQ(led.modes().status, analysis::Status::kOk);
  EXPECT_EQ(led.modes().count, 0);
  EXPECT_EQ(led.modes().zero_modes, 7);
  EXPECT_GE(led.modes().counters.no_springs, 35u);
  EXPECT_LE(led.modes().counters.tracked + led.modes().counters.direct, solved + 15);
}

TEST(VibrationInTheTick, TellsZeroModesFromVibrations) {
  const RobotModel model = panda();
  Settings settings = inline_settings(model);
  settings.initial.gains.null_stiffness.setZero();
  LedArm free(model, settings, Mode::kCartesian);
  free.settle();
  for (int k = 1; k <= 100; ++k) {
    free.swing(1e-3 * k);
    free.tick();
  }
  EXPECT_EQ(free.modes().count, 6);
  EXPECT_EQ(free.modes().zero_modes, 1);
  EXPECT_EQ(free.modes().counters.no_zero_modes, 0u);
  EXPECT_GE(free.modes().counters.tracked, 100u);
  LedArm held(model, inline_settings(model), Mode::kCartesian);
  held.settle();
  EXPECT_EQ(held.modes().zero_modes, 0);
  EXPECT_EQ(
      held.modes().counters.no_zero_modes,
      held.modes().counters.tracked + held.modes().counters.direct + held.modes().counters.reused);
}

TEST(VibrationInTheTick, LeavesOutTermsThatAreZero) {
  const RobotModel model = panda();
  Settings settings = inline_settings(model);
  settings.task_terms = {true, true};
  LedArm led(model, settings, Mode::kCartesian);
  led.settle();
  const auto swing = [&](int from) {
    for (int k = from + 1; k <= from + 100; ++k) {
      led.swing(1e-3 * k);
      led.state.velocity.setZero();
      led.tick();
    }
    return led.modes().counters;
  };
  const VibrationCounters before = led.modes().counters;
  const VibrationCounters still = swing(0);
  EXPECT_EQ(still.no_wrench, before.no_wrench + 100);
  EXPECT_EQ(still.at_rest, before.at_rest + 100);
  EXPECT_EQ(still.tracked, before.tracked + 100);
  led.state.external_wrench << 20, 0, -10, 0, 1, 0;
  const VibrationCounters loaded = swing(100);
  EXPECT_EQ(loaded.no_wrench, still.no_wrench);
  EXPECT_EQ(loaded.at_rest, still.at_rest + 100);
  EXPECT_EQ(loaded.direct, still.direct + 100);  // a nonsymmetric stiffness
}

/// Whatever the analysis makes of hostile input, the torque is what it is without.
TEST(VibrationInTheTick, NeverTouchesTheTorque) {
  const RobotModel model = panda();
  Settings settings = testing::HostileTicks::everything_on(model);
  settings.analysis.every = 1;
  settings.task_terms = {true, false};
  Controller with(model, settings);
  settings.analysis.where = Analysis::Where::kOff;
  Controller without(model, settings);
  testing::HostileTicks input(model, settings, 611, 0.02);
  JointVector torque, plain;
  for (int k = 0; k < 20'000; ++k) {
    input.next();
    ASSERT_EQ(with.update(input.state, input.setpoint, torque),
              without.update(input.state, input.setpoint, plain));
    ASSERT_EQ(torque, plain);
    const Vibration& modes = with.vibration();
    ASSERT_TRUE(modes.count > 0 || modes.zero_modes == 7 || modes.status != analysis::Status::kOk ||
                modes.tick == 0);
  }
  const VibrationCounters& counters = with.vibration().counters;
  EXPECT_GT(counters.tracked, 0u);
  EXPECT_GT(counters.direct, 0u);
}

TEST(VibrationInTheTick, ForgetsAtAReset) {
  const RobotModel model = panda();
  LedArm first(model, inline_settings(model), Mode::kCartesian);
  LedArm again(model, inline_settings(model), Mode::kCartesian);
  const auto run = [](LedArm& led) {
    for (int k = 0; k < 600; ++k) {
      led.swing(1e-3 * k);
      led.tick();
    }
  };
  again.setpoint.mode = Mode::kJoint;  // its modes are not those of the Cartesian mode
  run(again);
  again.setpoint.mode = Mode::kCartesian;
  again.controller.reset();
  EXPECT_EQ(again.modes().tick, 0u);
  EXPECT_EQ(again.modes().count, 0);
  EXPECT_EQ(again.modes().counters.tracked, 0u);
  run(again);
  run(first);
  ASSERT_EQ(again.modes().count, 7);
  EXPECT_EQ(again.modes().counters.tracked, first.modes().counters.tracked);
  for (std::size_t i = 0; i < 7; ++i) {
    EXPECT_EQ(again.modes().modes[i].label, first.modes().modes[i].label);
    EXPECT_EQ(again.modes().modes[i].eigenvalues, first.modes().modes[i].eigenvalues);
  }
}

/// Through the stretched posture and back, where the arm loses a direction.
TEST(VibrationInTheTick, GoesThroughASingularity) {
  const RobotModel model = panda();
  Settings settings = inline_settings(model);
  for (const double null_stiffness : {0.0, 20.0}) {
    SCOPED_TRACE(null_stiffness);
    settings.initial.gains.null_stiffness.setConstant(null_stiffness);
    LedArm led(model, settings, Mode::kCartesian);
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
