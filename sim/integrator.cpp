#include <dashpot/sim/integrator.hpp>
#include <dashpot/sim/invalid_scene.hpp>

#include <algorithm>
#include <cmath>

namespace dashpot::sim {
namespace {

constexpr double kLocated = 1e-10;    // contacts begin and end within this, s
constexpr double kLeastStep = 1e-12;  // s

/// n
Eigen::Index dof_of(const StateVector& y) noexcept {
  return (y.size() - kWorkChannels) / 2;
}

/// Their equations may have no solution where a force jumps, so contacts keep still in a step.
bool is_implicit(Method method) noexcept {
  return method == Method::kImplicitMidpoint || method == Method::kRosenbrock;
}

}  // namespace

Integrator::Integrator(const IntegratorOptions& options) : options_(options) {
  const auto positive = [](double value) { return std::isfinite(value) && value > 0; };
  if (!positive(options.max_step)) throw InvalidScene("max_step: must be positive, s");
  if (!positive(options.absolute_tolerance)) {
    throw InvalidScene("absolute_tolerance: must be positive, rad and rad/s");
  }
  if (!(options.relative_tolerance >= 0)) {
    throw InvalidScene("relative_tolerance: must not be negative");
  }
  if (options.max_steps < 1) throw InvalidScene("max_steps: must be at least 1");
  switch (options.method) {
    case Method::kSemiImplicitEuler:
      step_ = &Integrator::semi_implicit_euler;
      break;
    case Method::kRungeKutta4:
      step_ = &Integrator::runge_kutta_4;
      break;
    case Method::kDormandPrince:
      step_ = &Integrator::dormand_prince;
      exponent_ = -1.0 / 5;
      break;
    case Method::kImplicitMidpoint:
      step_ = &Integrator::implicit_midpoint;
      break;
    case Method::kRosenbrock:
      step_ = &Integrator::rosenbrock;
      exponent_ = -1.0 / 3;
      break;
    default:
      throw InvalidScene("method: unknown");
  }
  if (options.adaptive && exponent_ == 0) {
    throw InvalidScene("adaptive: needs method kDormandPrince or kRosenbrock");
  }
  next_step_ = options.max_step;
}

Status Integrator::advance(System& system, double duration, StateVector& y) noexcept {
  y_ = y;  // sizes the work space, too
  next_ = error_ = stage_ = y;
  for (StateVector& rates : rates_) rates.resize(y.size());
  const Status status = options_.adaptive ? advance_adaptive(system, duration, y)
                                          : advance_fixed(system, duration, y);
  if (status == Status::kOk && !y.allFinite()) return Status::kStateNotFinite;
  return status;
}

Status Integrator::advance_fixed(System& system, double duration, StateVector& y) noexcept {
  // A remainder of rounding is no reason for another step.
  const double steps = std::max(1.0, std::ceil(duration / options_.max_step - 1e-9));
  const double h = duration / steps;
  const bool freezes = is_implicit(options_.method) && system.has_contacts();
  Status status = Status::kOk;
  for (double i = 0; i < steps && status == Status::kOk; ++i) {
    if (freezes) system.freeze(system.contact_modes(y_));
    status = (this->*step_)(system, h);
    y_ = next_;
  }
  if (freezes) system.thaw();
  y = y_;
  return status;
}

Status Integrator::advance_adaptive(System& system, double duration, StateVector& y) noexcept {
  const bool contacts = system.has_contacts();
  double done = 0;
  int steps = 0;
  Status status = Status::kOk;
  while (duration - done > kLeastStep && status == Status::kOk) {
    const ContactModes modes = contacts ? system.contact_modes(y_) : 0;
    if (contacts) system.freeze(modes);
    double h = std::min(next_step_, duration - done);
    const bool last = h == duration - done;
    status = (this->*step_)(system, h);
    if (++steps > options_.max_steps) status = Status::kTooManySteps;
    if (status != Status::kOk) break;
    const double error = error_norm();
    if (!(error <= 1)) {
      const double shrink = std::isfinite(error) ? 0.9 * std::pow(error, exponent_) : 0.1;
      next_step_ = h * std::clamp(shrink, 0.1, 0.9);
      if (next_step_ < kLeastStep) status = Status::kTooManySteps;
      continue;
    }
    // The end of a segment cuts a step without saying anything about the next one.
    const double grown = h * std::clamp(0.9 * std::pow(error, exponent_), 0.5, 5.0);
    next_step_ = std::min(options_.max_step, last ? std::max(next_step_, grown) : grown);
    if (contacts && system.contact_modes(next_) != modes) {
      status = land_on_contact(system, modes, h);
    }
    done += h;
    y_ = next_;
  }
  if (contacts) system.thaw();
  y = y_;
  return status;
}

/// Shortens the step h from y_ until it ends just after the contacts leave their modes.
Status Integrator::land_on_contact(System& system, ContactModes modes, double& h) noexcept {
  double before = 0;
  while (h - before > kLocated) {
    const double middle = 0.5 * (before + h);
    if (const Status status = (this->*step_)(system, middle); status != Status::kOk) return status;
    (system.contact_modes(next_) == modes ? before : h) = middle;
  }
  return (this->*step_)(system, h);
}

/// Largest entry of the error of position and velocity, relative to the tolerance.
double Integrator::error_norm() const noexcept {
  const Eigen::Index n = 2 * dof_of(y_);
  double worst = 0;
  for (Eigen::Index i = 0; i < n; ++i) {
    const double size = std::max(std::abs(y_[i]), std::abs(next_[i]));
    const double relative =
        std::abs(error_[i]) / (options_.absolute_tolerance + options_.relative_tolerance * size);
    if (!(relative <= worst)) worst = relative;
    if (std::isnan(worst)) break;
  }
  return worst;
}

Status Integrator::semi_implicit_euler(System& system, double h) noexcept {
  const Eigen::Index n = dof_of(y_);
  system.rates(y_, rates_[0]);
  next_ = y_ + h * rates_[0];
  next_.head(n) = y_.head(n) + h * next_.segment(n, n);
  return Status::kOk;
}

Status Integrator::runge_kutta_4(System& system, double h) noexcept {
  system.rates(y_, rates_[0]);
  stage_ = y_ + (h / 2) * rates_[0];
  system.rates(stage_, rates_[1]);
  stage_ = y_ + (h / 2) * rates_[1];
  system.rates(stage_, rates_[2]);
  stage_ = y_ + h * rates_[2];
  system.rates(stage_, rates_[3]);
  next_ = y_ + (h / 6) * (rates_[0] + 2 * (rates_[1] + rates_[2]) + rates_[3]);
  return Status::kOk;
}

/// J. R. Dormand, P. J. Prince, J. Comp. Appl. Math. 6 (1980), RK5(4)7M.
Status Integrator::dormand_prince(System& system, double h) noexcept {
  auto& k = rates_;
  system.rates(y_, k[0]);
  stage_ = y_ + h * (1.0 / 5 * k[0]);
  system.rates(stage_, k[1]);
  stage_ = y_ + h * (3.0 / 40 * k[0] + 9.0 / 40 * k[1]);
  system.rates(stage_, k[2]);
  stage_ = y_ + h * (44.0 / 45 * k[0] - 56.0 / 15 * k[1] + 32.0 / 9 * k[2]);
  system.rates(stage_, k[3]);
  stage_ = y_ + h * (19372.0 / 6561 * k[0] - 25360.0 / 2187 * k[1] + 64448.0 / 6561 * k[2] -
                     212.0 / 729 * k[3]);
  system.rates(stage_, k[4]);
  stage_ = y_ + h * (9017.0 / 3168 * k[0] - 355.0 / 33 * k[1] + 46732.0 / 5247 * k[2] +
                     49.0 / 176 * k[3] - 5103.0 / 18656 * k[4]);
  system.rates(stage_, k[5]);
  next_ = y_ + h * (35.0 / 384 * k[0] + 500.0 / 1113 * k[2] + 125.0 / 192 * k[3] -
                    2187.0 / 6784 * k[4] + 11.0 / 84 * k[5]);
  if (!options_.adaptive) return Status::kOk;
  system.rates(next_, k[6]);
  error_ = h * (71.0 / 57600 * k[0] - 71.0 / 16695 * k[2] + 71.0 / 1920 * k[3] -
                17253.0 / 339200 * k[4] + 22.0 / 525 * k[5] - 1.0 / 40 * k[6]);
  return Status::kOk;
}

/// y+ = 2 z - y with z = y + (h/2) f(z), by Newton's iteration with the Jacobian at y.
Status Integrator::implicit_midpoint(System& system, double h) noexcept {
  constexpr int kMaxIterations = 30;
  constexpr double kConverged = 1e-14;
  const Eigen::Index n = 2 * dof_of(y_);
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
  const Eigen::Index n = dof_of(y_), rows = n + kWorkChannels;
  jacobian_.resize(rows, 2 * n);
  system.rates(y_, rates_[0]);
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
  const Eigen::Index n = dof_of(y_);
  reduced_ = -jacobian_.topRightCorner(n, n) - (1 / s) * jacobian_.topLeftCorner(n, n);
  reduced_.diagonal().array() += s;
  if (!reduced_.allFinite()) return false;
  factors_.compute(reduced_);
  return true;
}

/// With J = [0 1 0; A B 0; D E 0] and x = (a, b, c): (s - B - A/s) v = b + A a / s, then
/// q = (a + v) / s, w = (c + D q + E v) / s.
void Integrator::solve(double s, StateVector& x) const noexcept {
  const Eigen::Index n = dof_of(y_);
  JointVector v = x.segment(n, n);
  v.noalias() += jacobian_.topLeftCorner(n, n).lazyProduct(x.head(n) / s);
  v = factors_.solve(v);
  x.head(n) = (x.head(n) + v) / s;
  x.segment(n, n) = v;
  x.tail<kWorkChannels>() += jacobian_.bottomRows<kWorkChannels>().lazyProduct(x.head(2 * n));
  x.tail<kWorkChannels>() /= s;
}

}  // namespace dashpot::sim
