// The brake, on random arms and states: each claim of brake.hpp.
#include <dashpot/controller/attachment.hpp>
#include <dashpot/controller/default_settings.hpp>
#include <dashpot/controller/safety/brake.hpp>
#include <dashpot/controller/settings_check.hpp>
#include <dashpot/tests/support/arms.hpp>
#include <dashpot/tests/support/chains.hpp>
#include <dashpot/tests/support/matrices.hpp>

#include <gtest/gtest.h>

#include <Eigen/Cholesky>
#include <cmath>
#include <numbers>
#include <random>
#include <string>
#include <vector>

namespace dashpot::controller {
namespace {

using testing::near;

/// An arm of sim/models in a random state, with a torque of any size.
class AnyArm {
 public:
  explicit AnyArm(std::mt19937_64& engine)
      : AnyArm(engine, testing::arm_model(testing::arms()[engine() % testing::arms().size()])) {}
  AnyArm(std::mt19937_64& engine, const RobotModel& of)
      : engine_(engine), model(of), settings(default_settings(model)) {}

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

/// A stop that is slow because the loop is late has to be set.
TEST(BrakeLag, HasToBeToldWhereItIsLong) {
  const RobotModel model = testing::chain_of({"revolute", "revolute"});
  Settings settings = default_settings(model);
  settings.analysis.sampled.cutoff = 5;
  EXPECT_NO_THROW(validate(settings, model));
  settings.analysis.sampled.cutoff = 1;
  EXPECT_THROW(validate(settings, model), InvalidSettings);
  settings.limits.stopping_time = 1.6;
  EXPECT_NO_THROW(validate(settings, model));
}

/// (x' - x)' M^-1 (x' - x) -> min with |w + x'| <= torque and way M^-1 x' <= most, by Hildreth's
/// way: one bound after the other is met in this metric, again and again.
JointVector least_constraint(const AnyArm& any, const JointVector& wanted,
                             const Eigen::MatrixXd& most) {
  const int n = any.model.dof();
  const Eigen::MatrixXd M = any.robot.M, W = M.inverse();
  const JointVector& torque = any.settings.limits.torque;
  Eigen::VectorXd x = wanted;
  Eigen::MatrixXd factors = Eigen::MatrixXd::Zero(n, 4);
  for (int sweep = 0; sweep < 20000; ++sweep) {
    double change = 0;
    for (int i = 0; i < n; ++i) {
      for (int side = 0; side < 4; ++side) {
        const double way = side % 2 == 0 ? 1 : -1;
        const bool box = side < 2;
        const double bound = box ? torque[i] - way * any.robot.gravity[i] : most(i, side - 2);
        const double beyond = way * (box ? x[i] : W.row(i).dot(x)) - bound;
        const double step = std::max(beyond / (box ? M(i, i) : W(i, i)), -factors(i, side));
        factors(i, side) += step;
        x -= way * step * (box ? Eigen::VectorXd(M.col(i)) : Eigen::VectorXd::Unit(n, i));
        change = std::max(change, std::abs(step) * (box ? M(i, i) : 1.0));
      }
    }
    if (change < 1e-11) break;
  }
  return x;
}

/// A stop is -M qd / T if there is room for it, otherwise the least constraint by another method,
/// which never feeds the arm and moves no joint beyond 0.9 of its velocity limit.
TEST_F(BrakeClaims, StopsWithTheLeastConstraintAndNeverFeeds) {
  int whole = 0, limited = 0;
  for (int arm = 0; arm < 20; ++arm) {
    AnyArm any(engine);
    const int n = any.model.dof();
    any.settings.limits.torque_rate.setConstant(1e12);
    any.settings.limits.position_lower.setConstant(-1e6);
    any.settings.limits.position_upper.setConstant(1e6);
    Brake brake(any.settings);
    const double t = 0.2 * any.settings.limits.stopping_time;
    for (int k = 0; k < 50; ++k) {
      any.draw(std::pow(10, any.uniform(-2, 1)), 0);
      const JointVector& limit = any.settings.limits.torque;
      if ((any.robot.gravity.cwiseAbs() - limit).maxCoeff() > 0) continue;
      const JointVector wanted = -any.robot.M * any.qd / brake.stopping_time();
      JointVector x = brake.stop(any.motion(), 0);
      ASSERT_TRUE(near(x, wanted, 1e-9 * (1 + wanted.norm())));
      const Status status = brake.constrain(any.motion(), any.robot.gravity, true, x);
      (status == Status::kOk ? whole : limited) += 1;
      Eigen::MatrixXd most(n, 2);
      for (int i = 0; i < n; ++i) {
        const double full = 0.85 * any.settings.limits.velocity[i];
        most(i, 0) = std::max(0.0, (full - any.qd[i]) / t);
        most(i, 1) = std::max(0.0, (full + any.qd[i]) / t);
      }
      const JointVector least = least_constraint(any, wanted, most);
      const Eigen::LLT<Eigen::MatrixXd> llt((Eigen::MatrixXd(any.robot.M)));
      const auto missed = [&](const JointVector& y) {
        return std::sqrt((y - wanted).dot(llt.solve(Eigen::VectorXd(y - wanted))));
      };
      EXPECT_NEAR(missed(x), missed(least), 1e-3 * missed(least) + 1e-6) << x << "\n\n" << least;
      EXPECT_LE((any.robot.gravity + x).cwiseAbs().cwiseQuotient(limit).maxCoeff(), 1 + 1e-9);
      const JointVector gained = llt.solve(Eigen::VectorXd(x));
      EXPECT_LE((gained - most.col(0)).maxCoeff(), 1e-3 * (1 + gained.norm()));
      EXPECT_LE((-gained - most.col(1)).maxCoeff(), 1e-3 * (1 + gained.norm()));
      EXPECT_LE(x.dot(any.qd), -0.5 * brake.stopping_time() * x.dot(gained) * (1 - 1e-6));
    }
  }
  EXPECT_GT(whole, 100);
  EXPECT_GT(limited, 100);
}

/// The torque changes at most by the torque rate, also where a joint was driven.
TEST_F(BrakeClaims, KeepsTorquesAndTheirRates) {
  for (int arm = 0; arm < 20; ++arm) {
    // Bounds of 16 joints in a plane are nearly dependent, and many act at once.
    AnyArm any = arm > 0
                     ? AnyArm(engine)
                     : AnyArm(engine, testing::chain_of(std::vector<std::string>(16, "revolute")));
    Brake brake(any.settings);
    const Limits& limits = any.settings.limits;
    for (int k = 0; k < 200; ++k) {
      any.draw(any.uniform(0, 1.5), 1.0);
      const JointVector last = any.excess;
      any.draw(any.uniform(0, 1.5), 2.0);
      const bool stops = k % 2 == 0;
      JointVector x = stops ? brake.stop(any.motion(), 1) : any.excess;
      brake.constrain(any.motion(), last, stops, x);
      for (int i = 0; i < any.model.dof(); ++i) {
        const double torque = limits.torque[i], step = 0.001 * limits.torque_rate[i];
        const double tau = std::clamp(any.robot.gravity[i], -torque, torque) + x[i];
        EXPECT_LE(std::abs(tau), torque * (1 + 1e-4)) << i;
        EXPECT_LE(std::abs(tau - last[i]), step + 1e-3 * torque) << i;
      }
    }
  }
}

/// A torque that keeps all bounds stays as it is, and else all bounds are kept.
TEST_F(BrakeClaims, HoldsJointsWithinTheirVelocities) {
  int untouched = 0, held = 0;
  for (int arm = 0; arm < 20; ++arm) {
    AnyArm any(engine);
    any.settings.limits.torque *= 100;  // nothing but accelerations is bounded
    any.settings.limits.torque_rate *= 1e6;
    Brake brake(any.settings);
    for (int k = 0; k < 200; ++k) {
      any.draw(any.uniform(0, 1.2), std::pow(10, any.uniform(-5, -1.7)));
      JointVector x = any.excess;
      const Status status = brake.constrain(any.motion(), any.robot.gravity, false, x);
      const JointVector after = any.acceleration(x);
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
      brake.constrain(any.motion(), any.robot.gravity, false, again);
      EXPECT_TRUE(near(again, x, 1e-4 * (1 + x.norm()))) << again - x;
    }
  }
  EXPECT_GT(untouched, 100);
  EXPECT_GT(held, 100);
}

/// A joint on whose way there is a limit stops before it, or by 0.12 rad beyond where others that
/// are coupled with it move, whatever springs ask for, as far as the weight leaves torque.
TEST_F(BrakeClaims, StopsBeforePositionLimits) {
  int arrived = 0, beyond = 0;  // at the end
  for (int arm = 0; arm < 12; ++arm) {
    AnyArm any(engine);
    Brake brake(any.settings);
    const Limits& limits = any.settings.limits;
    any.draw(0, 0);
    const int i = static_cast<int>(engine() % static_cast<unsigned>(any.model.dof()));
    if (!std::isfinite(limits.position_upper[i])) continue;
    any.q[i] = 0.5 * (limits.position_lower[i] + limits.position_upper[i]);
    any.robot = evaluate(any.model, any.q, any.qd);
    JointVector last = any.robot.gravity;
    for (int k = 0; k < 4000; ++k) {
      any.robot = evaluate(any.model, any.q, any.qd);
      if ((any.robot.gravity.cwiseAbs() - 0.8 * limits.torque).maxCoeff() > 0) break;
      JointVector others = any.qd;  // stand nearly still
      others[i] = 0;
      JointVector x = -any.robot.M * others / 0.05;
      const double room = limits.torque[i] - std::abs(any.robot.gravity[i]);
      x[i] = 0.3 * std::max(0.2 * limits.torque[i], room);  // outward
      brake.constrain(any.motion(), last, false, x);
      last = any.robot.gravity + x;
      any.qd += any.settings.period * any.acceleration(x);
      any.q += any.settings.period * any.qd;
      ASSERT_LT(any.q[i], limits.position_upper[i] + 0.12) << "joint " << i << " tick " << k;
      if (k == 3999) arrived += any.q[i] > limits.position_upper[i] - 0.1 ? 1 : 0;
      if (k == 3999) beyond += any.q[i] > limits.position_upper[i] ? 1 : 0;
    }
  }
  EXPECT_GT(arrived, 4);
  EXPECT_LE(beyond, 1);
}

/// Values that the brake keeps of earlier ticks save work and change nothing: a brake without them
/// gives the same torque, also when the payload is dropped.
TEST_F(BrakeClaims, RemembersNothingThatMatters) {
  int held = 0, ticks = 0;
  for (int arm = 0; arm < 12; ++arm) {
    AnyArm any(engine);
    any.settings.limits.torque_rate *= 10;  // so that torques change much from tick to tick
    any.settings.limits.position_lower.setConstant(-1e6);
    any.settings.limits.position_upper.setConstant(1e6);
    any.draw(0.5, 0);
    const RobotModel loaded = any.model.with({{3, {0, 0.02, 0.1}}, {}});
    Brake brake(any.settings);
    const Limits& limits = any.settings.limits;
    JointVector last = any.robot.gravity, push = 0 * last;
    for (int k = 0; k < 1500; ++k) {
      any.robot = evaluate(k < 700 ? loaded : any.model, any.q, any.qd);
      for (int i = 0; i < any.model.dof(); ++i) {
        const double size = 0.2 * limits.torque[i] * std::pow(0.1, (k / 100) % 3);
        push[i] += 0.02 * (size * any.uniform(-1, 1) - push[i]) + (k % 150 == 0 ? size : 0);
      }
      JointVector x = push - any.robot.M * any.qd / 0.2, fresh = x;
      const Status status = brake.constrain(any.motion(), last, false, x);
      ASSERT_EQ(Brake(any.settings).constrain(any.motion(), last, false, fresh), status) << k;
      ASSERT_TRUE(near(x, fresh, 1e-9 * (1 + x.norm()))) << "tick " << k << '\n' << x - fresh;
      held += status == Status::kOk ? 0 : 1;
      ++ticks;
      last = any.robot.gravity.cwiseMax(-limits.torque).cwiseMin(limits.torque) + x;
      any.qd += any.settings.period * any.acceleration(x);
      any.q += any.settings.period * any.qd;
    }
  }
  EXPECT_GT(held, ticks / 100);
  EXPECT_LT(held, 99 * ticks / 100);
}

/// A brake that feeds the arm is doubted before the arm is much faster than a hand may push it. A
/// brake that stops the arm, holds a wrong weight, or is pushed by hand is not doubted.
TEST_F(BrakeClaims, DoubtsABrakeThatFeeds) {
  for (int arm = 0; arm < 20; ++arm) {
    AnyArm any(engine);
    any.draw(0.3, 0);
    const JointVector start = any.qd;
    for (const double sign : {-1.0, 1.0}) {
      Brake brake(any.settings);
      any.qd = start;
      for (int k = 0; k < 400 && !brake.feeds(); ++k) {
        any.qd *= 1 + sign * 0.001 / 0.05;
        brake.watch(any.motion());
      }
      EXPECT_EQ(brake.feeds(), sign > 0);
      EXPECT_EQ(brake.stopping_time(), any.settings.limits.stopping_time);
    }
  }
}

/// A standing arm resists a joint that yields, unless no torque is left for it: the resistance
/// would drive the other joints in its place. It takes half of a torque limit at most, and what
/// comes back where it was is resisted no more.
TEST_F(BrakeClaims, ResistsWhatItHasTorqueFor) {
  for (int arm = 0; arm < 20; ++arm) {
    AnyArm any(engine);
    any.settings.limits.position_lower.setConstant(-1e6);
    any.settings.limits.position_upper.setConstant(1e6);
    any.draw(0, 0);
    const Eigen::Index yielding =
        std::uniform_int_distribution<Eigen::Index>(0, any.model.dof() - 1)(engine);
    JointVector weight = 0 * any.q;
    for (const double share : {0.8, 1.0}) {
      weight[yielding] = share * any.settings.limits.torque[yielding];
      const Brake::Motion motion{any.q, any.qd, any.robot, weight, nullptr};
      Brake brake(any.settings);
      JointVector x;
      for (int k = 0; k <= 40; ++k) {
        x = brake.stop(motion, 0, Brake::Resistance::kGrows);
        if (k == 20) EXPECT_EQ(x.norm() > 0, share < 1) << x;
        any.q[yielding] += k < 20 ? -1e-6 : 1e-6;
      }
      if (share < 1) EXPECT_LE(x.norm(), 1e-9 * any.robot.M.norm());
    }
    for (const double way : {-1.0, 1.0}) {
      Brake brake(any.settings);
      weight.setZero();
      JointVector x;
      for (int k = 0; k < 2000; ++k) {
        x = brake.stop({any.q, any.qd, any.robot, weight, nullptr}, 0, Brake::Resistance::kGrows);
        any.q[yielding] += 10 * way;
      }
      const JointVector most = 0.5 * any.settings.limits.torque;
      EXPECT_NEAR(x[yielding], -way * most[yielding], 1e-9 * most[yielding]);
      EXPECT_LE((x.cwiseAbs() - most).maxCoeff(), 1e-9 * most.norm()) << x;
    }
  }
}

/// A joint that moves fast against its whole torque is not resisted further.
TEST_F(BrakeClaims, LetsYieldWhatIsFast) {
  for (int arm = 0; arm < 20; ++arm) {
    AnyArm any(engine);
    any.draw(0, 0);
    const JointVector weight = 0 * any.q;
    for (const double speed : {0.4, 0.6}) {
      for (const double torque : {-1.0, 0.9, 1.0}) {  // the joint moves down
        Brake brake(any.settings);
        any.qd.setZero();
        const Brake::Motion motion{any.q, any.qd, any.robot, weight, nullptr};
        brake.stop(motion, 0, Brake::Resistance::kGrows);  // the arm stands
        any.qd[1] = -speed * any.settings.limits.velocity[1];
        brake.limited(motion, torque * any.settings.limits.torque);
        for (int k = 0; k < 100; ++k) {
          if (k >= 50) any.q[1] -= 1e-6;  // the velocity is known by then
          brake.stop(motion, 0, Brake::Resistance::kGrows);
        }
        any.qd.setZero();
        for (int k = 0; k < 1000; ++k) brake.stop(motion, 0, Brake::Resistance::kGrows);
        const double resistance = brake.stop(motion, 0)[1];
        EXPECT_EQ(resistance > 1e-9 * any.robot.M(1, 1), speed < 0.5 || torque < 1)
            << speed << ' ' << torque;
      }
    }
  }
}

/// A brake that shakes a joint gets softer, though the mean velocity of the joint is small. Noise
/// does not make it softer.
TEST_F(BrakeClaims, SoftensWhereAJointShakes) {
  for (int arm = 0; arm < 20; ++arm) {
    AnyArm any(engine);
    any.draw(0, 0);
    const JointVector fast = 0.9 * any.settings.limits.velocity;
    const Eigen::Index last = any.model.dof() - 1;
    const double shake = std::sqrt(fast.dot(any.robot.M * fast) / any.robot.M(last, last));
    for (const double share : {0.4, 1.0}) {
      Brake brake(any.settings);
      for (int k = 0; k < 300; ++k) {
        any.qd = std::max(0.05, std::exp(-0.02 * k)) * fast;
        if (k >= 150) any.qd[last] = (k % 2 == 0 ? share : -share) * shake;
        brake.stop(any.motion(), 0, Brake::Resistance::kGrows);
        brake.watch(any.motion());
      }
      EXPECT_EQ(brake.stopping_time() > any.settings.limits.stopping_time, share == 1);
    }
  }
}

}  // namespace
}  // namespace dashpot::controller
