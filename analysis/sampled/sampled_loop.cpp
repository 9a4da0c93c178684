#include <dashpot/analysis/base/arithmetic.hpp>
#include <dashpot/analysis/sampled/sampled_data_model.hpp>
#include <dashpot/analysis/sampled_loop.hpp>
#include <dashpot/analysis/spectrum/mode_numbers.hpp>

#include <Eigen/Cholesky>
#include <Eigen/Eigenvalues>
#include <Eigen/LU>
#include <Eigen/QR>
#include <algorithm>
#include <cmath>
#include <limits>

namespace dashpot::analysis {
namespace {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXcd;

/// An eigenvalue (per tick) of a mode after the loop's delays, to first order: the Newton step from
/// the continuous one to a zero of
///     lambda^2 + lambda D + G + h(lambda) (K - P - H + lambda e^(-lambda/2 if differenced) (C - D)
///         + output (e^lambda - state)^-1 position),
/// h = e^(-lambda (d + 1/2)) times the filter.
Complex delayed(const SampledDataModel& loop, Complex lambda, const VectorXcd& u,
                const VectorXcd& y) {
  Complex h = std::exp(-lambda * (loop.delay + 0.5));
  h *= loop.filter_gain / (1.0 - (1 - loop.filter_gain) * std::exp(-lambda));
  const Complex v = lambda * (loop.difference ? std::exp(-0.5 * lambda) : Complex(1));
  const auto form = [&](const MatrixXd& A) -> Complex {
    return (y.transpose() * A.cast<Complex>() * u).value();
  };
  const Complex product = (y.transpose() * u).value();
  Complex sprung = form(loop.K - loop.P - loop.H);
  const ControllerMemory& states = loop.states;
  if (const Index m = states.state.rows(); m > 0) {
    const Eigen::MatrixXcd step = std::exp(lambda) * MatrixXd::Identity(m, m) - states.state;
    const VectorXcd read = states.position * u;
    sprung += y.cwiseProduct(states.output * step.partialPivLu().solve(read)).sum();
  }
  const Complex value = lambda * lambda * product + lambda * form(loop.D) + form(loop.G) +
                        h * (sprung + v * form(loop.C - loop.D));
  const Complex step = -value / (2.0 * lambda * product + form(loop.C));
  return modulus(step) < 0.5 * modulus(lambda) ? lambda + step
                                               : lambda;  // not so near a double one
}

/// Gives the z one by one to what they belong to.
class Matcher {
 public:
  /// The last `idle` of z belong to nothing that moves.
  Matcher(const VectorXcd& z, Index idle)
      : z_(z), moving_(z.size() - idle), free_(static_cast<std::size_t>(z.size()), true) {}

  struct Nearest {
    Index index = -1;
    double distance = kInfinity;
  };
  /// The free z nearest to e^lambda in log(z); `real`: among the real ones.
  Nearest nearest(Complex lambda, bool real) const {
    Nearest best;
    for (Index i = 0; i < moving_; ++i) {
      if (!is_free(i) || z_[i] == 0.0 || z_[i].imag() < 0 || (real && z_[i].imag() != 0)) continue;
      const double distance = modulus(std::log(z_[i]) - lambda);
      if (distance < best.distance) best = {i, distance};
    }
    return best;
  }
  /// With its conjugate.
  Complex take(Index i) {
    free_[static_cast<std::size_t>(i)] = false;
    for (Index j = 0; j < z_.size() && z_[i].imag() != 0; ++j) {
      if (z_[j] == std::conj(z_[i])) free_[static_cast<std::size_t>(j)] = false;
    }
    return z_[i];
  }
  std::vector<Complex> rest() const {
    std::vector<Complex> result;
    for (Index i = 0; i < z_.size(); ++i) {
      if (is_free(i)) result.push_back(z_[i]);
    }
    return result;
  }

 private:
  bool is_free(Index i) const { return free_[static_cast<std::size_t>(i)]; }

