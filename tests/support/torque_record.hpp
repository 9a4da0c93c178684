#pragma once
// Records of an arm's motion and torques, whose mechanics are KDL's.

#include <dashpot/identification/check_model.hpp>
#include <dashpot/tests/support/dice.hpp>
#include <dashpot/tests/support/kdl_dynamics.hpp>

#include <cmath>
#include <cstdint>
#include <limits>

namespace dashpot::testing {

/// An arm that follows sums of sines, and what its joints and sensors do.
struct RecordedArm {
  explicit RecordedArm(controller::RobotDescription robot)
      : description(std::move(robot)),
        n(description.model().dof()),
        offset(Eigen::VectorXd::Zero(n)),
        coulomb(offset),
        viscous(offset) {}

  controller::RobotDescription description;
  Eigen::Index n;
  Eigen::VectorXd offset, coulomb, viscous;
  Eigen::VectorXd center = {};                                       ///< of the motion; empty: zero
  double duration = 20, rate = 500, amplitude = 0.5, slowest = 0.1;  ///< s, Hz, rad, Hz
  double position_noise = 1e-5, torque_noise = 0.05;
  double of_load = 0, at_rest = 0;  ///< friction of joint 2: share of its load; more if slow, N m
  double slow_noise = 0;            ///< of the torques, with a correlation of 0.3 s
  double quantum = 0;               ///< of the positions
  /// The robot holds the weight of its own model itself, and its torques leave it out; or, external
  /// torques, all of it.
  bool without_gravity = false, external_only = false;
  double contact_from = 0, contact_to = 0;  ///< s: a force of 40 N acts at the tip

  identification::TorqueRecord record(std::uint64_t seed) const {
    Dice dice(seed);
    constexpr int kSines = 4;
    const Eigen::MatrixXd phase = 3.0 * dice.matrix(n, kSines), share = dice.matrix(n, kSines);
    KdlDynamics dynamics(description.model()), own([this] {
      controller::RobotDescription known = description;
      known.options.payload = {};
      return known.model();
    }());
    const auto N = static_cast<Eigen::Index>(duration * rate);
    identification::TorqueRecord result{Eigen::VectorXd(N), Eigen::MatrixXd(n, N),
                                        Eigen::MatrixXd(n, N)};
    Eigen::VectorXd drift = slow_noise * dice.vector(n);
    const double keep = std::exp(-1 / (0.3 * rate));
    for (Eigen::Index i = 0; i < N; ++i) {
      const double t = static_cast<double>(i) / rate;
      Eigen::VectorXd q = center.size() > 0 ? center : Eigen::VectorXd(Eigen::VectorXd::Zero(n));
      Eigen::VectorXd qd = Eigen::VectorXd::Zero(n), qdd = qd;
      for (Eigen::Index j = 0; j < n; ++j) {
        for (int s = 0; s < kSines; ++s) {
          const double w = 6.283185307179586 * slowest * (s + 1 + 0.13 * static_cast<double>(j));
          const double a = amplitude * share(j, s) / (s + 1);
          q[j] += a * std::sin(w * t + phase(j, s));
          qd[j] += a * w * std::cos(w * t + phase(j, s));
          qdd[j] -= a * w * w * std::sin(w * t + phase(j, s));
        }
      }
      dynamics.solve(q, qd);
      const controller::DynamicsResult at = dynamics.result();
      Eigen::VectorXd torque =
          offset + viscous.cwiseProduct(qd) + Eigen::VectorXd(coulomb.array() * qd.array().sign());
      torque += at.M * qdd + at.coriolis + at.gravity;
      const double load = (at.M * qdd + at.coriolis + at.gravity)[1];
      torque[1] += (of_load * std::abs(load) + at_rest * std::exp(-100 * qd[1] * qd[1])) *
                   (qd[1] > 0 ? 1 : -1);
      if (without_gravity || external_only) {
        own.solve(q, qd);
        const controller::DynamicsResult known = own.result();
        torque -= known.gravity;
        if (external_only) torque -= known.M * qdd + known.coriolis;
      }
      if (t >= contact_from && t < contact_to) {
        torque -= at.J.topRows(3).transpose() * Eigen::Vector3d(30, -20, 15);
      }
      drift = keep * drift + std::sqrt(1 - keep * keep) * slow_noise * dice.vector(n);
      result.time[i] = t;
      result.torque.col(i) = torque + drift + torque_noise * dice.vector(n);
      result.position.col(i) = q + position_noise * dice.vector(n);
      if (quantum > 0) {
        result.position.col(i) = quantum * (result.position.col(i) / quantum).array().round();
      }
    }
    return result;
  }
};

}  // namespace dashpot::testing
