#pragma once
// Free decays of arms on springs, with what sensors do to them, and their true modes.

#include <dashpot/analysis/spectrum.hpp>
#include <dashpot/controller/dynamics.hpp>
#include <dashpot/identification/identification.hpp>
#include <dashpot/tests/support/arms.hpp>
#include <dashpot/tests/support/dice.hpp>

#include <Eigen/Cholesky>
#include <Eigen/Eigenvalues>
#include <Eigen/LU>
#include <cmath>
#include <limits>
#include <vector>

namespace dashpot::testing {

/// A joint differs from a linear one in this.
struct Flaw {
  static constexpr double kReach = 0.02;  ///< rad
  double friction = 0;                    ///< Coulomb's, as a share of the spring's force at kReach
  double hardening = 0;                   ///< share by which a spring is stiffer at kReach
};

/// An arm near an equilibrium, with springs and dampers in its joints, linearized.
struct SprungArm {
  analysis::System<> system;
  std::vector<analysis::Mode<>> modes;  ///< true ones

  /// Some arm at some posture with springs that give frequencies of an impedance-controlled arm;
  /// each undamped mode gets a ratio within `least_ratio` and `largest_ratio`, and dampers in the
  /// joints couple them.
  SprungArm(std::size_t which, Dice& draw, double least_ratio, double largest_ratio) {
    const controller::RobotModel model = arm_model(arms()[which % arms().size()]);
    const int n = model.dof();
    controller::JointVector q(n);
    for (int i = 0; i < n; ++i) q[i] = draw.uniform(-1.5, 1.5);
    const auto at = evaluate(model, q, controller::JointVector::Zero(n));
    Eigen::MatrixXd M = at.M;
    M.diagonal().array() += 0.1;  // of the drives
    Eigen::VectorXd springs(n);
    for (int i = 0; i < n; ++i) springs[i] = M(i, i) * std::pow(draw.uniform(8, 40), 2);
    const Eigen::MatrixXd K = springs.asDiagonal();
    const Eigen::GeneralizedSelfAdjointEigenSolver<Eigen::MatrixXd> undamped(K, M);
    const Eigen::MatrixXd U = undamped.eigenvectors();
    Eigen::VectorXd damping(n);
    for (int i = 0; i < n; ++i) {
      damping[i] =
          2 * draw.uniform(least_ratio, largest_ratio) * std::sqrt(undamped.eigenvalues()[i]);
    }
    const Eigen::MatrixXd D = M * U * damping.asDiagonal() * U.transpose() * M;
    Eigen::MatrixXd C = D;
    C.diagonal() *= 1.1;
    system = analysis::System<>(n);
    system.mass = M;
    system.damping = (C + C.transpose()) / 2;
    system.stiffness = K;
    const auto spectrum = analysis::analyze(system);
    for (const auto& mode : spectrum.modes) modes.push_back(mode);
  }

  /// d/dt of [q; q'].
  Eigen::MatrixXd state_matrix() const {
    const Eigen::Index n = system.mass.rows();
    Eigen::MatrixXd A = Eigen::MatrixXd::Zero(2 * n, 2 * n);
    A.topRightCorner(n, n).setIdentity();
    A.bottomLeftCorner(n, n) = -system.mass.llt().solve(system.stiffness);
    A.bottomRightCorner(n, n) = -system.mass.llt().solve(system.damping);
    return A;
  }

  /// Returns the motion from `position` at rest, n x samples `period` (s) apart.
  Eigen::MatrixXd release(const Eigen::VectorXd& position, int samples, double period) const {
    const Eigen::Index n = position.size();
    const Eigen::EigenSolver<Eigen::MatrixXd> solver(state_matrix());
    Eigen::VectorXcd start = Eigen::VectorXcd::Zero(2 * n);
    start.head(n) = position.cast<analysis::Complex>();
    const Eigen::VectorXcd weights = solver.eigenvectors().lu().solve(start);
    Eigen::MatrixXd motion(n, samples);
    for (int i = 0; i < samples; ++i) {
      const Eigen::VectorXcd turned = (solver.eigenvalues() * (i * period)).array().exp();
      motion.col(i) = (solver.eigenvectors().topRows(n) * turned.cwiseProduct(weights)).real();
    }
    return motion;
  }

  /// Returns the motion with flawed joints from `position` at rest, n x samples 1 ms apart.
  Eigen::MatrixXd release(const Flaw& flaw, const Eigen::VectorXd& position, int samples) const {
    constexpr int kParts = 10;
    constexpr double kStep = 1e-3 / kParts, kSticks = 1e-3;  // s, rad/s
    const Eigen::MatrixXd &C = system.damping, &K = system.stiffness;
    const Eigen::LLT<Eigen::MatrixXd> mass(system.mass);
    const Eigen::VectorXd rubs = flaw.friction * Flaw::kReach * K.diagonal();
    Eigen::VectorXd q = position, v = Eigen::VectorXd::Zero(q.size());
    Eigen::MatrixXd motion(q.size(), samples);
    for (int i = 0; i < samples; ++i) {
      motion.col(i) = q;
      for (int k = 0; k < kParts; ++k) {
        const Eigen::VectorXd stretched =
            q.array() * (1 + flaw.hardening * (q / Flaw::kReach).array().square());
        const Eigen::VectorXd slips = (v / kSticks).array().tanh();
        v -= kStep * mass.solve(K * stretched + C * v + rubs.cwiseProduct(slips));
        q += kStep * v;
      }
    }
    return motion;
  }

