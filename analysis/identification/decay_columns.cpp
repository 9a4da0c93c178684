#include <dashpot/analysis/identification/decay_columns.hpp>

#include <array>
#include <cmath>

namespace dashpot::analysis {
namespace {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

/// (cos x - sin x / x) / (2 x^2) for x^2 = y, with the sign that makes it -1/6 at y = 0.
double third_difference(double y) {
  double sum = 0, term = 1.0 / 6;  // k / (2k + 1)! (-y)^(k-1), k = 1
  for (int k = 1; k < 12; ++k) {
    sum -= term;
    term *= -y * (k + 1) / k / ((2.0 * k + 2) * (2.0 * k + 3));
  }
  return sum;
}

/// e^{-a t/2} times cos(d t), sin(d t) / d and the derivative of the latter by D, where D = d^2 =
/// b - a^2/4 has either sign.
struct DampedWaves {
  double cosine, sine, sine_by_d;
};

DampedWaves damped_waves(double a, double D, double t) {
  const double y = D * t * t;
  DampedWaves wave{};
  const double fade = std::exp(-a * t / 2);
  if (std::abs(y) < 0.5) {
    const double x = std::sqrt(std::abs(y));
    const bool turns = y >= 0;
    wave.cosine = fade * (turns ? std::cos(x) : std::cosh(x));
    wave.sine = fade * t * (x < 1e-4 ? 1 - y / 6 : (turns ? std::sin(x) : std::sinh(x)) / x);
    wave.sine_by_d = fade * t * t * t * third_difference(y);
    return wave;
  }
  if (D > 0) {
    const double d = std::sqrt(D);
    wave.cosine = fade * std::cos(d * t);
    wave.sine = fade * std::sin(d * t) / d;
  } else {
    const double d = std::sqrt(-D);
    const double slow = std::exp((d - a / 2) * t), fast = std::exp((-d - a / 2) * t);
    wave.cosine = (slow + fast) / 2;
    wave.sine = (slow - fast) / (2 * d);
  }
  wave.sine_by_d = (t * wave.cosine - wave.sine) / (2 * D);
  return wave;
}

}  // namespace

FactorColumns columns_of(const DecayFactor& factor, const DecayPart& part, bool derivatives) {
  const Index N = samples_of(part), width = factor.parameters();
  FactorColumns columns{MatrixXd(N, width), {}};
  const std::size_t records = part.time.size();
  if (derivatives) {
    columns.derivative.assign(static_cast<std::size_t>(width) * records, MatrixXd::Zero(N, width));
  }
  const double w = std::exp(factor.first), zeta = factor.second;
  const double a = 2 * zeta * w, D = w * w * (1 - zeta * zeta);
  Index at = 0;
  std::size_t next = static_cast<std::size_t>(width);
  for (std::size_t r = 0; r < records; ++r) {
    const VectorXd& time = part.time[r];
    const bool scaled = r != factor.reference;
    const auto [alpha, beta] = factor.scale[r];
    for (Index i = 0; i < time.size(); ++i, ++at) {
      const double t = time[i];
      if (!factor.pair) {
        const double x = std::exp(factor.first * t);
        columns.value(at, 0) = alpha * x;
        if (!derivatives) continue;
        columns.derivative[0](at, 0) = alpha * t * x;
        if (scaled) columns.derivative[next](at, 0) = x;
        continue;
      }
      const auto [c, s, s_by_d] = damped_waves(a, D, t);
      // x = (c, w s) and x' / w.
      const double turn = 1 - zeta * zeta;
      const std::array<double, 2> x{c, w * s};
      const std::array<double, 2> rate{-zeta * x[0] - turn * x[1], x[0] - zeta * x[1]};
      for (Index k : {0, 1}) {
        const auto j = static_cast<std::size_t>(k);
        columns.value(at, k) = alpha * x[j] + beta * rate[j];
        if (derivatives && scaled) {
          columns.derivative[next](at, k) = x[j];
          columns.derivative[next + 1](at, k) = rate[j];
        }
      }
      if (!derivatives) continue;
      const double c_by_a = -t / 2 * c + a * t / 4 * s, c_by_b = -t / 2 * s;
      const double s_by_a = -t / 2 * s - a / 2 * s_by_d, s_by_b = s_by_d;
      const std::array<double, 2> by_first{c_by_a * a + c_by_b * 2 * w * w,
                                           w * (s + s_by_a * a + s_by_b * 2 * w * w)};
      const std::array<double, 2> by_second{c_by_a * 2 * w, w * s_by_a * 2 * w};
      columns.derivative[0](at, 0) =
          alpha * by_first[0] + beta * (-zeta * by_first[0] - turn * by_first[1]);
      columns.derivative[0](at, 1) =
          alpha * by_first[1] + beta * (by_first[0] - zeta * by_first[1]);
      columns.derivative[1](at, 0) =
          alpha * by_second[0] +
          beta * (-zeta * by_second[0] - turn * by_second[1] - x[0] + 2 * zeta * x[1]);
      columns.derivative[1](at, 1) =
          alpha * by_second[1] + beta * (by_second[0] - zeta * by_second[1] - x[1]);
    }
    if (scaled) next += static_cast<std::size_t>(width);
  }
  return columns;
}

Index factor_width(const std::vector<DecayFactor>& factors) {
  Index width = 0;
  for (const DecayFactor& factor : factors) width += factor.parameters();
  return width;
}

}  // namespace dashpot::analysis
