// The watch by itself, on two joints whose dynamics are given by hand.
#include <dashpot/controller/default_settings.hpp>
#include <dashpot/controller/safety/motion_watch.hpp>
#include <dashpot/tests/support/chains.hpp>

#include <gtest/gtest.h>

#include <cmath>
#include <functional>
#include <limits>
#include <numbers>
#include <optional>

namespace dashpot::controller {
namespace {

using Pair = Eigen::Vector2d;

class WatchedPair : public ::testing::Test {
 protected:
  WatchedPair()
      : model(testing::chain_of({"revolute", "revolute"})), settings(default_settings(model)) {
    settings.limits.tip_velocity = 1.5;
    settings.watchdog.feedback = 0;
    robot.M = Eigen::Matrix2d{{2, 0.5}, {0.5, 1}};
    robot.coriolis = Pair::Zero();
    robot.gravity = Pair(7, -3);
    robot.J.setZero(6, 2);
    robot.J.topRows<3>() << 0.5, 0.25, 0, 0.5, 0, 0;
    robot.Jdot_qd.setZero();
    robot.p_BT_B = {0.5, 0, 0.2};
    robot.R_BT.setIdentity();
  }
  void make() { watch.emplace(model, settings); }
  /// A tick at q and qd, and the torque then applied: the weight and `excess`.
  Status tick(const Pair& excess = Pair::Zero(), double dt = 0.001) {
    if (!watch) make();
    const Status status = watch->check({dt, q, qd, robot, wrench, still, brakes});
    const Pair weight = settings.feed_forward.gravity ? Pair(robot.gravity) : Pair(Pair::Zero());
    watch->applied(weight + excess, weight);
    return status;
  }
  /// Ticks until the status is not kOk any more; `before` is called before each.
  int ticks_until(Status expected, const std::function<void(int)>& before,
                  const std::function<Pair(int)>& excess) {
    for (int k = 1; k <= 5000; ++k) {
      before(k);
      const Status status = tick(excess(k));
      if (status == Status::kOk) continue;
      EXPECT_EQ(status, expected);
      return k;
    }
    return 0;
  }

