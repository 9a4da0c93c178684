#include <dashpot/identification/model/decay_columns.hpp>
#include <dashpot/identification/records/common.hpp>

#include <array>
#include <cmath>
#include <limits>
#include <utility>

namespace dashpot::identification {
namespace {

constexpr Index kLed = 64;       ///< steps from wave to wave, after which rounding is left behind
constexpr double kSeries = 0.5;  ///< squared angle: below it a difference of waves loses digits
constexpr int kTerms = 12;       ///< of the series, whose last one is below 1e-23 there
constexpr double kSmallAngle = 1e-4;  ///< sin x / x is 1 - x^2 / 6, to the last digit

/// (cos x - sin x / x) / (2 x^2) for x^2 = y, with the sign that makes it -1/6 at y = 0.
double third_difference(double y) {
  double sum = 0, term = 1.0 / 6;  // k / (2k + 1)! (-y)^(k-1), k = 1
  for (int k = 1; k < kTerms; ++k) {
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
  if (std::abs(y) < kSeries) {
    const double x = std::sqrt(std::abs(y));
    const bool turns = y >= 0;
    wave.cosine = fade * (turns ? std::cos(x) : std::cosh(x));
    wave.sine = fade * t * (x < kSmallAngle ? 1 - y / 6 : (turns ? std::sin(x) : std::sinh(x)) / x);
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

/// The motion of a factor from a start of its own, x = (c, w s), or (exp, 0) for a single lambda,
/// and its derivatives by `first` and `second`.
struct Wave {
  std::array<double, 2> x{}, by_first{}, by_second{};
};

Wave wave_at(const DecayFactor& factor, double t) {
  Wave wave;
  if (!factor.pair) {
    wave.x[0] = std::exp(factor.first * t);
    wave.by_first[0] = t * wave.x[0];
    return wave;
  }
  const double w = std::exp(factor.first), zeta = factor.second;
  const double a = 2 * zeta * w, D = w * w * (1 - zeta * zeta);
  const auto [c, s, s_by_d] = damped_waves(a, D, t);
  wave.x = {c, w * s};
  const double c_by_a = -t / 2 * c + a * t / 4 * s, c_by_b = -t / 2 * s;
  const double s_by_a = -t / 2 * s - a / 2 * s_by_d, s_by_b = s_by_d;
  wave.by_first = {c_by_a * a + c_by_b * 2 * w * w, w * (s + s_by_a * a + s_by_b * 2 * w * w)};
  wave.by_second = {c_by_a * 2 * w, w * s_by_a * 2 * w};
  return wave;
}

/// x' / w of a pair.
std::array<double, 2> rate_of(const std::array<double, 2>& x, double zeta) {
  return {-zeta * x[0] - (1 - zeta * zeta) * x[1], x[0] - zeta * x[1]};
}

/// Adds a source's motion to a row of a factor's columns, its derivatives by scales to `by_scale`.
void add_wave(const DecayFactor& factor, std::size_t source, Index at, const Wave& wave,
              FactorColumns& columns, std::array<MatrixXd, 2>* by_scale) {
  const auto [alpha, beta] = factor.scale[source];
  const bool derivatives = by_scale != nullptr;
  if (!factor.pair) {
    columns.value(at, 0) += alpha * wave.x[0];
    if (!derivatives) return;
    columns.by_eigenvalue[0](at, 0) += alpha * wave.by_first[0];
    (*by_scale)[0](at, 0) += wave.x[0];
    return;
  }
  const double zeta = factor.second;
  const std::array<double, 2> rate = rate_of(wave.x, zeta);
  std::array<double, 2> by_first{}, by_second{};
  if (derivatives) {
    by_first = rate_of(wave.by_first, zeta);
    by_second = rate_of(wave.by_second, zeta);
    by_second[0] += -wave.x[0] + 2 * zeta * wave.x[1];
    by_second[1] -= wave.x[1];
  }
  for (Index k : {0, 1}) {
    const auto j = static_cast<std::size_t>(k);
    columns.value(at, k) += alpha * wave.x[j] + beta * rate[j];
    if (!derivatives) continue;
    columns.by_eigenvalue[0](at, k) += alpha * wave.by_first[j] + beta * by_first[j];
    columns.by_eigenvalue[1](at, k) += alpha * wave.by_second[j] + beta * by_second[j];
    (*by_scale)[0](at, k) += wave.x[j];
    (*by_scale)[1](at, k) += rate[j];
  }
}

/// Leads a factor's motion on by one step of time, with its derivatives.
class Stepper {
 public:
  Stepper(const DecayFactor& factor, double step) : over_(wave_at(factor, step)) {
    const double zeta = factor.second, turn = factor.pair ? 1 - zeta * zeta : 0;
    back_ = -turn * over_.x[1];
    back_by_first_ = -turn * over_.by_first[1];
    back_by_second_ = factor.pair ? 2 * zeta * over_.x[1] - turn * over_.by_second[1] : 0;
  }

  void lead(Wave& now, bool derivatives) const {
    const auto [c, S] = over_.x;
    const auto [x, y] = now.x;
    if (derivatives) {
      const auto [c_first, S_first] = over_.by_first;
      const auto [c_second, S_second] = over_.by_second;
      const auto [f0, f1] = now.by_first;
      const auto [s0, s1] = now.by_second;
      now.by_first = {c * f0 + back_ * f1 + c_first * x + back_by_first_ * y,
                      S * f0 + c * f1 + S_first * x + c_first * y};
      now.by_second = {c * s0 + back_ * s1 + c_second * x + back_by_second_ * y,
                       S * s0 + c * s1 + S_second * x + c_second * y};
    }
    now.x = {c * x + back_ * y, S * x + c * y};
  }

 private:
  Wave over_;
  double back_ = 0, back_by_first_ = 0, back_by_second_ = 0;
};

/// A factor's motion at these times; where they are even, led on from step to step.
std::vector<Wave> free_waves(const DecayFactor& factor, const VectorXd& time, bool derivatives) {
  const Index N = time.size();
  const double step = N > 1 ? time[1] - time[0] : 0;
  const Stepper stepper(factor, step);
  std::vector<Wave> waves;
  waves.reserve(static_cast<std::size_t>(N));
  for (Index i = 0; i < N; ++i) {
    const double rounding = 4 * std::numeric_limits<double>::epsilon() * std::abs(time[i]);
    if (i % kLed != 0 && std::abs(time[i] - time[i - 1] - step) <= rounding) {
      waves.push_back(waves.back());
      stepper.lead(waves.back(), derivatives);
    } else {
      waves.push_back(wave_at(factor, time[i]));
    }
  }
  return waves;
}

/// The mean, in each of the `cells`, of a factor's response to an input from rest: a sum over the
/// earlier values, each a start of the factor's own.
std::vector<Wave> forced_waves(const DecayFactor& factor, const DrivenGrid& grid, Index input,
                               bool derivatives, const std::vector<Index>& cells) {
  const Stepper stepper(factor, grid.step);
  std::vector<Wave> result;
  result.reserve(cells.size());
  Wave now, sum;
  std::size_t next = 0;
  Index within = 0, cell = 0;
  for (Index i = 0; i < grid.input.cols() && next < cells.size(); ++i) {
    for (std::size_t k : {0U, 1U}) {
      sum.x[k] += now.x[k];
      if (!derivatives) continue;
      sum.by_first[k] += now.by_first[k];
      sum.by_second[k] += now.by_second[k];
    }
    if (++within == grid.per_cell) {
      if (cells[next] == cell) {
        const double share = 1 / static_cast<double>(grid.per_cell);
        for (auto* part : {&sum.x, &sum.by_first, &sum.by_second}) {
          for (double& value : *part) value *= share;
        }
        result.push_back(sum);
        ++next;
      }
      sum = {};
      within = 0;
      ++cell;
    }
    now.x[0] += grid.step * grid.input(input, i);
    stepper.lead(now, derivatives);
  }
  return result;
}

}  // namespace

FactorColumns columns_of(const DecayFactor& factor, const DecayPart& part, bool derivatives) {
  const Index N = samples_of(part), width = factor.parameters();
  const std::size_t records = part.time.size();
  const auto inputs = static_cast<std::size_t>(part.inputs());
  const MatrixXd zero = MatrixXd::Zero(N, width);
  FactorColumns columns{zero, {}, {}, {}};
  if (derivatives) {
    columns.by_eigenvalue.assign(static_cast<std::size_t>(width), zero);
    columns.by_record_scale = {zero, zero};
    columns.by_input_scale.assign(inputs, {zero, zero});
  }
  Index from = 0;
  const VectorXd* known = nullptr;  // times: most records have the same
  std::vector<Wave> waves;
  for (std::size_t r = 0; r < records; ++r) {
    const VectorXd& time = part.time[r];
    if (known == nullptr || known->size() < time.size() || known->head(time.size()) != time) {
      waves = free_waves(factor, time, derivatives);
      known = &time;
    }
    for (Index i = 0; i < time.size(); ++i) {
      add_wave(factor, r, from + i, waves[static_cast<std::size_t>(i)], columns,
               derivatives ? &columns.by_record_scale : nullptr);
    }
    for (std::size_t j = 0; j < inputs; ++j) {
      const std::vector<Wave> forced = forced_waves(
          factor, (*part.driven)[r], static_cast<Index>(j), derivatives, part.cells[r]);
      for (std::size_t i = 0; i < forced.size(); ++i) {
        add_wave(factor, records + j, from + static_cast<Index>(i), forced[i], columns,
                 derivatives ? &columns.by_input_scale[j] : nullptr);
      }
    }
    from += time.size();
  }
  return columns;
}

void take_constants(const DecayPart& part, MatrixXd& columns) {
  Index from = 0;
  for (const VectorXd& time : part.time) {
    auto rows = columns.middleRows(from, time.size());
    from += time.size();
    if (time.size() == 0) continue;
    rows.rowwise() -= Eigen::RowVectorXd(rows.colwise().mean());
    if (!part.drifts) continue;
    const VectorXd slope = (time.array() - time.mean()).matrix();
    const double size = slope.squaredNorm();
    if (size > 0) rows -= slope * Eigen::RowVectorXd(slope.transpose() * rows / size);
  }
}

MatrixXd direct_columns(const DecayPart& part) {
  MatrixXd columns(samples_of(part), part.inputs());
  if (part.inputs() == 0) return columns;
  Index at = 0;
  for (std::size_t r = 0; r < part.time.size(); ++r) {
    const auto& [input, step, per_cell] = (*part.driven)[r];
    for (const Index cell : part.cells[r]) {
      columns.row(at++) = input.middleCols(cell * per_cell, per_cell).rowwise().mean().transpose();
    }
  }
  return columns;
}

std::vector<MotionProduct> products_of(const std::vector<DecayFactor>& factors) {
  std::vector<MotionProduct> single, products;
  for (const DecayFactor& factor : factors) {
    if (!factor.has_products) continue;
    for (const Complex& lambda : factor.eigenvalues()) {
      const Complex rate = lambda / std::exp(factor.first);
      MotionProduct& one = single.emplace_back(MotionProduct{lambda, {}});
      for (const auto& [alpha, beta] : factor.scale) one.strength.push_back(alpha + beta * rate);
    }
  }
  for (std::size_t i = 0; i < single.size(); ++i) {
    for (std::size_t j = i; j < single.size(); ++j) {
      MotionProduct product = single[i];
      product.eigenvalue += single[j].eigenvalue;
      if (product.eigenvalue.imag() < 0) continue;
      for (std::size_t r = 0; r < product.strength.size(); ++r) {
        product.strength[r] *= single[j].strength[r];
      }
      products.push_back(std::move(product));
    }
  }
  return products;
}

MatrixXd product_columns(const std::vector<MotionProduct>& products, const DecayPart& part) {
  MatrixXd columns(samples_of(part), product_width(products));
  Index at = 0;
  for (const MotionProduct& product : products) {
    Index row = 0;
    for (std::size_t r = 0; r < part.time.size(); ++r) {
      for (const double t : part.time[r]) {
        const Complex value = product.strength[r] * std::exp(product.eigenvalue * t);
        columns(row, at) = value.real();
        if (product.eigenvalue.imag() > 0) columns(row, at + 1) = value.imag();
        ++row;
      }
    }
    at += product.eigenvalue.imag() > 0 ? 2 : 1;
  }
  return columns;
}

Index product_width(const std::vector<MotionProduct>& products) {
  Index width = 0;
  for (const MotionProduct& product : products) width += product.eigenvalue.imag() > 0 ? 2 : 1;
  return width;
}

Index factor_width(const std::vector<DecayFactor>& factors) {
  Index width = 0;
  for (const DecayFactor& factor : factors) width += factor.parameters();
  return width;
}

}  // namespace dashpot::identification