  /// Returns the motion under random torques that change each `period` (s) and whose spread
  /// accelerates each joint's inertia by `strength` (rad/s^2): n x samples.
  Eigen::MatrixXd shake(double strength, int samples, double period, Dice& draw) const {
    const Eigen::Index n = system.mass.rows();
    const Eigen::MatrixXd A = state_matrix();
    const Eigen::EigenSolver<Eigen::MatrixXd> solver(A);
    const Eigen::VectorXcd over = (solver.eigenvalues() * period).array().exp();
    const Eigen::MatrixXcd inverse = solver.eigenvectors().inverse();
    const Eigen::MatrixXd P = (solver.eigenvectors() * over.asDiagonal() * inverse).real();
    Eigen::MatrixXd B = Eigen::MatrixXd::Zero(2 * n, n);
    B.bottomRows(n) = system.mass.inverse() * system.mass.diagonal().asDiagonal() * strength;
    const Eigen::MatrixXd G =
        A.partialPivLu().solve((P - Eigen::MatrixXd::Identity(2 * n, 2 * n)) * B);
    Eigen::MatrixXd motion(n, samples);
    Eigen::VectorXd x = Eigen::VectorXd::Zero(2 * n), torque(n);
    for (int i = -static_cast<int>(3 / period); i < samples; ++i) {  // 3 s to forget the rest
      for (double& t : torque) t = draw.normal();
      x = P * x + G * torque;
      if (i >= 0) motion.col(i) = x.head(n);
    }
    return motion;
  }

  /// Returns the motion from rest under torques `shape` u, each value of u held for `period` (s):
  /// n x samples. `shares`: of each mode in the motion, whose squares are weighted by the mass.
  Eigen::MatrixXd drive(const Eigen::VectorXd& shape, const Eigen::VectorXd& u, double period,
                        std::vector<double>& shares) const {
    const Eigen::Index n = system.mass.rows();
    const Eigen::EigenSolver<Eigen::MatrixXd> solver(state_matrix());
    const Eigen::VectorXcd& values = solver.eigenvalues();
    const Eigen::VectorXcd over = (values * period).array().exp();
    Eigen::VectorXcd start = Eigen::VectorXcd::Zero(2 * n);
    start.tail(n) = system.mass.llt().solve(shape).cast<analysis::Complex>();
    const Eigen::VectorXcd push =
        solver.eigenvectors().lu().solve(start).array() * (over.array() - 1) / values.array();
    const Eigen::MatrixXcd shapes = solver.eigenvectors().topRows(n);
    Eigen::MatrixXd motion(n, u.size());
    Eigen::VectorXcd x = Eigen::VectorXcd::Zero(2 * n);
    Eigen::VectorXd squares = Eigen::VectorXd::Zero(2 * n);
    for (Eigen::Index i = 0; i < u.size(); ++i) {
      motion.col(i) = (shapes * x).real();
      squares += x.cwiseAbs2();
      x = over.cwiseProduct(x) + push * u[i];
    }
    const double all = (system.mass.llt().matrixU() * motion).squaredNorm();
    shares.clear();
    for (const auto& mode : modes) {
      Eigen::Index nearest = 0;
      (values.array() - mode.eigenvalues[0]).abs().minCoeff(&nearest);
      const Eigen::VectorXcd v = shapes.col(nearest);
      shares.push_back(2 * squares[nearest] * v.dot(system.mass * v).real() / all);
    }
    return motion;
  }
};

/// The effects of sensors on a motion.
struct Sensors {
  double noise = 1e-5;    ///< rad, standard deviation
  double resolution = 0;  ///< rad; 0: none
  double missing = 0.02;  ///< share of the samples, of all channels together
  double jitter = 0;      ///< of the times, relative to the period
};

inline identification::MotionRecord sensed(const Eigen::MatrixXd& motion, double period,
                                           const Sensors& sensors, Dice& draw) {
  const auto samples = static_cast<int>(motion.cols());
  identification::MotionRecord record{Eigen::VectorXd(samples), motion};
  for (int i = 0; i < samples; ++i) {
    record.time[i] = i * period;
    const bool missing = draw.uniform(0, 1) < sensors.missing;
    for (Eigen::Index c = 0; c < motion.rows(); ++c) {
      double& y = record.output(c, i);
      y += sensors.noise * draw.normal();
      if (sensors.resolution > 0) y = std::round(y / sensors.resolution) * sensors.resolution;
      if (missing) y = std::numeric_limits<double>::quiet_NaN();
    }
  }
  return record;
}

inline identification::MotionRecord sensed(const SprungArm& arm, const Eigen::VectorXd& position,
                                           int samples, double period, const Sensors& sensors,
                                           Dice& draw) {
  return sensed(arm.release(position, samples, period), period, sensors, draw);
}

}  // namespace dashpot::testing