  const VectorXcd& z_;
  Index moving_;
  std::vector<bool> free_;
};

constexpr int kZeroMode = -1, kMemory = -2;

/// The wanted eigenvalues: two of a mode, or one of a zero mode or of the controller's memory, per
/// tick.
struct Wanted {
  std::array<Complex, 2> lambda;
  int mode = kZeroMode;
  bool done = false;
};

/// Adds the motion of the controller's memory while all else is at rest, K y = -output w.
void list_memory(const SampledDataModel& loop, std::vector<Wanted>& wanted) {
  const ControllerMemory& states = loop.states;
  if (states.state.rows() == 0 || loop.n == 0) return;
  const Eigen::CompleteOrthogonalDecomposition<MatrixXd> springs(
      loop.K + loop.K.norm() * loop.zero_modes * loop.zero_modes.transpose());
  const MatrixXd slow = states.state - states.position * springs.solve(states.output);
  const VectorXcd found = Eigen::EigenSolver<MatrixXd>(slow, false).eigenvalues();
  for (const Complex z : found) wanted.push_back({{std::log(z), std::log(z)}, kMemory});
}

bool alternates(Complex z) {
  return z.imag() == 0 && z.real() < 0;
}

/// The mode of two real z, of which the first is negative and no smaller than the second if this is
/// negative too.
SampledMode to_alternating(const std::array<Complex, 2>& z, double period) {
  const Complex lambda = std::log(z[0]) / period;
  const double w = modulus(lambda);
  const bool grows = lambda.real() > 0;
  return {z,
          {lambda, std::log(z[1]) / period},
          w,
          -lambda.real() / w,
          lambda.imag(),
          grows ? ModeKind::kUnstable : ModeKind::kAlternating};
}

SampledMode to_mode(std::array<Complex, 2> z, double period) {
  if (alternates(z[1]) && !(alternates(z[0]) && z[0].real() < z[1].real())) std::swap(z[0], z[1]);
  if (alternates(z[0])) return to_alternating(z, period);
  if (z[1].imag() == 0 && modulus(std::log(z[0])) > modulus(std::log(z[1]))) std::swap(z[0], z[1]);
  const Root first{std::log(z[0]) / period, kInfinity};
  const Root second{z[0].imag() != 0 ? std::conj(first.value) : std::log(z[1]) / period, kInfinity};
  const ModeNumbers numbers = mode_numbers(first, second, root_invariants(first, second), 0);
  return {z,
          {first.value, second.value},
          numbers.natural_frequency,
          numbers.damping_ratio,
          numbers.damped_frequency,
          numbers.kind};
}

template <int N>
std::vector<Wanted> list_wanted(const System<N>& system, const Spectrum<N>& spectrum,
                                const SampledDataModel& loop, double T) {
  const Eigen::LLT<MatrixXd> mass{MatrixXd(system.mass)};
  const auto unit = [&](const ComplexVector<N>& u) -> VectorXcd {
    VectorXcd w(u.size());
    w.real() = mass.matrixU() * Eigen::VectorXd(u.real());
    w.imag() = mass.matrixU() * Eigen::VectorXd(u.imag());
    return w;
  };
  std::vector<Wanted> wanted;
  for (int k = 0; k < spectrum.modes.size(); ++k) {
    const Mode<N>& mode = spectrum.modes[k];
    Wanted one{{}, k};
    for (std::size_t i = 0; i < 2; ++i) {
      one.lambda[i] =
          delayed(loop, T * mode.eigenvalues[i], unit(mode.shapes[i]), unit(mode.left_shapes[i]));
    }
    wanted.push_back(one);
  }
  std::vector<double> rates;  // of the zero modes that are damped: the fastest
  for (const double rate : spectrum.zero_mode_rates) {
    if (rate == rate) rates.push_back(T * rate);
  }
  std::sort(rates.begin(), rates.end(),
            [](double a, double b) { return std::abs(a) > std::abs(b); });
  const Index r = loop.zero_modes.cols(), damped = 2 * r - loop.unit_motions().cols();
  rates.resize(std::min(rates.size(), static_cast<std::size_t>(damped)));
  for (const double rate : rates) wanted.push_back({{rate, rate}});
  list_memory(loop, wanted);
  return wanted;
}

}  // namespace

template <int N>
SampledSpectrum sample_loop(const System<N>& system, const Spectrum<N>& spectrum,
                            const SampledLoop& loop) {
  if (loop.gears.any()) {
    const GearedLoop geared(system, loop);
    return sample_loop(geared.system, geared.spectrum, geared.loop);
  }
  const SampledDataModel unit(system, spectrum, loop);
  const VectorXcd z = unit.discrete_eigenvalues();
  std::vector<Wanted> wanted = list_wanted(system, spectrum, unit, loop.period);
  SampledSpectrum result;
  result.spectral_radius = z.size() > 0 ? z.cwiseAbs().maxCoeff() : 0;
  constexpr double kNan = std::numeric_limits<double>::quiet_NaN();
  SampledMode none{{kNan, kNan}, {kNan, kNan}, kNan, kNan, kNan, ModeKind::kSoft};
  result.modes.assign(static_cast<std::size_t>(spectrum.modes.size()), none);
  Matcher matcher(z, unit.idle());
  for (;;) {
    Matcher::Nearest best;
    Wanted* owner = nullptr;
    std::size_t which = 0;
    for (Wanted& one : wanted) {
      for (std::size_t i = 0; i < (one.mode < 0 ? 1 : 2) && !one.done; ++i) {
        const Matcher::Nearest found = matcher.nearest(one.lambda[i], one.mode == kZeroMode);
        if (found.distance < best.distance) best = found, owner = &one, which = i;
      }
    }
    if (owner == nullptr) break;
    owner->done = true;
    const Complex first = matcher.take(best.index);
    if (owner->mode == kMemory) {
      result.memory.push_back(first);
      if (first.imag() == 0) continue;
      result.memory.push_back(std::conj(first));  // which another one would have
      const auto other = std::find_if(wanted.begin(), wanted.end(), [](const Wanted& one) {
        return one.mode == kMemory && !one.done;
      });
      if (other != wanted.end()) other->done = true;
      continue;
    }
    if (owner->mode == kZeroMode) {
      result.zero_modes.push_back(first);
      continue;
    }
    Complex second = std::conj(first);
    if (first.imag() == 0) {
      const Matcher::Nearest other = matcher.nearest(owner->lambda[1 - which], true);
      if (other.index < 0) continue;
      second = matcher.take(other.index);
    }
    result.modes[static_cast<std::size_t>(owner->mode)] = to_mode({first, second}, loop.period);
  }
  result.others = matcher.rest();
  return result;
}

template SampledSpectrum sample_loop(const System<kDynamic>&, const Spectrum<kDynamic>&,
                                     const SampledLoop&);
template SampledSpectrum sample_loop(const System<kMaxDof>&, const Spectrum<kMaxDof>&,
                                     const SampledLoop&);

}  // namespace dashpot::analysis
