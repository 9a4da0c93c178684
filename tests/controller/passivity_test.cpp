// The energy under the law: kinetic energy and energy of the springs. The arm moves by the
// equations of motion, without drives and sampling.
#include <dashpot/controller/law/impedance_law.hpp>
#include <dashpot/tests/support/arms.hpp>
#include <dashpot/tests/support/constant_damping.hpp>
#include <dashpot/tests/support/random.hpp>
#include <dashpot/tests/support/simulated_arm.hpp>

#include <gtest/gtest.h>

#include <Eigen/Cholesky>
#include <algorithm>
#include <limits>

namespace dashpot::controller {
namespace {

using testing::Random;

constexpr double kNoClamp = std::numeric_limits<double>::infinity();

struct JointState {
  JointVector q, qd;
};

/// A Panda under the law, with springs at rest that stand still.
class Swing {
 public:
  Swing(Mode mode, bool coriolis, const JointState& start)
      : law_(model_, FeedForward{true, coriolis, false, true, false}), at(start) {
    Setpoint setpoint;
    setpoint.mode = mode;
    setpoint.gains = testing::constant_damping(model_).initial.gains;
    setpoint.gains.joint_damping.setZero();
    setpoint.gains.task_damping.setZero();
    setpoint.gains.task_stiffness.diagonal() << 300, 500, 200, 20, 20, 20;
    setpoint.gains.null_stiffness.setZero();
    setpoint.gains.null_damping.setZero();
    impedance_ = Impedance(setpoint, 7);
    const JointVector home = (testing::panda_ready());
    DynamicsKernel(model_).evaluate(home, JointVector::Zero(7), robot_);
    references_.joint.start(home);
    references_.tip.start(robot_.p_BT_B, Eigen::Quaterniond(robot_.R_BT));
  }

  /// Kinetic, and of the springs, J.
  double energy() {
    torque(at);
    const JointVector e = references_.joint.position() - at.q;
    const double springs = 0.5 * e.dot(impedance_.joint_stiffness * e) +
                           0.5 * asked_.tip_error.dot(impedance_.base.stiffness * asked_.tip_error);
    return springs + 0.5 * at.qd.dot(robot_.M * at.qd);
  }

  /// One step of Runge and Kutta's method.
  void step(double h) {
    const JointState k1 = rate(at), k2 = rate(moved(k1, h / 2)), k3 = rate(moved(k2, h / 2)),
                     k4 = rate(moved(k3, h));
    at.q += h / 6 * (k1.q + 2 * k2.q + 2 * k3.q + k4.q);
    at.qd += h / 6 * (k1.qd + 2 * k2.qd + 2 * k3.qd + k4.qd);
  }

 private:
  JointState moved(const JointState& rate, double h) const {
    return {at.q + h * rate.q, at.qd + h * rate.qd};
  }
  JointVector torque(const JointState& there) {
    kernel_.evaluate(there.q, there.qd, robot_);
    null_space_.compute(robot_, impedance_);
    law_.torque({robot_,
                 there.q,
                 there.qd,
                 impedance_,
                 null_space_,
                 references_,
                 {kNoClamp, kNoClamp},
                 Vector6::Zero()},
                asked_);
    return asked_.torque;
  }
  JointState rate(const JointState& there) {
    const JointVector tau = torque(there);
    return {there.qd, robot_.M.llt().solve(tau - robot_.coriolis - robot_.gravity)};
  }

  RobotModel model_ = testing::arm_model(testing::arms()[0]);
  DynamicsKernel kernel_{model_};
  ImpedanceLaw law_;
  Impedance impedance_{7};
  NullSpace null_space_;
  LawTorque asked_;
  SpringReferences references_{{JointVector::Ones(7), JointVector::Ones(7), 1, 1, 1, 1, 1e-3, 0},
                               1e-3};
  DynamicsResult robot_;

 public:
  JointState at;
};

/// Largest and smallest energy of half a second at speed, relative to that at the start.
std::pair<double, double> range_of_energy(Mode mode, bool coriolis, Random& random) {
  const JointVector q = (testing::panda_ready()) + JointVector(0.2 * random.vector(7));
  Swing swing(mode, coriolis, {q, 3 * random.vector(7)});
  const double start = swing.energy();
  std::pair<double, double> range(1, 1);
  for (int k = 0; k < 500; ++k) {
    swing.step(1e-3);
    const double now = swing.energy() / start;
    range = {std::min(range.first, now), std::max(range.second, now)};
  }
  return range;
}

TEST(Passivity, SpringsKeepAllEnergyWithoutTheCoriolisFeedForward) {
  Random random(341);
  for (const Mode mode : {Mode::kJoint, Mode::kCartesian}) {
    for (int trial = 0; trial < 5; ++trial) {
      const auto [least, most] = range_of_energy(mode, false, random);
      EXPECT_NEAR(least, 1, 1e-5);
      EXPECT_NEAR(most, 1, 1e-5);
    }
  }
}

// With it the loop has the modes' equation at any speed, but 1/2 qd' dM/dt qd changes the energy.
TEST(Passivity, TheCoriolisFeedForwardMayGiveEnergyAtSpeed) {
  Random random(342);
  for (const Mode mode : {Mode::kJoint, Mode::kCartesian}) {
    double largest = 1;
    for (int trial = 0; trial < 5; ++trial) {
      largest = std::max(largest, range_of_energy(mode, true, random).second);
    }
    EXPECT_GT(largest, 1.05);
  }
}

}  // namespace
}  // namespace dashpot::controller
