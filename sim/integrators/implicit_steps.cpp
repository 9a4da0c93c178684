// Methods for stiff systems, and their linear equations.
#include <dashpot/sim/integrator.hpp>

#include <algorithm>
#include <cmath>

namespace dashpot::sim {

/// y+ = 2 z - y with z = y + (h/2) f(z), by Newton's iteration with the Jacobian at y.
Status Integrator::implicit_midpoint(System& system, double h) noexcept {
  constexpr int kMaxIterations = 30;
  constexpr double kConverged = 1e-14;
  const Eigen::Index n = 2 * coordinates_of(y_);
  const double s = 2 / h;
  differentiate(system);
  if (!factor(s)) return Status::kStateNotFinite;
  StateVector& z = stage_;
  z = y_ + (h / 2) * rates_[0];
  double last_change = 0;
  for (int i = 0; i < kMaxIterations; ++i) {
    system.rates(z, rates_[1]);
    error_ = rates_[1] - s * (z - y_);
    solve(s, error_);
    z += error_;
    const double size = z.head(n).cwiseAbs().maxCoeff() + y_.head(n).cwiseAbs().maxCoeff();
    const double change = error_.head(n).cwiseAbs().maxCoeff();
    if (!std::isfinite(change)) return Status::kStateNotFinite;
    // Done, or as close as rounding lets it come.
    if (change <= kConverged * size || (i > 3 && change <= 1e-9 * size && change >= last_change)) {
      next_ = 2 * z - y_;
      return Status::kOk;
    }
    last_change = change;
  }
  return Status::kNotConverged;
}

/// A. Sandu et al., Atmospheric Environment 31 (1997), RODAS3, in the form of E. Hairer, G. Wanner,
/// Solving Ordinary Differential Equations II, IV.7: (1/(h gamma) - J) k_i = f(stage) + sum c k /
/// h.
Status Integrator::rosenbrock(System& system, double h) noexcept {
  const double s = 2 / h;  // gamma = 1/2
  differentiate(system);
  if (!factor(s)) return Status::kStateNotFinite;
  StateVector &k1 = rates_[1], &k2 = rates_[2], &k3 = rates_[3], &k4 = rates_[4];
  k1 = rates_[0];
  solve(s, k1);
  k2 = rates_[0] + (4 / h) * k1;
  solve(s, k2);
  stage_ = y_ + 2 * k1;
  system.rates(stage_, k3);
  k3 += (1 / h) * (k1 - k2);
  solve(s, k3);
  stage_ += k3;
  system.rates(stage_, k4);
  k4 += (1 / h) * (k1 - k2 - (8.0 / 3) * k3);
  solve(s, k4);
  next_ = stage_ + k4;
  error_ = k4;
  return Status::kOk;
}

void Integrator::differentiate(System& system) noexcept {
  constexpr double kStep = 1.5e-8;  // sqrt of the rounding unit
  const Eigen::Index n = coordinates_of(y_), rows = n + kWorkChannels;
  begin_step(system);
  if (jacobian_known_) return;
  jacobian_known_ = true;
  jacobian_.resize(rows, 2 * n);
  stage_ = y_;
  for (Eigen::Index j = 0; j < 2 * n; ++j) {
    const double moved = y_[j] + kStep * std::max(1.0, std::abs(y_[j]));
    stage_[j] = moved;
    system.rates(stage_, rates_[1]);
    jacobian_.col(j) = (rates_[1].tail(rows) - rates_[0].tail(rows)) / (moved - y_[j]);
    stage_[j] = y_[j];
  }
}

bool Integrator::factor(double s) noexcept {
  const Eigen::Index n = coordinates_of(y_);
  reduced_ = -jacobian_.topRightCorner(n, n) - (1 / s) * jacobian_.topLeftCorner(n, n);
  reduced_.diagonal().array() += s;
  if (!reduced_.allFinite()) return false;
  factors_.compute(reduced_);
  return true;
}

/// With J = [0 1 0; A B 0; D E 0] and x = (a, b, c): (s - B - A/s) v = b + A a / s, then
/// q = (a + v) / s, w = (c + D q + E v) / s.
void Integrator::solve(double s, StateVector& x) const noexcept {
  const Eigen::Index n = coordinates_of(y_);
  JointVector v = x.segment(n, n);
  v.noalias() += jacobian_.topLeftCorner(n, n).lazyProduct(x.head(n) / s);
  v = factors_.solve(v);
  x.head(n) = (x.head(n) + v) / s;
  x.segment(n, n) = v;
  x.tail<kWorkChannels>() += jacobian_.bottomRows<kWorkChannels>().lazyProduct(x.head(2 * n));
  x.tail<kWorkChannels>() /= s;
}

}  // namespace dashpot::sim
