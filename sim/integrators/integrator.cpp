#include <dashpot/sim/integrator.hpp>
#include <dashpot/sim/invalid_scene.hpp>

#include <algorithm>
#include <cmath>

namespace dashpot::sim {
namespace {

constexpr double kLocated = 1e-10;    // contacts begin and end within this, s
constexpr double kLeastStep = 1e-12;  // s

/// Their equations may have no solution where a force jumps, so contacts keep their modes.
bool is_implicit(Method method) noexcept {
  return method == Method::kImplicitMidpoint || method == Method::kRosenbrock;
}

}  // namespace

bool estimates_error(Method method) noexcept {
  return method == Method::kDormandPrince8 || method == Method::kRosenbrock;
}

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
    case Method::kDormandPrince8:
      step_ = &Integrator::dormand_prince_8;
      exponent_ = -1.0 / 8;
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
  if (options.adaptive && !estimates_error(options.method)) {
    throw InvalidScene("adaptive: needs a method with an error estimate");
  }
}

Status Integrator::advance(System& system, double duration, StateVector& y) noexcept {
  y_ = y;  // sizes the work space, too
  next_ = error_ = stage_ = y;
  for (StateVector& rates : rates_) rates.resize(y.size());
  start_known_ = jacobian_known_ = false;
  const Status status = options_.adaptive ? advance_adaptive(system, duration, y)
                                          : advance_fixed(system, duration, y);
  if (status == Status::kOk && !y.allFinite()) return Status::kStateNotFinite;
  return status;
}

Status Integrator::advance_fixed(System& system, double duration, StateVector& y) noexcept {
  // A remainder from rounding does not require another step.
  const double steps = std::max(1.0, std::ceil(duration / options_.max_step - 1e-9));
  const double h = duration / steps;
  const bool freezes = is_implicit(options_.method) && system.has_contacts();
  Status status = Status::kOk;
  for (double i = 0; i < steps && status == Status::kOk; ++i) {
    if (freezes) system.freeze(system.contact_modes(y_));
    status = (this->*step_)(system, h);
    end_step();
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
  if (next_step_ == 0) next_step_ = first_step(system);
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
    // The end of a segment shortens a step, which tells nothing about the next step.
    const double grown = h * std::clamp(0.9 * std::pow(error, exponent_), 0.5, 5.0);
    next_step_ = std::min(options_.max_step, last ? std::max(next_step_, grown) : grown);
    if (contacts && system.contact_modes(next_) != modes) {
      status = land_on_contact(system, modes, h);
    }
    done += h;
    end_step();
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
  const Eigen::Index n = 2 * coordinates_of(y_);
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

/// Largest entry of position and velocity, relative to the tolerance at y_.
double Integrator::weighted_size(const StateVector& x) const noexcept {
  const Eigen::Index n = 2 * coordinates_of(y_);
  return (x.head(n).array().abs() /
          (options_.absolute_tolerance + options_.relative_tolerance * y_.head(n).array().abs()))
      .maxCoeff();
}

/// E. Hairer, S. P. Norsett, G. Wanner, Solving Ordinary Differential Equations I, II.4: a step
/// whose error is small according to the first and second derivative.
double Integrator::first_step(System& system) noexcept {
  begin_step(system);
  const double size = weighted_size(y_), rate = weighted_size(rates_[0]);
  double h = size > 1e-5 && rate > 1e-5 ? 0.01 * size / rate : 1e-6;
  h = std::min(h, options_.max_step);
  stage_ = y_ + h * rates_[0];
  system.rates(stage_, rates_[1]);
  error_ = rates_[1] - rates_[0];
  const double change = std::max(rate, weighted_size(error_) / h);
  const double wanted = change > 1e-15 ? std::pow(0.01 / change, -exponent_) : 1e3 * h;
  const double step = std::min({100 * h, wanted, options_.max_step});
  return std::max(step, kLeastStep);
}

void Integrator::begin_step(System& system) noexcept {
  if (!start_known_) system.rates(y_, rates_[0]);
  start_known_ = true;
}

void Integrator::end_step() noexcept {
  y_ = next_;
  start_known_ = jacobian_known_ = false;
}

Status Integrator::semi_implicit_euler(System& system, double h) noexcept {
  const Eigen::Index n = coordinates_of(y_);
  begin_step(system);
  next_ = y_ + h * rates_[0];
  next_.head(n) = y_.head(n) + h * next_.segment(n, n);
  return Status::kOk;
}

Status Integrator::runge_kutta_4(System& system, double h) noexcept {
  begin_step(system);
  stage_ = y_ + (h / 2) * rates_[0];
  system.rates(stage_, rates_[1]);
  stage_ = y_ + (h / 2) * rates_[1];
  system.rates(stage_, rates_[2]);
  stage_ = y_ + h * rates_[2];
  system.rates(stage_, rates_[3]);
  next_ = y_ + (h / 6) * (rates_[0] + 2 * (rates_[1] + rates_[2]) + rates_[3]);
  return Status::kOk;
}

}  // namespace dashpot::sim
