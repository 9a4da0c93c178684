// The dynamics against the laws that they follow from: derivatives of pose and energy, taken as
// differences, and a free motion that keeps its energy.
#include <dashpot/controller/dynamics.hpp>
#include <dashpot/controller/kdl_chain.hpp>
#include <dashpot/tests/support/arms.hpp>
#include <dashpot/tests/support/matrices.hpp>
#include <dashpot/tests/support/random.hpp>
#include <dashpot/tests/support/random_robot.hpp>

#include <gtest/gtest.h>

#include <Eigen/Cholesky>
#include <vector>

namespace dashpot::controller {
namespace {

using testing::near;
using testing::Random;
using testing::RandomRobot;

constexpr double kDifferenceStep = 1e-4;
/// Of differences over kDifferenceStep, relative to quantities of order one.
constexpr double kDifference = 1e-6;

/// (f(x + h) - f(x - h)) / 2h by fourth order.
template <class Function>
auto derivative(const Function& f) {
  return ((8 * (f(kDifferenceStep) - f(-kDifferenceStep)) -
           (f(2 * kDifferenceStep) - f(-2 * kDifferenceStep))) /
          (12 * kDifferenceStep))
      .eval();
}

std::vector<RobotModel> models() {
  std::vector<RobotModel> all;
  for (const auto& arm : testing::arms()) all.push_back(testing::arm_model(arm));
  for (const int n : {1, 3, 5, 9, 16}) {
    all.push_back(RobotModel::from_urdf_text(
        RandomRobot(100 + static_cast<unsigned>(n)).chain(n, 0.3), "link0", "tip"));
  }
  return all;
}

/// Potential energy of the chain's masses, from KDL's frames alone.
double potential(const RobotModel& model, const JointVector& q) {
  const KDL::Chain& chain = kdl_chain(model);
  KDL::Frame frame;
  double energy = 0;
  for (int i = 0; i < model.dof(); ++i) {
    const KDL::Segment& segment = chain.getSegment(static_cast<unsigned>(i));
    frame = frame * segment.pose(q[i]);
    const KDL::Vector center = frame * segment.getInertia().getCOG();
    energy -= segment.getInertia().getMass() *
              model.gravity().dot(Eigen::Vector3d(center.x(), center.y(), center.z()));
  }
  return energy;
}

TEST(DynamicsPhysics, GravityIsTheGradientOfThePotential) {
  Random random(721);
  for (const RobotModel& model : models()) {
    const int n = model.dof();
    const JointVector q = random.vector(n);
    const JointVector gravity = evaluate(model, q, JointVector::Zero(n)).gravity;
    for (int i = 0; i < n; ++i) {
      const JointVector e = JointVector::Unit(n, i);
      const auto slope = derivative(
          [&](double h) { return Eigen::Matrix<double, 1, 1>(potential(model, q + h * e)); });
      EXPECT_NEAR(gravity[i], slope[0], kDifference * gravity.cwiseAbs().maxCoeff())
          << model.name() << ", joint " << i;
    }
  }
}

TEST(DynamicsPhysics, JIsTheDerivativeOfThePose) {
  Random random(722);
  for (const RobotModel& model : models()) {
    const int n = model.dof();
    const JointVector q = random.vector(n), qd = random.vector(n);
    const DynamicsResult at = evaluate(model, q, qd);
    const auto pose = [&](double h) { return evaluate(model, q + h * qd, qd); };
    const Eigen::Vector3d v = derivative([&](double h) { return pose(h).p_BT_B; });
    const Eigen::Matrix3d spin =
        derivative([&](double h) { return pose(h).R_BT; }) * at.R_BT.transpose();
    const Vector6 twist = at.J * qd;
    EXPECT_TRUE(near(twist.head<3>(), v, 10 * kDifference)) << model.name();
    EXPECT_TRUE(near(twist.tail<3>(), Eigen::Vector3d(spin(2, 1), spin(0, 2), spin(1, 0)),
                     10 * kDifference))
        << model.name();
    EXPECT_TRUE((at.R_BT * at.R_BT.transpose()).isIdentity(1e-13)) << model.name();
  }
}

TEST(DynamicsPhysics, JdotQdIsTheAccelerationAtConstantJointVelocity) {
  Random random(723);
  for (const RobotModel& model : models()) {
    const int n = model.dof();
    const JointVector q = random.vector(n), qd = random.vector(n);
    const Vector6 expected =
        derivative([&](double h) { return (evaluate(model, q + h * qd, qd).J * qd).eval(); });
    EXPECT_TRUE(near(evaluate(model, q, qd).Jdot_qd, expected,
                     kDifference * std::max(10.0, expected.cwiseAbs().maxCoeff())))
        << model.name();
  }
}

/// dM/dq_k for all k
std::vector<Eigen::MatrixXd> mass_derivatives(const RobotModel& model, const JointVector& q) {
  const int n = model.dof();
  std::vector<Eigen::MatrixXd> all;
  for (int k = 0; k < n; ++k) {
    const JointVector e = JointVector::Unit(n, k);
    all.emplace_back(
        derivative([&](double h) { return evaluate(model, q + h * e, JointVector::Zero(n)).M; }));
  }
  return all;
}

TEST(DynamicsPhysics, CoriolisIsThatOfChristoffelAndMdotMinusTwoCIsSkew) {
  Random random(724);
  for (const RobotModel& model : models()) {
    const int n = model.dof();
    const JointVector q = random.vector(n), qd = random.vector(n);
    const std::vector<Eigen::MatrixXd> dM = mass_derivatives(model, q);
    Eigen::MatrixXd C = Eigen::MatrixXd::Zero(n, n), Mdot = C;
    for (int k = 0; k < n; ++k) {
      const auto K = static_cast<std::size_t>(k);
      Mdot += dM[K] * qd[k];
      for (int i = 0; i < n; ++i) {
        for (int j = 0; j < n; ++j) {
          const auto I = static_cast<std::size_t>(i), J = static_cast<std::size_t>(j);
          C(i, j) += 0.5 * (dM[K](i, j) + dM[J](i, k) - dM[I](j, k)) * qd[k];
        }
      }
    }
    const JointVector coriolis = evaluate(model, q, qd).coriolis;
    const double size = evaluate(model, q, qd).M.maxCoeff() * qd.squaredNorm();
    EXPECT_TRUE(near(coriolis, C * qd, kDifference * size)) << model.name();
    // So coriolis = C qd for the one C with Mdot - 2 C skew, which keeps power balanced:
    const Eigen::MatrixXd N = Mdot - 2 * C;
    EXPECT_TRUE(near(N, -N.transpose(), kDifference * size)) << model.name();
    EXPECT_NEAR(0.5 * qd.dot(Mdot * qd), qd.dot(coriolis), kDifference * size * qd.norm())
        << model.name();
  }
}

struct State {
  JointVector q, qd;
};

JointVector acceleration(const RobotModel& model, const State& s, const JointVector& torque) {
  const DynamicsResult d = evaluate(model, s.q, s.qd);
  return Eigen::LLT<Eigen::MatrixXd>(d.M).solve(torque - d.coriolis - d.gravity);
}

State runge_kutta(const RobotModel& model, const State& s, const JointVector& torque, double h) {
  const auto slope = [&](const State& at) { return State{at.qd, acceleration(model, at, torque)}; };
  const auto moved = [&](const State& k, double step) {
    return State{s.q + step * k.q, s.qd + step * k.qd};
  };
  const State a = slope(s), b = slope(moved(a, h / 2)), c = slope(moved(b, h / 2)),
              d = slope(moved(c, h));
  return {s.q + h / 6 * (a.q + 2 * b.q + 2 * c.q + d.q),
          s.qd + h / 6 * (a.qd + 2 * b.qd + 2 * c.qd + d.qd)};
}

double energy(const RobotModel& model, const State& s) {
  return 0.5 * s.qd.dot(evaluate(model, s.q, s.qd).M * s.qd) + potential(model, s.q);
}

/// Change of energy in 0.2 s less the work of a constant torque, relative to the kinetic energy
/// at the end.
double imbalance(const RobotModel& model, State s, const JointVector& torque, double h) {
  const State start = s;
  for (int i = 0; i < std::lround(0.2 / h); ++i) s = runge_kutta(model, s, torque, h);
  const double gain = energy(model, s) - energy(model, start);
  return std::abs(gain - torque.dot(s.q - start.q)) /
         (s.qd.dot(evaluate(model, s.q, s.qd).M * s.qd) / 2);
}

TEST(DynamicsPhysics, EnergyGrowsByTheWorkOfTheTorques) {
  Random random(725);
  for (const RobotModel& model : models()) {
    const int n = model.dof();
    if (n > 9) continue;  // time
    const State start{0.5 * random.vector(n), 0.5 * random.vector(n)};
    const JointVector torque = evaluate(model, start.q, start.qd).gravity + 0.1 * random.vector(n);
    const double coarse = imbalance(model, start, torque, 2e-3);
    const double fine = imbalance(model, start, torque, 1e-3);
    EXPECT_LT(fine, 1e-6) << model.name() << n;
    EXPECT_TRUE(fine < coarse / 8 || fine < 1e-10) << coarse << " " << fine;  // of fourth order
  }
}

}  // namespace
}  // namespace dashpot::controller
