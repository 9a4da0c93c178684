#include <dashpot/controller/motion/reference.hpp>
#include <dashpot/tests/support/matrices.hpp>
#include <dashpot/tests/support/random.hpp>

#include <gtest/gtest.h>

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <numbers>

namespace dashpot::controller {
namespace {

using Eigen::Quaterniond;
using Eigen::Vector3d;
using testing::near;
using testing::Random;
using testing::random_rotation;

constexpr double kPeriod = 0.001;
constexpr int kWindow = 30;

JointNorm joint_limits() {
  return {Vector3d(1.0, 0.5, 2.0), Vector3d(4.0, 5.0, 3.0)};
}

/// Largest velocity, acceleration and change of acceleration of a path, as shares of their limits,
/// from its positions alone.
struct Watch {
  JointNorm norm;
  std::vector<JointVector> positions = {};
  double speed = 0, effort = 0, jerk = 0, inconsistency = 0;
  JointVector v = JointVector::Zero(3), a = JointVector::Zero(3);

  void see(const JointReference& path) {
    if (!positions.empty()) {
      const JointVector v_now = (path.position() - positions.back()) / kPeriod;
      const JointVector a_now = (v_now - v) / kPeriod;
      speed = std::max(speed, norm.speed(v_now));
      effort = std::max(effort, norm.effort(a_now));
      jerk = std::max(jerk, norm.effort(a_now - a) / (2.0 / kWindow));
      inconsistency = std::max({inconsistency, norm.speed(v_now - path.velocity()),
                                norm.effort(a_now - path.acceleration())});
      v = v_now;
      a = a_now;
    }
    positions.push_back(path.position());
  }
  void expect_within_limits() const {
    EXPECT_LE(speed, 1 + 1e-9);
    EXPECT_LE(effort, 1 + 1e-6);
    EXPECT_LE(jerk, 1 + 1e-3);
    EXPECT_LT(inconsistency, 1e-6);  // velocity and acceleration match the positions
  }
};

TEST(JointReference, GoesStraightFromRestAndArrivesExactly) {
  JointReference path(joint_limits(), kPeriod, kWindow);
  const Vector3d start(0.1, -0.2, 0.3), goal(1.1, 0.7, -1.3);
  path.start(start);
  Watch watch{joint_limits()};
  watch.see(path);
  int ticks = 0;
  while (path.position() != goal && ticks < 10000) {
    path.step(goal);
    watch.see(path);
    ++ticks;
  }
  ASSERT_EQ(path.position(), goal);
  EXPECT_EQ(path.velocity(), JointVector::Zero(3));
  watch.expect_within_limits();
  EXPECT_GT(watch.speed, 0.99);  // no slower than the limit
  EXPECT_GT(watch.effort, 0.99);
  // As shares of the way: joint 2 limits the speed, joint 3 the acceleration; braking takes twice
  // as long as speeding up.
  const double speed = 0.5 / 0.9, effort = 3.0 / 1.6, smoothing = kWindow * kPeriod;
  EXPECT_NEAR(ticks * kPeriod, 1 / speed + 0.5 * speed * (1 / effort + 2 / effort) + smoothing,
              2.5 * kPeriod);
  for (const JointVector& p : watch.positions) {
    const double share = (p - start).dot(goal - start) / (goal - start).squaredNorm();
    EXPECT_TRUE(near(p, start + share * (goal - start), 1e-12));
    EXPECT_LE(share, 1 + 1e-12);  // no overshoot
  }
}

TEST(JointReference, KeepsItsLimitsWhateverTheGoalsAndArrives) {
  Random random(311);
  for (int trial = 0; trial < 100; ++trial) {
    JointReference path(joint_limits(), kPeriod, kWindow);
    Watch watch{joint_limits()};
    watch.see(path);
    JointVector goal = JointVector::Zero(3);
    for (int k = 0; k < 3000; ++k) {
      if (random.integer(0, 99) < (trial % 3 == 0 ? 100 : 1)) {  // every tick, or now and then
        goal = random.log_uniform(1e-6, 2.0) * random.vector(3);
      }
      if (random.integer(0, 999) == 0) {
        for (int halt = 0; halt < 50; ++halt) path.halt(), watch.see(path);
      }
      path.step(goal);
      watch.see(path);
    }
    for (int k = 0; k < 30000 && path.position() != goal; ++k) {
      path.step(goal);
      watch.see(path);
    }
    EXPECT_EQ(path.position(), goal);
    watch.expect_within_limits();
  }
}

TEST(JointReference, HaltStopsWithinTheBrakingTime) {
  JointReference path(joint_limits(), kPeriod, kWindow);
  for (int k = 0; k < 400; ++k) path.step(Vector3d(5, 5, 5));
  EXPECT_GT(path.velocity().norm(), 0.1);
  for (int k = 0; k < 400; ++k) path.halt();
  const JointVector stop = path.position();
  EXPECT_EQ(path.velocity(), JointVector::Zero(3));
  path.halt();
  EXPECT_EQ(path.position(), stop);
}

TEST(TipReference, GoesStraightAndTurnsAboutOneAxis) {
  Random random(312);
  const TwistNorm limits{0.5, 1.5, 2.0, 6.0};
  for (int trial = 0; trial < 20; ++trial) {
    TipReference path(limits, kPeriod, kWindow);
    const Vector3d p0 = random.vector(3), p1 = p0 + 0.3 * random.vector(3);
    const Quaterniond q0 = random_rotation(random), q1 = random_rotation(random);
    path.start(p0, q0);
    Vector3d p = p0;
    Quaterniond q = q0;
    const Vector3d axis = Eigen::AngleAxisd(q1 * q0.conjugate()).axis();
    int ticks = 0;
    for (; ticks < 20000 && !(path.position() == p1 && path.velocity().isZero(0)); ++ticks) {
      path.step(p1, q1);
      const Vector3d v = (path.position() - p) / kPeriod;
      Quaterniond turn = path.rotation() * q.conjugate();
      if (turn.w() < 0) turn.coeffs() = -turn.coeffs();
      const Vector3d w = rotation_vector(turn) / kPeriod;
      EXPECT_LE(v.norm(), 0.5 * (1 + 1e-9));
      EXPECT_LE(w.norm(), 1.5 * (1 + 1e-9));
      EXPECT_TRUE(near(path.velocity().head<3>(), v, 1e-9));
      EXPECT_TRUE(near(path.velocity().tail<3>(), w, 1e-9));
      EXPECT_LT(w.cross(axis).norm(), 1e-9);
      p = path.position();
      q = path.rotation();
    }
    EXPECT_EQ(path.position(), p1);
    EXPECT_LT(q.angularDistance(q1), 1e-14);
    EXPECT_TRUE(path.velocity().isZero(0));
  }
}

TEST(TipReference, ArrivesFromEveryDetour) {
  Random random(313);
  const TwistNorm limits{0.5, 1.5, 2.0, 6.0};
  for (int trial = 0; trial < 50; ++trial) {
    TipReference path(limits, kPeriod, kWindow);
    path.start(Vector3d::Zero(), Quaterniond::Identity());
    Vector3d goal;
    Quaterniond turned;
    Vector6 last = Vector6::Zero();
    for (int k = 0; k < 20; ++k) {
      goal = 0.3 * random.vector(3);
      turned = random_rotation(random);
      for (int i = random.integer(1, 400); i > 0; --i) {
        path.step(goal, turned);
        EXPECT_LE(limits.speed(path.velocity()), 1 + 1e-9);
        EXPECT_LE(limits.effort(path.velocity() - last) / kPeriod, 1 + 1e-9);
        last = path.velocity();
      }
    }
    for (int i = 0; i < 10000; ++i) path.step(goal, turned);
    EXPECT_EQ(path.position(), goal);
    EXPECT_LT(path.rotation().angularDistance(turned), 1e-14);
  }
}

/// Springs on every direction of the base.
TipImpedance all_sprung() {
  TipImpedance base;
  base.stiffness.setIdentity();
  base.selected.setOnes();
  return base;
}

// With a tip that stands still the reference ends at the error clamp, and turns back there.
TEST(TipReference, GoesNoFartherThanTheErrorClamp) {
  Random random(314);
  const TwistNorm limits{0.5, 1.5, 2.0, 6.0};
  const ErrorClamp clamp{0.2, 0.6};
  const TipImpedance base = all_sprung(), none;
  const Eigen::Matrix3d I = Eigen::Matrix3d::Identity();
  for (int trial = 0; trial < 20; ++trial) {
    TipReference path(limits, kPeriod, kWindow);
    const Vector3d tip = random.vector(3);
    const Quaterniond turned = random_rotation(random);
    const ReferenceGovernor governor{tip, turned, I, base, none, clamp};
    path.start(tip, turned);
    const Vector3d away = Vector3d(random.vector(3)).normalized();
    const Quaterniond far = quaternion(2.5 * away) * turned;
    Vector6 last = Vector6::Zero();
    for (int k = 0; k < 5000; ++k) {
      path.step(tip + 3 * away, far, governor);
      EXPECT_LE((path.position() - tip).norm(), 0.2 + 1e-9);
      EXPECT_LE(path.rotation().angularDistance(turned), 0.6 + 1e-9);
      EXPECT_LE(limits.effort(path.velocity() - last) / kPeriod, 1 + 1e-9);
      last = path.velocity();
    }
    EXPECT_TRUE(near(path.position(), tip + 0.2 * away, 1e-6));
    EXPECT_NEAR(path.rotation().angularDistance(turned), 0.6, 1e-6);
    for (int k = 0; k < 2000; ++k) path.step(tip, turned, governor);  // home: 0.2 m and 0.6 rad
    EXPECT_EQ(path.position(), tip);
  }
}

TEST(TipReference, GoesAlongWithATipThatIsLedAway) {
  TipReference path({0.5, 1.5, 2.0, 6.0}, kPeriod, kWindow);
  const ErrorClamp clamp{0.2, 0.6};
  const TipImpedance base = all_sprung(), none;
  const Eigen::Matrix3d I = Eigen::Matrix3d::Identity();
  const Quaterniond still = Quaterniond::Identity();
  Vector3d tip = Vector3d::Zero();
  path.start(tip, still);
  for (int k = 0; k < 4000; ++k) {
    tip.x() = 0.25e-3 * k;  // to 1 m
    path.step(Vector3d::Zero(), still, {tip, still, I, base, none, clamp});
  }
  EXPECT_NEAR(path.position().x(), tip.x() - 0.2, 0.05);
}

// Moved to another place on its way, it is there at once, and goes on with the velocity it has.
TEST(TipReference, GoesOnFromWhereItIsMovedToWhileItMovesAndTurns) {
  Random random(315);
  for (int trial = 0; trial < 20; ++trial) {
    TipReference path({0.5, 1.5, 2.0, 6.0}, kPeriod, kWindow);
    const Vector3d goal = 0.5 * Vector3d(random.vector(3)).normalized();
    const Quaterniond turned = quaternion(2.0 * Vector3d(random.vector(3)).normalized());
    path.start(Vector3d::Zero(), Quaterniond::Identity());
    for (int k = 0; k < 60; ++k) path.step(goal, turned);  // it speeds up: smoothing lags behind
    const Vector6 velocity = path.velocity();
    ASSERT_GT(velocity.head<3>().norm(), 0.02);
    ASSERT_GT(velocity.tail<3>().norm(), 0.1);
    const Vector3d p = 0.1 * random.vector(3);
    const Quaterniond q = quaternion(0.2 * random.vector(3));
    path.relocate(p, q);
    EXPECT_EQ(path.position(), p);
    EXPECT_EQ(path.rotation().coeffs(), q.coeffs());
    EXPECT_EQ(path.velocity(), velocity);
    path.step(goal, turned);
    const Vector6 then = path.velocity();
    EXPECT_TRUE(near(path.position(), p + kPeriod * then.head<3>(), 1e-12));
    // Except for the axis of rotation, which the new place changes: a fraction of the small offset.
    const Quaterniond expected = quaternion(kPeriod * then.tail<3>()) * q;
    EXPECT_LT(path.rotation().angularDistance(expected), 1e-4);
    for (int k = 0; k < 10000; ++k) path.step(goal, turned);
    EXPECT_EQ(path.position(), goal);
    EXPECT_LT(path.rotation().angularDistance(turned), 1e-14);
  }
}

TEST(JointReference, GoesOnFromWhereItIsMovedToWhileItMoves) {
  JointReference path(joint_limits(), kPeriod, kWindow);
  const Vector3d goal(1, -1, 2);
  for (int k = 0; k < 60; ++k) path.step(goal);
  const JointVector before = path.position(), velocity = path.velocity();
  path.relocate(1, 0.7);
  EXPECT_EQ(path.position(), Vector3d(before[0], 0.7, before[2]));
  EXPECT_EQ(path.velocity(), velocity);
  path.step(goal);
  EXPECT_NEAR(path.position()[1], 0.7 + kPeriod * path.velocity()[1], 1e-12);
  for (int k = 0; k < 10000; ++k) path.step(goal);
  EXPECT_EQ(path.position(), goal);
}

// Started again in motion, a path is at rest and forgets its past.
TEST(Paths, AreAtRestWhereTheyAreStarted) {
  TipReference tip({0.5, 1.5, 2.0, 6.0}, kPeriod, kWindow);
  JointReference joints(joint_limits(), kPeriod, kWindow);
  const Quaterniond turned = quaternion(Vector3d(0.3, -1, 0.5));
  for (int k = 0; k < 60; ++k)
    tip.step(Vector3d::Ones(), turned), joints.step(JointVector::Ones(3));
  const Vector3d p(0.4, 0.5, -0.6);
  tip.start(p, turned);
  joints.start(p);
  for (int k = 0; k < 3; ++k) {
    EXPECT_EQ(tip.position(), p);
    EXPECT_EQ(tip.rotation().coeffs(), turned.coeffs());
    EXPECT_TRUE(tip.velocity().isZero(0));
    EXPECT_TRUE(tip.acceleration().isZero(0));
    EXPECT_EQ(joints.position(), p);
    EXPECT_TRUE(joints.velocity().isZero(0));
    EXPECT_TRUE(joints.acceleration().isZero(0));
    tip.halt();
    joints.halt();
  }
}

// A near pose is within the clamp, up to half a turn; beyond 2 / pi of it this may be denied.
TEST(ReferenceGovernor, SeesWhatIsNearUpToHalfATurn) {
  Random random(316);
  const TipImpedance base = all_sprung(), none;
  const Eigen::Matrix3d I = Eigen::Matrix3d::Identity();
  for (const double angular : {0.1, 1.0, 2.0, 3.0, 3.14, 3.15}) {
    const ErrorClamp clamp{0.2, angular};
    for (int k = 0; k < 200; ++k) {
      const Vector3d tip = random.vector(3);
      const Quaterniond turned = random_rotation(random);
      const ReferenceGovernor governor{tip, turned, I, base, none, clamp};
      const Vector3d axis = Vector3d(random.vector(3)).normalized();
      const double angle = random.uniform(0, std::numbers::pi);
      Quaterniond goal = quaternion(angle * axis) * turned;
      if (k % 2 == 0) goal.coeffs() = -goal.coeffs();                 // the same rotation
      const double bound = std::numbers::pi * std::sin(0.5 * angle);  // at least the angle
      if (std::abs(bound - angular) > 1e-9) {
        EXPECT_EQ(governor.near(tip, goal), bound < angular) << angle << " of " << angular;
      }
      EXPECT_TRUE(governor.near(tip + 0.199 * axis, turned));
      EXPECT_FALSE(governor.near(tip + 0.201 * axis, turned));
    }
  }
}

// Up to the clamp a deflection is as it was, to the last bit; beyond it, it keeps its direction,
// also where the rotation vector is longer than half a turn.
TEST(ErrorClamp, LimitsExactlyAtItsEnd) {
  Random random(317);
  const TipImpedance base = all_sprung(), none;
  const Eigen::Matrix3d R = random_rotation(random).toRotationMatrix();
  for (const double angular : {0.5, 3.0, 3.14, 3.5}) {
    const ErrorClamp clamp{0.1, angular};
    for (int k = 0; k < 100; ++k) {
      const Vector3d a = Vector3d(random.vector(3)).normalized();
      const Vector3d b = Vector3d(random.vector(3)).normalized();
      const double size = random.uniform(0.9, 1.5);
      for (const bool in_tool : {false, true}) {
        const auto clamped = [&](const Vector6& e) {
          return in_tool ? clamp.clamped(e, none, base, R) : clamp.clamped(e, base, none, R);
        };
        Vector6 e, expected;
        e << 0.05 * a, size * angular * b;
        expected << 0.05 * a, std::min(size, 1.0) * angular * b;
        EXPECT_TRUE(near(clamped(e), expected, 1e-14));
        e << size * 0.1 * a, 0.9 * angular * b;
        expected << std::min(size, 1.0) * 0.1 * a, 0.9 * angular * b;
        EXPECT_TRUE(near(clamped(e), expected, 1e-14));
        e << 0.0999 * a, 0.999 * angular * b;
        EXPECT_EQ(clamped(e), e);
      }
    }
  }
}

TEST(ErrorClamp, ShortensOnlyWhereThereAreSprings) {
  const ErrorClamp clamp{0.1, 0.5};
  TipImpedance base = all_sprung(), none;
  base.stiffness(2, 2) = 0;
  Vector6 e;
  e << 0.06, 0.08, 7, 0.3, 0, 0.4;
  const Eigen::Matrix3d I = Eigen::Matrix3d::Identity();
  EXPECT_EQ(clamp.clamped(e, base, none, I), e);
  Vector6 expected = e;
  e.head<2>() *= 2;
  e.tail<3>() *= 4;
  EXPECT_TRUE(near(clamp.clamped(e, base, none, I), expected, 1e-15));
  // It holds in the axes of a tool.
  const Eigen::Matrix3d R = quaternion(Vector3d(0.3, -0.5, 0.8)).toRotationMatrix();
  Vector6 e_B, expected_B;
  e_B << R * e.head<3>(), R * e.tail<3>();
  expected_B << R * expected.head<3>(), R * expected.tail<3>();
  EXPECT_TRUE(near(clamp.clamped(e_B, none, base, R), expected_B, 1e-15));
}

}  // namespace
}  // namespace dashpot::controller
