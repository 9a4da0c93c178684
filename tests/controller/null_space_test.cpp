#include <dashpot/controller/dynamics.hpp>
#include <dashpot/controller/law/gain_blend.hpp>
#include <dashpot/controller/law/null_space.hpp>
#include <dashpot/tests/support/arms.hpp>
#include <dashpot/tests/support/led_arm.hpp>
#include <dashpot/tests/support/matrices.hpp>
#include <dashpot/tests/support/random.hpp>

#include <gtest/gtest.h>

#include <Eigen/Cholesky>
#include <Eigen/Eigenvalues>
#include <Eigen/LU>
#include <algorithm>
#include <cmath>
#include <memory>
#include <string>

namespace dashpot::controller {
namespace {

using Eigen::MatrixXd;
using Eigen::VectorXd;
using testing::near;
using testing::Random;

class NullSpaceOfPanda : public ::testing::Test {
 protected:
  NullSpaceOfPanda() : model(testing::arm_model(testing::arms()[0])), kernel(model) {
    held.selected.setOnes();
    impedance.task_weight = 1;
  }
  void at(const JointVector& q) {
    kernel.evaluate(q, JointVector::Zero(7), robot);
    null_space.compute(robot, impedance);
  }
  /// Stretched out: joints 2, 4 and 6 at zero align the elbow with the rest.
  static JointVector stretched(double bend) {
    return JointVector{{0.3, bend, 0.1, -bend, 0.2, bend, 0.4}};
  }

