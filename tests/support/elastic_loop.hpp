#pragma once
// A controller on a simulated arm whose gears bend, as a matrix that takes the loop's state from
// one tick to the next: of the arm by differences of simulated ticks, of the controller by
// differences of its torques. Nothing of the analysis is in it.

#include <dashpot/controller/controller.hpp>
#include <dashpot/sim/arm.hpp>
#include <dashpot/sim/plant.hpp>

#include <Eigen/Eigenvalues>
#include <cmath>
#include <complex>
#include <numbers>
#include <stdexcept>

namespace dashpot::testing {

/// Steps by error control near the limit of what rounding allows, for gears of 1e4 rad/s.
inline sim::PlantOptions exact_steps(double period) {
  sim::PlantOptions options;
  options.period = period;
  options.integrator.method = sim::Method::kDormandPrince8;
  options.integrator.adaptive = true;
  options.integrator.max_step = period;
  options.integrator.absolute_tolerance = options.integrator.relative_tolerance = 1e-13;
  return options;
}

/// x_k+1 = A x_k + B f_k, the sensors show C x_k; x = (q, deflections; their rates in units of
/// kRate) from where the arm rests.
struct ArmMap {
  static constexpr double kRate = 1000;  // 1/s

  Eigen::MatrixXd A, B, C;
  sim::JointVector rest;  ///< where the links are

  /// By central differences about where the sensors show q, at rest under the torque `weight` of
  /// the links there.
  template <class Weight>
  ArmMap(sim::Arm& arm, const sim::JointVector& q, double period, const Weight& weight)
      : rest(sim::Plant(arm, {}, q).position()) {
    const Eigen::Index n = arm.dof(), N = arm.coordinates();
    const sim::PlantOptions options = exact_steps(period);
    const sim::Plant start(arm, options, q);
    const Eigen::VectorXd center = start.state().head(2 * N);
    const sim::JointVector carried = weight(rest);
    const auto next = [&](const Eigen::VectorXd& x, const sim::JointVector& torque) {
      sim::Plant plant(arm, options, x.head(N), x.tail(N));
      if (plant.step(torque) != sim::Status::kOk) throw std::runtime_error("the step failed");
      return Eigen::VectorXd(plant.state().head(2 * N));
    };
    Eigen::VectorXd scale = Eigen::VectorXd::Ones(2 * N);
    scale.tail(N).setConstant(kRate);
    constexpr double kStep = 1e-5, kTorque = 1e-2;
    A.resize(2 * N, 2 * N);
    C.resize(2 * n, 2 * N);
    for (Eigen::Index j = 0; j < 2 * N; ++j) {
      const Eigen::VectorXd step = kStep * scale[j] * Eigen::VectorXd::Unit(2 * N, j);
      A.col(j) = (next(center + step, carried) - next(center - step, carried)) / (2 * kStep);
      sim::StateVector y = sim::StateVector::Zero(2 * N + sim::kWorkChannels);
      y[j] = scale[j];
      sim::JointVector shown, rate;
      arm.read_sensors(y, shown, rate);
      C.col(j) << shown, rate;
    }
    A = scale.cwiseInverse().asDiagonal() * A;
    B.resize(2 * N, n);
    for (Eigen::Index j = 0; j < n; ++j) {
      const sim::JointVector step = kTorque * sim::JointVector::Unit(n, j);
      B.col(j) = (next(center, carried + step) - next(center, carried - step)) / (2 * kTorque);
    }
    B = scale.cwiseInverse().asDiagonal() * B;
  }

  /// The map of the loop with u_k = F (shown positions, velocities), which acts `delay` ticks later
  /// behind a first-order low-pass of `cutoff` Hz (0: none); x is followed by the u on their way,
  /// the oldest first, and by the filter's torque.
  Eigen::MatrixXd closed(const Eigen::MatrixXd& F, double period, int delay, double cutoff) const {
    const Eigen::Index n = B.cols(), m = A.rows(), d = delay, f = cutoff > 0 ? 1 : 0;
    const double gain = f > 0 ? -std::expm1(-2 * std::numbers::pi * cutoff * period) : 1;
    const Eigen::Index rows = m + n * (d + f);
    Eigen::MatrixXd acting = Eigen::MatrixXd::Zero(n, rows);  // the torque in this period
    if (d == 0) {
      acting.leftCols(m) = gain * F * C;
    } else {
      acting.middleCols(m, n).diagonal().setConstant(gain);
    }
    if (f > 0) acting.rightCols(n).diagonal().setConstant(1 - gain);
    Eigen::MatrixXd map = Eigen::MatrixXd::Zero(rows, rows);
    map.topLeftCorner(m, m) = A;
    map.topRows(m) += B * acting;
    for (Eigen::Index k = 0; k + 1 < d; ++k)
      map.block(m + n * k, m + n * (k + 1), n, n).setIdentity();
    if (d > 0) map.block(m + n * (d - 1), 0, n, m) = F * C;
    if (f > 0) map.bottomRows(n) = acting;
    return map;
  }
};

/// Largest |z| of the motions that are faster than 0.01 1/s.
inline double spectral_radius(const Eigen::MatrixXd& map, double period) {
  double largest = 0;
  for (const std::complex<double>& z : map.eigenvalues()) {
    if (std::abs(std::log(z)) / period > 0.01) largest = std::max(largest, std::abs(z));
  }
  return largest;
}

/// The controller's d torque / d (position, velocity), n x 2n, where it has held the arm at q until
/// its springs rest, by central differences. `worst` is the worst status on the way. The settings'
/// watchdog of frozen feedback has to be off.
inline Eigen::MatrixXd feedback(controller::Controller& controller, controller::Setpoint setpoint,
                                const controller::JointVector& q,
                                const controller::JointVector& weight, double settling,
                                controller::Status& worst) {
  constexpr double kStep = 1e-6;
  const Eigen::Index n = q.size();
  controller::RobotState state;
  state.velocity = controller::JointVector::Zero(n);
  controller::JointVector torque(n);
  worst = controller::Status::kOk;
  const auto tick = [&](const controller::JointVector& at, const controller::JointVector& rate) {
    state.time += std::llround(1e9 * controller.settings().period);
    state.position = at;
    state.velocity = rate;
    setpoint.time = state.time;
    worst = controller::worse(worst, controller.update(state, setpoint, torque));
    return torque;
  };
  const controller::JointVector none = controller::JointVector::Zero(n);
  controller.reset(weight);
  for (double t = 0; t < settling; t += controller.settings().period) tick(q, none);
  Eigen::MatrixXd F(n, 2 * n);
  for (Eigen::Index j = 0; j < 2 * n; ++j) {
    const controller::JointVector step = kStep * controller::JointVector::Unit(n, j % n);
    const auto moved = [&](double sign) {
      tick(q, none);
      return j < n ? tick(q + sign * step, none) : tick(q, sign * step);
    };
    const controller::JointVector ahead = moved(1), behind = moved(-1);
    F.col(j) = (ahead - behind) / (2 * kStep);
  }
  return F;
}

}  // namespace dashpot::testing
