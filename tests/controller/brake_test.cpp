// The brake, on random arms and states: each claim of brake.hpp.
#include <dashpot/controller/default_settings.hpp>
#include <dashpot/controller/safety/brake.hpp>
#include <dashpot/controller/safety/brake_doubt.hpp>
#include <dashpot/tests/support/arms.hpp>
#include <dashpot/tests/support/matrices.hpp>

#include <gtest/gtest.h>

#include <Eigen/Cholesky>
#include <cmath>
#include <numbers>
#include <random>

namespace dashpot::controller {
namespace {

using testing::near;

/// An arm of sim/models in a random state, with a torque of any size.
class AnyArm {
 public:
  explicit AnyArm(std::mt19937_64& engine)
      : engine_(engine),
        model(testing::arm_model(testing::arms()[engine() % testing::arms().size()])),
        settings(default_settings(model)) {}

  double uniform(double least, double most) {
    return std::uniform_real_distribution<double>(least, most)(engine_);
  }
  /// Joints within their limits with `speed` times their velocity limits at most.
  void draw(double speed, double torque) {
    const int n = model.dof();
    q.resize(n);
    qd.resize(n);
    excess.resize(n);
    for (int i = 0; i < n; ++i) {
      const double lower = std::max(settings.limits.position_lower[i], -3.0);
      const double upper = std::min(settings.limits.position_upper[i], 3.0);
      q[i] = uniform(lower, upper);
      qd[i] = speed * uniform(-1, 1) * settings.limits.velocity[i];
      excess[i] = torque * uniform(-1, 1) * settings.limits.torque[i];
    }
    robot = evaluate(model, q, qd);
  }
  Brake::Motion motion() const { return {q, qd, robot, robot.gravity, nullptr}; }
  JointVector acceleration(const JointVector& torque) const {
    return Eigen::MatrixXd(robot.M).llt().solve(Eigen::VectorXd(torque - robot.coriolis));
  }

 private:
  std::mt19937_64& engine_;

