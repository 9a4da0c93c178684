#include <dashpot/apps/tune/place_motion.hpp>
#include <dashpot/controller/input_error.hpp>
#include <dashpot/controller/settings.hpp>

#include <Eigen/Cholesky>
#include <Eigen/LU>
#include <Eigen/QR>
#include <algorithm>
#include <cmath>
#include <complex>
#include <limits>
#include <vector>

namespace dashpot::apps {
namespace {

using controller::InputError;
using Eigen::MatrixXd;
using Eigen::VectorXd;
using MotionJson = nlohmann::ordered_json;

/// The transition of (q, q') over a time.
MatrixXd transition_over(const analysis::Response& response, Eigen::Index n, double time) {
  MatrixXd result(2 * n, 2 * n);
  for (Eigen::Index k = 0; k < 2 * n; ++k) {
    const VectorXd unit = VectorXd::Unit(2 * n, k);
    const analysis::Motion moved = response.free(unit.head(n), unit.tail(n), time);
    result.col(k) << moved.position, moved.velocity;
  }
  return result;
}

}  // namespace

MatrixXd consistent_inverse(const MatrixXd& M, const MatrixXd& J) {
  const Eigen::LLT<MatrixXd> mass(M);
  const MatrixXd X = mass.matrixL().solve(J.transpose());  // J M^-1 J' = X'X
  Eigen::CompleteOrthogonalDecomposition<MatrixXd> solve;
  solve.setThreshold(1e-6);
  solve.compute(X.transpose());
  return mass.matrixU().solve(solve.pseudoInverse());
}

Place place_of(const std::string& place, const MatrixXd& M, const MatrixXd& J) {
  const bool tip = place.starts_with("tip/"), joint = place.starts_with("joint/");
  const std::string digits = place.substr(std::min(place.find('/') + 1, place.size()));
  const bool number = !digits.empty() && digits.size() < 3 &&
                      digits.find_first_not_of("0123456789") == std::string::npos;
  const int i = number ? std::stoi(digits) : -1;
  const Eigen::Index n = M.rows();
  if (joint && i >= 0 && i < n) return {VectorXd::Unit(n, i), VectorXd::Unit(n, i), "rad/(N m)"};
  if (!tip || i < 0 || i > 5) throw InputError("place", "there is no such place on this arm");
  return {J.row(i), consistent_inverse(M, J).col(i), i < 3 ? "m/N" : "rad/(N m)", i < 3};
}

MotionJson release_json(const analysis::Response& response, const analysis::Spectrum<>& spectrum,
                        const VectorXd& motion, const Eigen::RowVectorXd& row) {
  double decay = std::numeric_limits<double>::infinity();
  for (const analysis::Mode<>& mode : spectrum.modes) {
    for (const auto& value : mode.eigenvalues) {
      if (std::abs(value) > controller::kSoftFrequency) decay = std::min(decay, -value.real());
    }
  }
  constexpr int kPoints = 401;
  constexpr double kSettled = 0.02;
  const VectorXd rest = VectorXd::Zero(motion.size());
  const auto value_at = [&](double t) { return row.dot(response.free(motion, rest, t).position); };
  const bool grows = decay < 0;
  double horizon = 20;
  if (std::isfinite(decay) && decay != 0) {
    horizon = std::clamp(grows ? -1.5 / decay : 5 / decay, 0.02, 20.0);
  }
  std::vector<double> times(kPoints), values(kPoints);
  int last = 0;
  for (int round = 0; round < 2; ++round) {
    last = 0;
    const MatrixXd step = transition_over(response, motion.size(), horizon / (kPoints - 1));
    VectorXd state(2 * motion.size());
    state << motion, rest;
    for (int i = 0; i < kPoints; ++i, state = step * state) {
      const auto k = static_cast<std::size_t>(i);
      times[k] = horizon * i / (kPoints - 1);
      values[k] = row.dot(state.head(motion.size()));
      if (std::abs(values[k]) > kSettled) last = i;
    }
    if (grows || last > kPoints / 4) break;  // otherwise a slow mode that this place hardly sees
    horizon = std::max(3 * times[static_cast<std::size_t>(last) + 1], 0.02);
  }
  const auto lowest = std::min_element(values.begin(), values.end());
  double overshoot = std::max(0.0, -*lowest);
  if (overshoot > 0) {  // between the points, by ternary search
    const auto at = static_cast<std::size_t>(lowest - values.begin());
    double a = times[at == 0 ? 0 : at - 1], b = times[std::min(at + 1, times.size() - 1)];
    for (int i = 0; i < 25; ++i) {
      const double c = a + (b - a) / 3, d = b - (b - a) / 3;
      const bool left = value_at(c) < value_at(d);
      (left ? b : a) = left ? d : c;
    }
    overshoot = std::max(overshoot, -value_at(0.5 * (a + b)));
  }
  MotionJson settling;
  if (!grows && last + 1 < kPoints) {
    double a = times[static_cast<std::size_t>(last)], b = times[static_cast<std::size_t>(last) + 1];
    for (int i = 0; i < 40; ++i) {
      const double c = 0.5 * (a + b);
      (std::abs(value_at(c)) > kSettled ? a : b) = c;
    }
    settling = b;
  }
  return {{"time", times},
          {"value", values},
          {"overshoot", grows ? MotionJson() : MotionJson(overshoot)},
          {"settling_time", settling}};
}

MotionJson frequency_json(const analysis::System<>& system, const analysis::Spectrum<>& spectrum,
                          const Eigen::RowVectorXd& row, const std::string& unit) {
  double slowest = 10, fastest = 10;
  MotionJson natural = MotionJson::array();
  for (const analysis::Mode<>& mode : spectrum.modes) {
    const double frequency = mode.natural_frequency;
    natural.push_back(frequency);
    if (!std::isfinite(frequency) || frequency < controller::kSoftFrequency) continue;
    slowest = std::min(slowest, frequency);
    fastest = std::max(fastest, frequency);
  }
  constexpr int kPoints = 161;
  std::vector<double> omegas, magnitudes, phases;
  double phase = 0;
  const Eigen::VectorXcd force = row.transpose();
  for (int i = 0; i < kPoints; ++i) {
    const double omega = 0.1 * slowest * std::pow(100 * fastest / slowest, i / (kPoints - 1.0));
    const std::complex<double> s(0, omega);
    const Eigen::MatrixXcd dynamic = s * s * system.mass + s * system.damping + system.stiffness;
    const std::complex<double> h = row * dynamic.partialPivLu().solve(force);
    phase += std::remainder(std::arg(h) - phase, 2 * M_PI);
    omegas.push_back(omega);
    magnitudes.push_back(std::abs(h));
    phases.push_back(phase);
  }
  return {{"omega", omegas},
          {"magnitude", magnitudes},
          {"phase", phases},
          {"unit", unit},
          {"natural_frequency", natural}};
}

}  // namespace dashpot::apps