  RobotModel model;
  DynamicsKernel kernel;
  DynamicsResult robot;
  Impedance impedance{7};
  TipImpedance &held = impedance.base, &tool = impedance.tool;
  NullSpace null_space;
};

/// For every subset of directions, in either frame.
TEST_F(NullSpaceOfPanda, DoesNotAccelerateTheDirectionsThatAreHeld) {
  Random random(331);
  int regular = 0;
  for (int k = 0; k < 600; ++k) {
    const bool in_tool = k % 4 == 0;
    TipImpedance& one = in_tool ? tool : held;
    (in_tool ? held : tool).selected.setZero();
    for (int i = 0; i < 6; ++i) one.selected[i] = k % 2 == 0 ? random.integer(0, 1) : 1;
    at(random.vector(7));
    if (null_space.inertia().regularity() < TaskInertia::kNearlySingular) continue;
    ++regular;
    Jacobian J = robot.J;  // in the frame's axes, of the selected directions
    if (in_tool) {
      J.topRows<3>() = (robot.R_BT.transpose() * J.topRows<3>()).eval();
      J.bottomRows<3>() = (robot.R_BT.transpose() * J.bottomRows<3>()).eval();
    }
    J = (one.selected.asDiagonal() * J).eval();
    const JointVector k0 = 30 * random.vector(7).cwiseAbs(), dq = random.vector(7);
    for (const JointVector& tau : {null_space.spring(k0, dq), null_space.damper(k0, dq)}) {
      const JointVector acceleration = robot.M.llt().solve(tau);
      EXPECT_LT((J * acceleration).norm(), 1e-9 * acceleration.norm());
      EXPECT_GT(tau.norm(), 1e-3);
    }
    EXPECT_LT((J * null_space.projected_velocity(dq)).norm(), 1e-10);
    // What the spring does on its own: qdd = M^-1 N' K_0 dq, along which dq' K_0 dq falls.
    EXPECT_GE(robot.M.llt().solve(null_space.spring(k0, dq)).dot(k0.cwiseProduct(dq)), -1e-10);
    if (k % 2 == 0) continue;
    const Vector6 a = random.vector(6);  // the inertia of the tip
    const MatrixXd mobility = J * robot.M.llt().solve(MatrixXd(J.transpose()));
    const MatrixXd wanted = mobility.inverse() * a;
    EXPECT_TRUE(near(null_space.inertia().wrench(a), wanted, 1e-8 * wanted.norm()));
    EXPECT_TRUE(near(J * null_space.joint_velocity(a), a, 1e-9));
  }
  EXPECT_GT(regular, 300);
}

TEST_F(NullSpaceOfPanda, TorqueKeepsItsBoundAndTurnsSmoothlyThroughTheStretchedArm) {
  double cond = 0;
  for (double bend = -0.5; bend <= 0.5; bend += 0.01) {
    at(stretched(bend));
    const Eigen::SelfAdjointEigenSolver<MatrixXd> values{MatrixXd(robot.M)};
    cond = std::max(cond, values.eigenvalues()[6] / values.eigenvalues()[0]);
  }
  const JointVector k0{{30, 25, 20, 15, 10, 5, 2}}, dq{{0.3, -0.2, 0.5, 0.4, -0.3, 0.2, 0.6}};
  JointVector last;
  double least = 1, largest_step = 0;
  for (int step = -20000; step <= 20000; ++step) {
    at(stretched(1e-5 * step));
    const JointVector spring = null_space.spring(k0, dq), damper = null_space.damper(k0, dq);
    ASSERT_LE(spring.norm(), std::sqrt(cond) * 30 * dq.norm());
    ASSERT_LE(damper.norm(), cond * 30 * dq.norm());
    ASSERT_GE(dq.dot(damper), 0);
    least = std::min(least, null_space.inertia().regularity());
    if (step > -20000) largest_step = std::max(largest_step, (spring - last).norm());
    last = spring;
  }
  EXPECT_LT(least, 1e-6);         // the sweep does meet the singularity
  EXPECT_LT(largest_step, 0.05);  // N m in 1e-5 rad
}

TEST_F(NullSpaceOfPanda, EigenvaluesOfTheProjectorAreBetweenZeroAndOneEverywhere) {
  Random random(334);
  for (int k = 0; k < 200; ++k) {
    for (int i = 0; i < 6; ++i)
      held.selected[i] = random.uniform(0, 1);  // selected in part, while blending
    for (int i = 0; i < 6; ++i) tool.selected[i] = (1 - held.selected[i]) * random.uniform(0, 1);
    held.selected *= 0.5;
    tool.selected *= 0.5;
    at(k % 2 == 0 ? JointVector(random.vector(7)) : stretched(random.log_uniform(1e-9, 1)));
    MatrixXd N(7, 7);
    for (int i = 0; i < 7; ++i) N.col(i) = null_space.projected_velocity(JointVector::Unit(7, i));
    const MatrixXd L = MatrixXd(robot.M).llt().matrixL();
    const MatrixXd P = L.transpose() * N * L.transpose().inverse();
    EXPECT_TRUE(near(P, P.transpose(), 1e-10));
    const Eigen::SelfAdjointEigenSolver<MatrixXd> values(P);
    EXPECT_GE(values.eigenvalues().minCoeff(), -1e-10);
    EXPECT_LE(values.eigenvalues().maxCoeff(), 1 + 1e-10);
  }
}

/// In coordinates z of the free motions (J Z z = 0) the springs' modes belong to Z' K_0 Z and Z' M
/// Z: with one free motion, and with more.
TEST_F(NullSpaceOfPanda, DampsFreeMotionsWithTheRatio) {
  Random random(77);
  for (int k = 0; k < 200; ++k) {
    held.selected.setOnes();
    if (k % 2 == 1) held.selected[k % 6] = held.selected[(k + 2) % 6] = 0;
    const JointVector q = random.vector(7), k0 = 30 * random.vector(7).cwiseAbs();
    impedance.null_stiffness = k0;
    impedance.null_damping_ratio = 0.6;
    at(q);
    if (null_space.inertia().nearly_singular()) continue;
    MatrixXd C(7, 7);
    for (int j = 0; j < 7; ++j) C.col(j) = null_space.ratio_damper(JointVector::Unit(7, j));
    const MatrixXd M = robot.M, J = held.selected.asDiagonal() * robot.J;
    const MatrixXd Z = Eigen::FullPivLU<MatrixXd>(J).kernel();
    const Eigen::GeneralizedSelfAdjointEigenSolver<MatrixXd> modes(
        Z.transpose() * k0.asDiagonal() * Z, Z.transpose() * M * Z);
    const MatrixXd shapes = Z * modes.eigenvectors();
    const MatrixXd wanted = (1.2 * modes.eigenvalues().cwiseSqrt()).asDiagonal();
    ASSERT_EQ(Z.cols(), k % 2 == 1 ? 3 : 1);
    EXPECT_TRUE(near(shapes.transpose() * C * shapes, wanted, 1e-6 * wanted.norm()));
    EXPECT_LT((J * M.llt().solve(C)).norm(), 1e-6 * M.llt().solve(C).norm());
    EXPECT_LT((C - C.transpose()).norm(), 1e-12 * C.norm());
  }
}

double least_eigenvalue(const MatrixXd& A) {
  return Eigen::SelfAdjointEigenSolver<MatrixXd>(A).eigenvalues().minCoeff() / (1 + A.norm());
}

TEST(GainBlend, StaysPositiveSemidefiniteAndArrives) {
  Random random(336);
  constexpr int kTicks = 50;
  GainBlend path(kTicks, Impedance(7));
  Impedance target(7);
  for (int change = 0; change < 60; ++change) {
    Setpoint setpoint;
    setpoint.mode = random.integer(0, 1) == 0 ? Mode::kJoint : Mode::kCartesian;
    Gains& gains = setpoint.gains;
    const MatrixXd thin = random.matrix(7, 3), flat = random.matrix(6, 2);  // singular ones too
    gains.joint_stiffness = 1e3 * thin * thin.transpose();
    gains.joint_damping = random.spd(7);
    gains.task_stiffness = 1e4 * flat * flat.transpose();
    gains.task_damping = random.spd(6);
    gains.frame = random.integer(0, 1) == 0 ? Frame::kBase : Frame::kTool;
    gains.null_stiffness = gains.null_damping = random.vector(7).cwiseAbs();
    target = Impedance(setpoint, 7);
    const Impedance from = path.now();
    path.set_target(target);
    const int ticks = random.integer(1, 2 * kTicks);
    Impedance last = from;
    for (int k = 0; k < ticks; ++k) {
      path.step();
      const Impedance& now = path.now();
      for (const MatrixXd& A : {MatrixXd(now.joint_stiffness), MatrixXd(now.joint_damping),
                                MatrixXd(now.base.stiffness), MatrixXd(now.tool.stiffness),
                                MatrixXd(now.base.damping), MatrixXd(now.tool.damping)}) {
        EXPECT_GE(least_eigenvalue(A), -1e-14);
      }
      // At a bounded rate
      EXPECT_LE((now.base.stiffness - last.base.stiffness).norm(),
                (target.base.stiffness - from.base.stiffness).norm() * 1.001 / kTicks + 1e-9);
      last = now;
    }
    if (ticks >= kTicks) {
      EXPECT_EQ(path.now().joint_stiffness, target.joint_stiffness);
      EXPECT_EQ(path.now().tool.damping, target.tool.damping);
      EXPECT_EQ(path.now().task_weight, target.task_weight);
    }
  }
}

TEST(GainBlend, FollowsTargetsThatComeEveryTick) {
  Ramp<Vector6> path(100, Vector6::Zero());
  for (int k = 0; k < 1000; ++k) {
    path.set_target(Vector6::Constant(1 + 1e-9 * k));
    path.step();
  }
  EXPECT_TRUE(near(path.now(), Vector6(Vector6::Ones()), 1e-4));
}

/// The arm stands still, so that nothing but the blend changes the torque.
TEST(ProjectorSwitch, EndsInTheLoopThatHadTheProjectorFromTheStart) {
  const RobotModel model = testing::smooth_panda();
  Settings settings = testing::in_mode(testing::unlimited_settings(model), Mode::kCartesian);
  settings.null_weights = JointVector::LinSpaced(7, 0.3, 3);
  settings.initial.gains.null_stiffness.setConstant(7, 40);
  settings.initial.gains.null_damping.setConstant(7, 2);
  const auto displaced = [&](NullProjector projector) {
    settings.initial.gains.null_projector = projector;
    auto led = std::make_unique<testing::LedArm>(model, settings);
    led->settle();
    led->place(led->center + JointVector(JointVector::LinSpaced(7, -0.05, 0.1)));
    led->state.velocity.setConstant(0.05);
    led->settle();
    return led;
  };
  for (const auto& [from, first] : kNullProjectors) {
    for (const auto& [to, second] : kNullProjectors) {
      if (first == second) continue;
      SCOPED_TRACE(std::string(from) + " to " + std::string(to));
      const auto led = displaced(first), wanted = displaced(second);
      const auto torque = [&] { return VectorXd(led->controller.snapshot().law_torque); };
      const VectorXd before = torque();
      led->setpoint.gains.null_projector = second;
      double largest = 0;
      const long ticks = std::lround(1000 * settings.motion.gain_time);
      for (long k = 0; k <= ticks; ++k) {
        const VectorXd last = torque();
        led->tick();
        largest = std::max(largest, (torque() - last).norm());
      }
      const double change = (torque() - before).norm();
      EXPECT_GT(change, 0.2);
      EXPECT_LT(largest, 5 * change / static_cast<double>(ticks));
      EXPECT_TRUE(near(torque(), wanted->controller.snapshot().law_torque, 1e-9));
      ASSERT_EQ(led->modes().count, 7);
      for (int i = 0; i < 7; ++i) {
        const VibrationMode &found = led->modes().modes[testing::at(i)],
                            &known = wanted->modes().modes[testing::at(i)];
        EXPECT_NEAR(found.natural_frequency, known.natural_frequency, 1e-8);
        EXPECT_NEAR(found.damping_ratio, known.damping_ratio, 1e-8);
      }
    }
  }
}

TEST(ProjectorSwitch, AStartBlendsGainsOnly) {
  const RobotModel model = testing::smooth_panda();
  Settings settings = testing::in_mode(testing::unlimited_settings(model), Mode::kCartesian);
  settings.initial.gains.null_damping.setConstant(7, 2);
  settings.initial.gains.null_projector = NullProjector::kKinematic;
  settings.feed_forward = {false, false, false, false, false};
  testing::LedArm led(model, settings);
  led.state.velocity.setConstant(0.05);
  led.settle();
  const VectorXd whole = led.controller.snapshot().law_torque;
  led.controller.reset();
  const long ticks = std::lround(1000 * settings.motion.gain_time);
  for (long k = 1; k < ticks; ++k) {
    led.tick();
    const VectorXd torque = led.controller.snapshot().law_torque;
    EXPECT_LT((torque - torque.dot(whole) / whole.squaredNorm() * whole).norm(),
              1e-6 * whole.norm());
  }
}

}  // namespace
}  // namespace dashpot::controller