 public:
  RobotModel model;
  Settings settings;
  JointVector q, qd, excess;
  DynamicsResult robot;
};

class BrakeClaims : public ::testing::Test {
 protected:
  BrakeClaims()
      : seed(static_cast<std::uint64_t>(::testing::UnitTest::GetInstance()->random_seed()) + 1),
        engine(seed),
        trace(__FILE__, __LINE__, "seed " + std::to_string(seed)) {}
  std::uint64_t seed;
  std::mt19937_64 engine;
  ::testing::ScopedTrace trace;
};

TEST(BrakeLag, CountsEveryDelayOfTheLoop) {
  Settings settings;
  EXPECT_DOUBLE_EQ(loop_lag(settings), 0.001);
  settings.analysis.sampled.delay = 2;
  EXPECT_DOUBLE_EQ(loop_lag(settings), 0.003);
  settings.analysis.sampled.difference_velocity = true;
  EXPECT_DOUBLE_EQ(loop_lag(settings), 0.0035);
  settings.analysis.sampled.cutoff = 50;
  EXPECT_DOUBLE_EQ(loop_lag(settings), 0.0035 + 0.01 / std::numbers::pi);
}

/// The loop v_k+1 = v_k - period / T v_k-d has its margin wherever it runs.
TEST(BrakeLag, LeavesTheSampledLoopItsMargin) {
  for (const double period : {0.0005, 0.001, 0.004, 0.01}) {
    for (const int delay : {0, 1, 3, 20}) {
      Settings settings;
      settings.period = period;
      settings.analysis.sampled.delay = delay;
      const double T = Brake(settings).stopping_time();
      EXPECT_GE(T, settings.limits.stopping_time);
      const double borne = 2 * std::sin(std::numbers::pi / (2 * (2 * delay + 1)));
      EXPECT_GT(borne * T / period, 9.9) << period << ' ' << delay;
    }
  }
}

/// b = -M qd / T where there is room for it, and never a torque that feeds the arm.
TEST_F(BrakeClaims, StopsAndNeverFeeds) {
  int whole = 0, shrunk = 0;
  for (int arm = 0; arm < 20; ++arm) {
    AnyArm any(engine);
    Brake brake(any.settings);
    for (int k = 0; k < 200; ++k) {
      any.draw(std::pow(10, any.uniform(-2, 3)), 0);
      const JointVector b = brake.stop(any.motion(), 0);
      const JointVector wanted = -any.robot.M * any.qd / brake.stopping_time();
      if (near(b, wanted, 1e-9 * (1 + wanted.norm()))) {
        ++whole;
      } else {
        ++shrunk;
        for (int i = 0; i < any.model.dof(); ++i) {
          const double limit =
              std::max(any.settings.limits.torque[i], std::abs(any.robot.gravity[i]));
          EXPECT_LE(std::abs(any.robot.gravity[i] + b[i]), limit * (1 + 1e-12));
        }
        // What brakes the others drives no joint beyond its velocity limit.
        const JointVector gained = Eigen::MatrixXd(any.robot.M).llt().solve(Eigen::VectorXd(b));
        for (int i = 0; i < any.model.dof(); ++i) {
          const double way = any.qd[i] < 0 ? -1 : 1, limit = any.settings.limits.velocity[i];
          if (way * any.qd[i] >= 0.9 * limit) {
            EXPECT_LE(way * gained[i], 1e-9 * gained.norm()) << i;
          } else {
            EXPECT_LE(way * any.qd[i] + way * gained[i] * 0.01, limit) << i;
          }
        }
      }
      EXPECT_LE(b.dot(any.qd), 0);
    }
  }
  EXPECT_GT(whole, 100);
  EXPECT_GT(shrunk, 100);
}

/// A torque that keeps all bounds stays as it is. Otherwise torques of joints at their bounds are
/// changed alone, each against the way in which its joint would go, and all bounds are kept.
TEST_F(BrakeClaims, HoldsWithTheLeastConstraint) {
  int untouched = 0, held = 0;
  for (int arm = 0; arm < 20; ++arm) {
    AnyArm any(engine);
    Brake brake(any.settings);
    for (int k = 0; k < 200; ++k) {
      any.draw(any.uniform(0, 1.2), std::pow(10, any.uniform(-3, 0.3)));
      JointVector x = any.excess;
      const Status status = brake.hold(any.motion(), x);
      const JointVector change = x - any.excess, after = any.acceleration(x);
      if (status == Status::kOk) {
        ++untouched;
        EXPECT_EQ(x, any.excess);
      } else {
        ++held;
      }
      for (int i = 0; i < any.model.dof(); ++i) {
        const double limit = any.settings.limits.velocity[i];
        // Beyond 0.9 of the limit nothing accelerates a joint further.
        if (any.qd[i] > 0.9 * limit) EXPECT_LT(after[i], 1e-6 * limit / 0.01);
        if (any.qd[i] < -0.9 * limit) EXPECT_GT(after[i], -1e-6 * limit / 0.01);
      }
      // Held as it is, the arm needs no second hold.
      JointVector again = x;
      brake.hold(any.motion(), again);
      EXPECT_TRUE(near(again, x, 1e-6 * (1 + x.norm()))) << change;
    }
  }
  EXPECT_GT(untouched, 100);
  EXPECT_GT(held, 100);
}

/// A joint on whose way there is a limit stops at it (0.05 rad beyond at worst, where others that
/// are coupled with it move), with the torque rate there is, whatever
/// springs ask for: the simulation of one joint after another of each arm.
TEST_F(BrakeClaims, StopsBeforePositionLimits) {
  for (int arm = 0; arm < 12; ++arm) {
    AnyArm any(engine);
    Brake brake(any.settings);
    const Limits& limits = any.settings.limits;
    any.draw(0, 0);
    const int i = static_cast<int>(engine() % static_cast<unsigned>(any.model.dof()));
    if (!std::isfinite(limits.position_upper[i])) continue;
    any.q[i] = 0.5 * (limits.position_lower[i] + limits.position_upper[i]);
    JointVector last = JointVector::Zero(any.model.dof());
    for (int k = 0; k < 4000; ++k) {
      any.robot = evaluate(any.model, any.q, any.qd);
      JointVector others = any.qd;  // stand nearly still
      others[i] = 0;
      JointVector x = -any.robot.M * others / 0.05;
      const double room = limits.torque[i] - std::abs(any.robot.gravity[i]);
      x[i] = 0.3 * std::max(0.2 * limits.torque[i], room);  // outward
      brake.hold(any.motion(), x);
      const JointVector step = limits.torque_rate * any.settings.period;
      x = x.cwiseMax(last - step)
              .cwiseMin(last + step)
              .cwiseMax(-limits.torque)
              .cwiseMin(limits.torque);
      last = x;
      any.qd += any.settings.period * any.acceleration(x);
      any.q += any.settings.period * any.qd;
      ASSERT_LT(any.q[i], limits.position_upper[i] + 0.08) << "joint " << i << " tick " << k;
    }
    EXPECT_GT(any.q[i], limits.position_upper[i] - 0.1);
  }
}

/// A brake that feeds the arm is doubted before the arm is much faster than it may be pushed; one
/// that stops it, holds a wrong weight, or is pushed by hand is not.
TEST_F(BrakeClaims, DoubtsABrakeThatFeeds) {
  for (int arm = 0; arm < 20; ++arm) {
    AnyArm any(engine);
    any.draw(0.3, 0);
    const JointVector start = any.qd;
    for (const double sign : {-1.0, 1.0}) {
      BrakeDoubt doubt(any.settings.limits);
      bool doubted = false;
      double speed = 1;
      for (int k = 0; k < 400 && !doubted; ++k) {
        speed *= 1 + sign * 0.001 / 0.05;
        doubted = doubt.grows(0.001, any.robot, speed * start);
      }
      EXPECT_EQ(doubted, sign > 0);
    }
  }
}

}  // namespace
}  // namespace dashpot::controller
