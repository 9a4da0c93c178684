#include <dashpot/analysis/spectrum/mode_numbers.hpp>

#include <dashpot/analysis/base/arithmetic.hpp>

#include <algorithm>
#include <cmath>
#include <utility>

namespace dashpot::analysis {

Invariants block_invariants(double l00, double l01, double l10, double l11, double rho) noexcept {
  const double half_difference = 0.5 * (l00 - l11), half_sum = 0.5 * (l00 + l11);
  Invariants v;
  v.sum = l00 + l11;
  v.discriminant = half_difference * half_difference + l01 * l10;
  v.product = half_sum * half_sum - v.discriminant;
  // In a 2 x 2 matrix within rho of L |tr| moves by sqrt(2) rho, det by |L| rho + rho^2 / 2,
  // and the discriminant by |L0| rho + rho^2 / 2 with L0 the traceless part.
  const double cross = l01 * l01 + l10 * l10;
  const double size = std::sqrt(l00 * l00 + l11 * l11 + cross);
  const double traceless = std::sqrt(2 * half_difference * half_difference + cross);
  v.sum_error = std::sqrt(2.0) * rho + 4 * kUnit * size;
  v.product_error = size * rho + 0.5 * rho * rho + 8 * kUnit * size * size;
  v.discriminant_error = traceless * rho + 0.5 * rho * rho + 8 * kUnit * traceless * traceless;
  return v;
}

Invariants root_invariants(const Root& a, const Root& b) noexcept {
  Invariants v;
  v.sum = (a.value + b.value).real();
  v.product = a.value.real() * b.value.real() - a.value.imag() * b.value.imag();
  const Complex half = 0.5 * (a.value - b.value);
  v.discriminant = half.real() * half.real() - half.imag() * half.imag();
  const double size_a = modulus(a.value), size_b = modulus(b.value);
  const double size = std::max(size_a, size_b);
  v.sum_error = a.bound + b.bound + 4 * kUnit * size;
  v.product_error =
      size_a * b.bound + size_b * a.bound + a.bound * b.bound + 4 * kUnit * size_a * size_b;
  const double half_size = modulus(half), moved = 0.5 * (a.bound + b.bound);
  v.discriminant_error =
      2 * half_size * moved + moved * moved + 8 * kUnit * half_size * (half_size + size);
  return v;
}

ModeNumbers mode_numbers(const Root& first, const Root& second, const Invariants& invariants,
                         double soft_frequency) noexcept {
  const Invariants& v = invariants;
  ModeNumbers mode;
  mode.eigenvalues = {first.value, second.value};
  mode.eigenvalue_bounds = {first.bound, second.bound};
  mode.error_bound = std::max(first.bound, second.bound);
  mode.natural_frequency_bound = mode.damping_ratio_bound = kInfinity;
  mode.damped_frequency = std::abs(mode.eigenvalues[0].imag());
  const bool real = mode.eigenvalues[0].imag() == 0;
  if (real && modulus(mode.eigenvalues[0]) > modulus(mode.eigenvalues[1])) {
    std::swap(mode.eigenvalues[0], mode.eigenvalues[1]);
    std::swap(mode.eigenvalue_bounds[0], mode.eigenvalue_bounds[1]);
  }
  // Of a pair whose slower eigenvalue may as well be zero no frequency is known.
  const bool rigid = real && modulus(mode.eigenvalues[0]) <= mode.eigenvalue_bounds[0] &&
                     std::isfinite(mode.error_bound);
  if (!(v.product > 0) || rigid) {
    mode.natural_frequency = mode.damping_ratio = std::numeric_limits<double>::quiet_NaN();
  } else {
    const double omega = std::sqrt(v.product);
    mode.natural_frequency = omega;
    mode.damping_ratio = -0.5 * v.sum / omega;
    const double relative = v.product_error / v.product;
    if (relative < 1) {
      mode.natural_frequency_bound = omega * (relative / (1 + std::sqrt(1 - relative)) + 4 * kUnit);
      mode.damping_ratio_bound =
          (0.5 * v.sum_error + std::abs(mode.damping_ratio) * mode.natural_frequency_bound) /
              (omega - mode.natural_frequency_bound) +
          4 * kUnit * std::abs(mode.damping_ratio);
    }
    if (!(mode.damping_ratio_bound >= 0)) mode.damping_ratio_bound = kInfinity;
  }
  // Without a bound the kind goes by the numbers as they are: nothing that grows is called fine.
  const bool proved = std::isfinite(mode.error_bound);
  const auto error = [proved](double bound) { return proved ? bound : 0; };
  const double growth = std::max(mode.eigenvalues[0].real(), mode.eigenvalues[1].real());
  if (growth > error(mode.error_bound) || v.sum > error(v.sum_error) ||
      v.product < -error(v.product_error)) {
    mode.kind = ModeKind::kUnstable;
  } else if (!(mode.natural_frequency >= soft_frequency)) {
    mode.kind = ModeKind::kSoft;
  } else if (std::abs(v.discriminant) <= error(v.discriminant_error)) {
    mode.kind = ModeKind::kCritical;
  } else if (real) {
    mode.kind = ModeKind::kOverdamped;
  } else if (std::abs(v.sum) <= error(v.sum_error)) {
    mode.kind = ModeKind::kUndamped;
  } else {
    mode.kind = ModeKind::kUnderdamped;
  }
  return mode;
}

double relative_bound(const ModeNumbers& mode) noexcept {
  const double size = modulus(mode.eigenvalues[0]) + modulus(mode.eigenvalues[1]);
  const double bound =
      mode.kind == ModeKind::kCritical ? mode.natural_frequency_bound : mode.error_bound;
  return std::isfinite(bound) ? bound / size : kInfinity;
}

}  // namespace dashpot::analysis