  RobotModel model;
  Settings settings;
  std::optional<MotionWatch> watch;
  DynamicsResult robot;
  Vector6 wrench = Vector6::Zero();
  Pair q{0.3, 0.4}, qd = Pair::Zero();
  bool still = true, brakes = false;
};

TEST_F(WatchedPair, KeepsToTheLimitsThemselves) {
  settings.limits.position_lower = Pair(-1, -2);
  settings.limits.position_upper = Pair(1, 2);
  settings.limits.walls = {{{0, 0, 0.1}, Eigen::Vector3d::UnitZ()},
                           {{0.5, 0, 0}, -Eigen::Vector3d::UnitX()}};  // which the tip touches
  q = {1, -2};
  EXPECT_EQ(tick(), Status::kOk);
  EXPECT_EQ(watch->tip_speed(), 0);
  qd = {2, -2};
  EXPECT_EQ(tick(), Status::kOk);
  EXPECT_DOUBLE_EQ(watch->tip_speed(), std::sqrt(0.25 + 1));
  for (const Pair& beyond : {Pair(1.001, 0), Pair(-1.001, 0), Pair(0, 2.001), Pair(0, -2.001)}) {
    q = beyond;
    EXPECT_EQ(tick(), Status::kPositionLimit);
  }
  q = {0, 0};
  robot.p_BT_B.x() = 0.501;
  EXPECT_EQ(tick(), Status::kWall);
  robot.p_BT_B.x() = 0.5;
  for (const Pair& fast : {Pair(2.001, 0), Pair(0, -2.001)}) {
    qd = fast;
    EXPECT_EQ(tick(), Status::kVelocityLimit);
  }
  qd = {0, 2};
  settings.limits.tip_velocity = std::sqrt(0.25 + 1);
  make();
  EXPECT_EQ(tick(), Status::kOk);
  qd = {2, 2};  // its parts are 1.5 and 1 m/s
  EXPECT_EQ(tick(), Status::kTipSpeedLimit);
  EXPECT_DOUBLE_EQ(watch->tip_speed(), std::sqrt(1.5 * 1.5 + 1));
}

/// r after k ticks of a constant external torque is (1 - 0.9^k) times it.
TEST_F(WatchedPair, EstimatesExternalTorqueWithATimeConstantOf10Milliseconds) {
  for (const bool compensates : {true, false}) {  // otherwise the robot holds its weight itself
    settings.feed_forward.gravity = compensates;
    settings.limits.external_torque = Pair(4, std::numeric_limits<double>::infinity());
    make();
    for (int k = 0; k < 200; ++k) ASSERT_EQ(tick({3.9, 100}), Status::kOk) << compensates;
    make();
    tick({-8, 0});
    EXPECT_EQ(ticks_until(
                  Status::kCollision, [](int) {}, [](int) { return Pair(-8, 0); }),
              7);
    make();  // Coriolis torque and acceleration count
    robot.coriolis = Pair(5, 0);
    for (int k = 0; k < 200; ++k) {
      qd = {0.002 * k, 0.004 * k};  // 2 and 4 rad/s^2: 4 + 2 = 6 N m
      ASSERT_EQ(tick({11, 0}), Status::kOk) << k;
    }
    const double start = qd[0];
    EXPECT_EQ(ticks_until(
                  Status::kCollision,
                  [&](int k) {
                    qd = {start - 0.001 * k, qd[1] + 0.004};
                  },  // -1: 2 for 4
                  [](int) { return Pair(11, 0); }),
              11);
    robot.coriolis.setZero();
    qd.setZero();
  }
}

TEST_F(WatchedPair, KnowsNoAccelerationAtTheFirstTick) {
  settings.limits.external_torque = Pair(4, 4);
  qd = {1, 1};
  EXPECT_EQ(tick(), Status::kOk);
  EXPECT_EQ(tick(), Status::kOk);
  watch->reset();
  qd = {-1, -1};
  EXPECT_EQ(tick(), Status::kOk);
}

/// A tick as long as the time constant, or longer, takes the torque as it is.
TEST_F(WatchedPair, EstimatesNoMoreThanIsThereAfterALongTick) {
  settings.limits.external_torque = Pair(4, 4);
  tick({3.9, 0});
  EXPECT_EQ(tick({3.9, 0}, 0.1), Status::kOk);
  EXPECT_EQ(tick({4.1, 0}, 0.1), Status::kOk);
  EXPECT_EQ(tick({0, 0}, 0.1), Status::kCollision);
}

/// Between two good states several torques may have been put out.
TEST_F(WatchedPair, EstimatesWithTheMeanOfWhatWasAppliedMeanwhile) {
  settings.limits.external_torque = Pair(4, 4);
  tick();
  const auto also = [&](const Pair& excess) {
    watch->applied(robot.gravity + excess, robot.gravity);
  };
  also({-3, 0});
  also({-6, 0});
  EXPECT_EQ(tick({0, 0}, 0.1), Status::kOk);  // -3 of 4
  also({-9, 0});
  EXPECT_EQ(tick({0, 0}, 0.1), Status::kCollision);  // -4.5
  EXPECT_EQ(tick({0, 0}, 0.1), Status::kOk);         // all that is over
}

TEST_F(WatchedPair, BelievesTheForceThatTheRobotReports) {
  settings.limits.external_force = 5;
  wrench << 3, 0, -4, 100, 100, 100;
  EXPECT_EQ(tick(), Status::kOk);
  wrench[0] = 3.001;
  EXPECT_EQ(tick(), Status::kCollision);
}

/// Half swings of this many ticks, each faster than the one before by `growth`.
class GrowingSwings : public WatchedPair {
 protected:
  int ticks(double growth, double first, int half = 5, int most = 5000) {
    return ticks_until(
        Status::kInstability,
        [&](int k) {
          const int swing = std::min((k - 1) / half, most);
          qd = {0.01, (swing % 2 == 0 ? 1 : -1) * first * std::pow(growth, swing)};
        },
        [](int) { return Pair(Pair::Zero()); });
  }
};

TEST_F(GrowingSwings, LatchOnceTenHaveGrownAndTheyAreLarge) {
  make();
  EXPECT_EQ(ticks(1.021, 0.3), 5 * 10 + 1);  // the first grows from rest
  make();
  EXPECT_EQ(ticks(1.019, 0.3, 5, 10), 0);
  make();
  EXPECT_EQ(ticks(1.1, 0.01), 5 * 32 + 1);  // above a tenth of 2 rad/s
  make();
  still = false;
  EXPECT_EQ(ticks(1.05, 0.3, 5, 30), 0);
}

/// A vibration, beside a motion that is as fast and springs that move, is found within a second. A
/// person who shakes the arm, a decay, and a small vibration do not count.
TEST_F(WatchedPair, TellsVibrationsFromShaking) {
  const auto found = [&](double share, double hertz, double decay) {
    make();
    still = false;
    const auto speed = [&](int k) {
      const double t = 1e-3 * k;
      return 2 * (0.3 * std::sin(3 * t) +
                  share * std::exp(-decay * t) * std::sin(2 * std::numbers::pi * hertz * t));
    };
    return ticks_until(
        Status::kInstability,
        [&](int k) {
          qd = {0.01, speed(k)};
        },
        [](int) { return Pair(Pair::Zero()); });
  };
  for (const double hertz : {6.5, 10.0, 30.0, 150.0}) {
    const int ticks = found(0.25, hertz, 0);
    EXPECT_GT(ticks, 300) << hertz;
    EXPECT_LT(ticks, 1000) << hertz;
    EXPECT_EQ(found(0.14, hertz, 0), 0) << hertz;
    EXPECT_EQ(found(0.9, hertz, 5), 0) << hertz;
  }
  for (const double hertz : {0.5, 2.0, 4.0, 5.0}) EXPECT_EQ(found(0.7, hertz, 0), 0) << hertz;
}

TEST_F(GrowingSwings, CountFromTheLastThatDidNotGrow) {
  make();
  const auto swing = [&](double speed) {
    qd[1] = speed;
    Status status = Status::kOk;
    for (int k = 0; k < 5; ++k) status = worse(status, tick());
    return status;
  };
  double speed = 0.3;
  for (int k = 0; k < 9; ++k) EXPECT_EQ(swing(speed *= -1.03), Status::kOk);
  EXPECT_EQ(swing(speed *= -0.99), Status::kOk);  // nine have grown, one has not
  for (int k = 0; k < 10; ++k) EXPECT_EQ(swing(speed *= -1.03), Status::kOk) << k;
  EXPECT_EQ(swing(speed *= -1.03), Status::kInstability);
}

TEST_F(WatchedPair, LatchesATorqueThatReversesAllTheTime) {
  const double limit = settings.limits.torque[1];
  const auto still_there = [](int) {};
  for (const double share : {0.051, 0.049}) {
    make();
    const int ticks = ticks_until(Status::kInstability, still_there, [&](int k) {
      return Pair(0, (k % 2 == 0 ? 1 : -1) * share * limit);
    });
    // 1 - (63/64)^k > 0.47 for k = 41; the first torque reverses nothing, and it shows a tick later
    EXPECT_EQ(ticks, share > 0.05 ? 43 : 0);
  }
  make();
  const int every_other = ticks_until(Status::kInstability, still_there, [&](int k) {
    return Pair(0, (k / 2 % 2 == 0 ? 1 : -1) * 0.2 * limit);
  });
  EXPECT_GT(every_other, 150);
  EXPECT_LT(every_other, 200);
  make();
  EXPECT_EQ(ticks_until(Status::kInstability, still_there,
                        [&](int k) { return Pair(0, (k / 3 % 2 == 0 ? 1 : -1) * 0.2 * limit); }),
            0);
}

/// The time counts from when the torque exceeds the stiction, however long the arm has stood: 5 %
/// of 50 N m and three times 0.5 N m, or 15 % of 50 N m with unknown friction.
TEST_F(WatchedPair, LatchesAStateThatStaysTheSameForTwoFifthsOfTheTime) {
  settings.watchdog.feedback = 0.5;
  const auto same = [](int) {};
  ModelOptions smooth;
  smooth.coulomb_friction = Pair::Zero();
  for (const double stiction : {4.0, 7.5}) {
    if (stiction > 4) model = testing::chain_of({"revolute", "revolute"}, smooth);
    const auto from = [&](int begin, double torque) {
      make();
      tick();
      return ticks_until(Status::kStateFrozen, same,
                         [=](int k) { return Pair(k < begin ? 0 : -torque, 0); });
    };
    for (const int begin : {1, 1000}) EXPECT_NEAR(from(begin, stiction + 0.1), begin + 200, 1);
    EXPECT_EQ(from(1, stiction - 0.1), 0);
  }
  for (Pair* moves : {&q, &qd}) {  // one bit is enough
    make();
    tick();
    EXPECT_NEAR(ticks_until(
                    Status::kStateFrozen,
                    [&](int k) {
                      if (k == 100) (*moves)[1] = std::nextafter((*moves)[1], 1);
                    },
                    [&](int k) { return Pair(-20 * std::min(1.0, k / 300.0), 0); }),
                100 + 113 + 200, 2);
  }
  make();  // a torque that stays as it is, since the state has changed last
  for (int k = 0; k < 500; ++k) {
    if (k == 10) q[0] += 1e-3;
    EXPECT_EQ(tick({k < 5 ? 0.0 : -20.0, 0}), Status::kOk) << k;
  }
  settings.watchdog.feedback = 0;
  make();
  tick();
  EXPECT_EQ(ticks_until(Status::kStateFrozen, same, [](int) { return Pair(-20, 0); }), 0);
}

/// Joint 2 moves by itself, and the brake acts with 50 N m against it: 1.9 rad/s are 1.8 J, and
/// half of the velocity limits 1.5 J. The missing power is 95 W, of which 76.9 W are allowed.
TEST_F(WatchedPair, DoubtsABrakeThatTheEnergyDoesNotObey) {
  const auto doubted = [&](double speed, double torque, double deceleration) {
    make();
    qd = {0, speed};
    tick();
    return ticks_until(
        Status::kBrakeDoubted,
        [&](int k) {
          qd = {0, std::max(0.0, speed - 1e-3 * k * deceleration)};
        },
        [&](int) { return Pair(0, torque); });
  };
  EXPECT_EQ(doubted(1.9, -50, 0), 0) << "springs act";
  brakes = true;
  EXPECT_NEAR(doubted(1.9, -50, 0), 30 + 1.5 / 18.12e-3, 3);
  EXPECT_LT(doubted(1.9, -80, 0), 70);
  EXPECT_EQ(doubted(1.9, -50, 50), 0) << "it obeys";
  EXPECT_EQ(doubted(1.9, -50, 30), 0) << "nearly: masses are wrong";
  EXPECT_EQ(doubted(1.2, -60, 0), 0) << "somebody pushes";
  EXPECT_EQ(doubted(1.9, -30, 0), 0) << "somebody pulls";
}

/// After a fault the weight alone acts, as before the freeze: this does not end the fault.
TEST_F(WatchedPair, IsFrozenUntilTheStateChanges) {
  settings.watchdog.feedback = 0.5;
  make();
  tick();
  for (int k = 0; k < 300; ++k) tick({-20, 0});
  for (int k = 0; k < 1000; ++k) ASSERT_EQ(tick(), Status::kStateFrozen) << k;
  q[1] = std::nextafter(q[1], 1);
  EXPECT_EQ(tick(), Status::kOk);
  for (int k = 0; k < 300; ++k) tick({-20, 0});
  EXPECT_EQ(tick(), Status::kStateFrozen);
  watch->reset();
  EXPECT_EQ(tick(), Status::kOk);
}

}  // namespace
}  // namespace dashpot::controller
