#include <dashpot/analysis/identification/decay_fit.hpp>

#include <Eigen/Cholesky>
#include <Eigen/Eigenvalues>
#include <Eigen/QR>
#include <algorithm>
#include <cmath>
#include <limits>
#include <map>

namespace dashpot::analysis {
namespace {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

/// Of one more parameter, in the criterion: between Akaike's 2, which takes noise for modes, and
/// Schwarz's logarithm of the number of samples, about 9, which lets weak modes spoil strong ones.
constexpr double kPenalty = 4;

/// The motions of a factor in all records, samples x 2 or x 1, and their derivatives by `first`,
/// `second` and the scales of all records but the reference.
struct FactorColumns {
  MatrixXd value;
  std::vector<MatrixXd> derivative;
};

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

/// Columns of the factors alone.
Index factor_width(const std::vector<DecayFactor>& factors) {
  Index width = 0;
  for (const DecayFactor& factor : factors) width += factor.parameters();
  return width;
}

/// The least-squares problem at some factors.
class Evaluation {
 public:
  Evaluation(const DecayData& data, const std::vector<DecayFactor>& factors, const VectorXd& noise,
             const VectorXd& record_noise, bool derivatives)
      : squares(MatrixXd::Zero(data.channels, static_cast<Index>(data.records))),
        count(squares),
        record_noise_(record_noise) {
    const Index eigen = factor_width(factors);
    const Index width = eigen + static_cast<Index>(data.records);
    const Index p = eigen * static_cast<Index>(data.records);
    if (derivatives) normal.setZero(p, p), gradient.setZero(p);
    amplitudes.setZero(width, data.channels);
    for (const DecayPart& part : data.parts) add(part, factors, noise, derivatives);
    cost = (noise.cwiseInverse().asDiagonal() * squares * record_noise.cwiseInverse().asDiagonal())
               .cwiseQuotient(noise * record_noise.transpose())
               .sum();
  }

  MatrixXd normal;    ///< J'J, weighted; parameters: eigenvalues of all factors, then their scales
  VectorXd gradient;  ///< J'r, weighted
  double cost = 0;    ///< r'r, weighted
  MatrixXd amplitudes;  ///< width x channels
  MatrixXd squares;     ///< r'r of each channel and record, unweighted
  MatrixXd count;       ///< samples of each channel and record
  /// Of each part: J (samples of its channels one after the other) and r, weighted.
  std::vector<std::pair<MatrixXd, VectorXd>> scores;

 private:
  void add(const DecayPart& part, const std::vector<DecayFactor>& factors, const VectorXd& noise,
           bool derivatives) {
    const Index N = samples_of(part), channels = part.output.cols(), width = amplitudes.rows();
    MatrixXd basis = MatrixXd::Zero(N, width);
    std::vector<FactorColumns> columns;
    Index at = 0;
    for (const DecayFactor& factor : factors) {
      columns.push_back(columns_of(factor, part, derivatives));
      basis.middleCols(at, factor.parameters()) = columns.back().value;
      at += factor.parameters();
    }
    const Index eigen = at;
    Index from = 0;
    for (const VectorXd& time : part.time) {
      basis.col(at++).segment(from, time.size()).setOnes();
      from += time.size();
    }
    VectorXd weight(N);  // of the records
    from = 0;
    for (std::size_t r = 0; r < part.time.size(); ++r) {
      weight.segment(from, part.time[r].size())
          .setConstant(1 / record_noise_[static_cast<Index>(r)]);
      from += part.time[r].size();
    }
    basis = weight.asDiagonal() * basis;
    const MatrixXd output = weight.asDiagonal() * part.output;
    // Columns of very different size, as those of a mode that is over at once, are no deficiency.
    const VectorXd size = basis.colwise().norm().transpose().cwiseMax(1e-300);
    basis *= size.cwiseInverse().asDiagonal();
    const Eigen::ColPivHouseholderQR<MatrixXd> qr(basis);
    const Index rank = qr.rank();
    const MatrixXd Q = qr.householderQ() * MatrixXd::Identity(N, rank);
    const MatrixXd amplitude = size.cwiseInverse().asDiagonal() * qr.solve(output);
    MatrixXd residual = output - Q * (Q.transpose() * output);
    residual -= Q * (Q.transpose() * residual);

    VectorXd r(N * channels);
    for (Index c = 0; c < channels; ++c) {
      const Index channel = part.channels[static_cast<std::size_t>(c)];
      amplitudes.col(channel) = amplitude.col(c);
      from = 0;
      for (std::size_t k = 0; k < part.time.size(); ++k) {
        const auto record = static_cast<Index>(k);
        const Index n = part.time[k].size();
        squares(channel, record) +=
            residual.col(c).segment(from, n).squaredNorm() * std::pow(record_noise_[record], 2);
        count(channel, record) += static_cast<double>(n);
        from += n;
      }
      r.segment(c * N, N) = residual.col(c) / noise[channel];
    }
    if (!derivatives) return;
    MatrixXd J(N * channels, normal.rows());
    Index eigen_at = 0, scale_at = eigen;
    for (std::size_t k = 0; k < factors.size(); ++k) {
      const int parameters = factors[k].parameters();
      const MatrixXd of_factor = amplitude.middleRows(eigen_at, parameters);
      for (std::size_t j = 0; j < columns[k].derivative.size(); ++j) {
        MatrixXd change = weight.asDiagonal() * (columns[k].derivative[j] * of_factor);
        change -= Q * (Q.transpose() * change);
        const bool of_scale = j >= static_cast<std::size_t>(parameters);
        const Index column = of_scale ? scale_at++ : eigen_at + static_cast<Index>(j);
        for (Index c = 0; c < channels; ++c) {
          J.col(column).segment(c * N, N) =
              change.col(c) / noise[part.channels[static_cast<std::size_t>(c)]];
        }
      }
      eigen_at += parameters;
    }
    normal.selfadjointView<Eigen::Lower>().rankUpdate(J.transpose());
    normal.triangularView<Eigen::StrictlyUpper>() = normal.transpose();
    gradient.noalias() += J.transpose() * r;
    scores.emplace_back(std::move(J), std::move(r));
  }

  VectorXd record_noise_;
};

std::vector<DecayFactor> moved(const std::vector<DecayFactor>& factors, const VectorXd& step) {
  std::vector<DecayFactor> result = factors;
  Index at = 0;
  for (DecayFactor& factor : result) {
    factor.first += step[at++];
    if (factor.pair) factor.second += step[at++];
  }
  for (DecayFactor& factor : result) {
    for (std::size_t r = 0; r < factor.scale.size(); ++r) {
      if (r == factor.reference) continue;
      factor.scale[r][0] += step[at++];
      if (factor.pair) factor.scale[r][1] += step[at++];
    }
  }
  return result;
}

/// Gives factors the scales that fit best the amplitudes that each record has by itself.
void find_scales(const DecayData& data, const VectorXd& noise, std::vector<DecayFactor>& factors) {
  const bool known = std::all_of(
      factors.begin(), factors.end(),
      [&data](const DecayFactor& factor) { return factor.scale.size() == data.records; });
  if (known) return;
  for (DecayFactor& factor : factors) factor.scale.assign(data.records, {1, 0});
  if (data.records == 1) return;
  const Index eigen = factor_width(factors);
  std::vector<MatrixXd> amplitudes(data.records, MatrixXd::Zero(eigen, data.channels));
  for (const DecayPart& part : data.parts) {
    Index from = 0;
    for (std::size_t r = 0; r < data.records; ++r) {
      const Index N = part.time[r].size();
      MatrixXd basis(N, eigen + 1);
      DecayPart alone{{part.time[r]}, part.output.middleRows(from, N), part.channels};
      from += N;
      if (N == 0) continue;
      Index at = 0;
      for (DecayFactor factor : factors) {
        factor.scale = {{1, 0}};
        factor.reference = 0;
        basis.middleCols(at, factor.parameters()) = columns_of(factor, alone, false).value;
        at += factor.parameters();
      }
      basis.col(at).setOnes();
      const VectorXd size = basis.colwise().norm().transpose().cwiseMax(1e-300);
      basis *= size.cwiseInverse().asDiagonal();
      const MatrixXd all =
          size.cwiseInverse().asDiagonal() * basis.colPivHouseholderQr().solve(alone.output);
      for (std::size_t c = 0; c < part.channels.size(); ++c) {
        amplitudes[r].col(part.channels[c]) =
            all.col(static_cast<Index>(c)).head(eigen) / noise[part.channels[c]];
      }
    }
  }
  Index at = 0;
  for (DecayFactor& factor : factors) {
    const int width = factor.parameters();
    const auto of = [&](std::size_t r) { return amplitudes[r].middleRows(at, width); };
    for (std::size_t r = 0; r < data.records; ++r) {
      if (of(r).norm() > of(factor.reference).norm()) factor.reference = r;
    }
    const MatrixXd reference = of(factor.reference);
    MatrixXd columns(reference.size(), width);
    columns.col(0) = reference.reshaped();
    if (factor.pair) {  // x' / omega for x = (c, w s) times the amplitudes
      const double zeta = factor.second;
      MatrixXd rate(2, reference.cols());
      rate.row(0) = -zeta * reference.row(0) + reference.row(1);
      rate.row(1) = -(1 - zeta * zeta) * reference.row(0) - zeta * reference.row(1);
      columns.col(1) = rate.reshaped();
    }
    const auto qr = columns.colPivHouseholderQr();
    for (std::size_t r = 0; r < data.records; ++r) {
      if (r == factor.reference) continue;
      const MatrixXd wanted = of(r);
      const VectorXd scale = qr.solve(wanted.reshaped());
      factor.scale[r] = {scale[0], factor.pair ? scale[1] : 0};
    }
    at += width;
  }
}

/// Whether a step stays among motions that a record can show.
bool makes_sense(const std::vector<DecayFactor>& factors, double longest) {
  return std::all_of(factors.begin(), factors.end(), [longest](const DecayFactor& factor) {
    const auto lambda = factor.eigenvalues();
    return std::isfinite(modulus(lambda[0])) && std::isfinite(modulus(lambda[1])) &&
           std::max(lambda[0].real(), lambda[1].real()) * longest < 30 &&
           modulus(lambda[0]) * longest > 0.1;  // else it is a constant
  });
}

double longest_record(const DecayData& data) {
  double longest = 0;
  for (const DecayPart& part : data.parts) {
    for (const VectorXd& time : part.time) {
      if (time.size() > 0) longest = std::max(longest, time[time.size() - 1]);
    }
  }
  return longest;
}

/// The factors of least cost near `factors`, for a given noise. Gives up where the cost will stay
/// above `hopeless`.
bool descend(const DecayData& data, const VectorXd& noise, const VectorXd& record_noise,
             int max_iterations, double hopeless, std::vector<DecayFactor>& factors) {
  const double longest = longest_record(data);
  Evaluation now(data, factors, noise, record_noise, true);
  double lambda = 1e-3;
  for (int i = 0; i < max_iterations; ++i) {
    bool better = false;
    while (!better && lambda < 1e12) {
      MatrixXd A = now.normal;
      A.diagonal() += lambda * now.normal.diagonal().cwiseMax(1e-300);
      VectorXd step = A.ldlt().solve(now.gradient);
      if (!step.allFinite()) return false;
      const std::vector<DecayFactor> next = moved(factors, step);
      if (makes_sense(next, longest)) {
        const double gain = now.cost - Evaluation(data, next, noise, record_noise, false).cost;
        if (gain >= 0) {
          factors = next;
          const double size = step.dot(now.normal * step);
          if (gain < 1e-4 || size < 1e-4) return true;  // far below what noise does
          if (i > 3 && now.cost - 30 * gain > hopeless) return false;
          now = Evaluation(data, next, noise, record_noise, true);
          lambda = std::max(1e-12, lambda / 10);
          better = true;
        }
      }
      if (!better) lambda *= 10;
    }
    if (!better) return true;  // at the minimum to rounding
  }
  return false;
}

/// By how much the variance of the estimates exceeds that for white noise, because what is left
/// over is alike from sample to sample: the mean over the parameters, in the coordinates in which
/// they are uncorrelated, of sums of scores over stretches of time (batch means).
double variance_growth(const Evaluation& evaluation, const DecayData& data) {
  const Index p = evaluation.normal.rows();
  const Eigen::LLT<MatrixXd> factor(evaluation.normal);
  if (p == 0 || factor.info() != Eigen::Success) return 1;
  constexpr Index kStretches = 40;
  double sum = 0;
  for (std::size_t k = 0; k < data.parts.size(); ++k) {
    const auto& [J, r] = evaluation.scores[k];
    const Index N = samples_of(data.parts[k]);
    const Index length = std::max<Index>(1, N / (kStretches * static_cast<Index>(data.records)));
    for (Index c = 0; c < data.parts[k].output.cols(); ++c) {
      for (Index at = 0; at < N; at += length) {
        const Index n = std::min(length, N - at);
        const VectorXd g = J.middleRows(c * N + at, n).transpose() * r.segment(c * N + at, n);
        sum += factor.matrixL().solve(g).squaredNorm();
      }
    }
  }
  return std::max(1.0, sum / static_cast<double>(p));
}

}  // namespace

std::array<Complex, 2> DecayFactor::eigenvalues() const {
  if (!pair) return {first, first};
  const double w = std::exp(first), a = second * w;
  const double D = w * w * (1 - second * second);
  if (D >= 0) return {Complex(-a, std::sqrt(D)), Complex(-a, -std::sqrt(D))};
  const double far = -(a + std::copysign(std::sqrt(-D), a));
  return {far, w * w / far};
}

DecayFactor DecayFactor::of_pair(Complex eigenvalue) {
  const double w = modulus(eigenvalue);
  return {true, std::log(w), -eigenvalue.real() / w};
}

DecayData::DecayData(const std::vector<MotionRecord>& all)
    : channels(all.front().output.rows()), records(all.size()) {
  std::map<std::vector<bool>, std::vector<Index>> alike;  // channels with the same samples
  for (Index c = 0; c < channels; ++c) {
    std::vector<bool> there;
    for (const MotionRecord& record : all) {
      for (const double y : record.output.row(c)) there.push_back(std::isfinite(y));
    }
    alike[std::move(there)].push_back(c);
  }
  for (const auto& [there, members] : alike) {
    DecayPart part{
        {},
        MatrixXd(std::count(there.begin(), there.end(), true), static_cast<Index>(members.size())),
        members};
    Index row = 0;
    std::size_t sample = 0;
    for (const MotionRecord& record : all) {
      std::vector<double> times;
      for (Index i = 0; i < record.time.size(); ++i) {
        if (!there[sample++]) continue;
        times.push_back(record.time[i] - record.time[0]);
        for (std::size_t c = 0; c < members.size(); ++c) {
          part.output(row, static_cast<Index>(c)) = record.output(members[c], i);
        }
        ++row;
      }
      part.time.emplace_back(VectorXd::Map(times.data(), static_cast<Index>(times.size())));
    }
    parts.push_back(std::move(part));
  }
  motion.setZero(channels);
  for (const DecayPart& part : parts) {
    for (std::size_t c = 0; c < part.channels.size(); ++c) {
      const auto y = part.output.col(static_cast<Index>(c));
      const double mean = y.mean();
      motion[part.channels[c]] = std::sqrt((y.array() - mean).square().mean());
    }
  }
}

double DecayData::least_noise(Index channel) const {
  return std::max(kLinear * motion[channel], 1e-300);
}

DecayFit fit_decays(const DecayData& data, const std::vector<DecayFactor>& start,
                    const VectorXd& noise, int max_iterations, double hopeless) {
  DecayFit fit;
  fit.criterion = std::numeric_limits<double>::infinity();
  fit.factors = start;
  fit.noise = noise;
  const auto records = static_cast<Index>(data.records);
  fit.record_noise.setOnes(records);
  find_scales(data, noise, fit.factors);
  const Index eigen = factor_width(start);
  const auto nonlinear = static_cast<double>(eigen) * static_cast<double>(data.records);
  const auto linear = static_cast<double>(eigen) + static_cast<double>(data.records);
  const auto channels = static_cast<double>(data.channels);
  constexpr int kRounds = 5;
  for (int round = 0; round < kRounds; ++round) {
    fit.converged =
        descend(data, fit.noise, fit.record_noise, max_iterations, hopeless, fit.factors);
    const Evaluation there(data, fit.factors, fit.noise, fit.record_noise, false);
    if (there.cost > hopeless) break;
    const VectorXd noise_before = fit.noise, record_before = fit.record_noise;
    const VectorXd inverse = fit.record_noise.cwiseAbs2().cwiseInverse();
    const VectorXd count = there.count.rowwise().sum();
    for (Index c = 0; c < data.channels; ++c) {
      const double n = std::max(1.0, count[c] - linear - nonlinear / channels);
      const double squares = there.squares.row(c) * inverse;
      fit.noise[c] = std::max(std::sqrt(squares / n), data.least_noise(c));
    }
    // Each record's, about one: never so unequal that one counts for nothing.
    if (records > 1) {
      const MatrixXd relative = fit.noise.cwiseAbs2().cwiseInverse().asDiagonal() * there.squares;
      fit.record_noise = (relative.colwise().sum().transpose())
                             .cwiseQuotient(there.count.colwise().sum().transpose())
                             .cwiseSqrt()
                             .cwiseMax(0.1);
      fit.record_noise /= std::exp(fit.record_noise.array().log().mean());
    }
    fit.criterion = parameter_penalty(fit, data);
    for (Index c = 0; c < data.channels; ++c) {
      const double squares = there.squares.row(c) * fit.record_noise.cwiseAbs2().cwiseInverse();
      fit.criterion +=
          count[c] * std::log(std::max(squares / count[c], std::pow(data.least_noise(c), 2)));
    }
    fit.criterion += 2 * there.count.colwise().sum().dot(fit.record_noise.array().log().matrix());
    const double change =
        std::max((fit.noise.array() / noise_before.array()).log().abs().maxCoeff(),
                 (fit.record_noise.array() / record_before.array()).log().abs().maxCoeff());
    if (change < 0.02) break;
  }
  const Evaluation there(data, fit.factors, fit.noise, fit.record_noise, true);
  fit.amplitudes = there.amplitudes;
  fit.whiteness = variance_growth(there, data);
  const Index p = there.normal.rows();
  // Scaled, so that parameters of unlike size are no deficiency.
  const VectorXd scale = there.normal.diagonal().cwiseSqrt().cwiseMax(1e-300).cwiseInverse();
  // Where two factors have become alike, some direction is not determined; the others still are.
  const Eigen::SelfAdjointEigenSolver<MatrixXd> solver(scale.asDiagonal() * there.normal *
                                                       scale.asDiagonal());
  const VectorXd least = VectorXd::Constant(p, 1e-13 * solver.eigenvalues().maxCoeff());
  const VectorXd inverse = solver.eigenvalues().cwiseMax(least).cwiseInverse();
  const MatrixXd all = scale.asDiagonal() * solver.eigenvectors() * inverse.asDiagonal() *
                       solver.eigenvectors().transpose() * scale.asDiagonal() * fit.whiteness;
  fit.covariance = all.topLeftCorner(eigen, eigen);
  if (solver.info() != Eigen::Success || !fit.covariance.allFinite()) {
    fit.covariance.setConstant(eigen, eigen, std::numeric_limits<double>::infinity());
  }
  return fit;
}

double parameter_penalty(const DecayFit& fit, const DecayData& data) {
  const auto eigen = static_cast<double>(factor_width(fit.factors));
  const auto records = static_cast<double>(data.records);
  return kPenalty * (eigen * records + (eigen + records) * static_cast<double>(data.channels));
}

std::vector<MatrixXd> factor_motion(const DecayData& data, const DecayFit& fit,
                                    std::size_t factor) {
  Index first = 0;
  for (std::size_t k = 0; k < factor; ++k) first += fit.factors[k].parameters();
  const DecayFactor& which = fit.factors[factor];
  std::vector<MatrixXd> result;
  for (const DecayPart& part : data.parts) {
    MatrixXd amplitude(which.parameters(), static_cast<Index>(part.channels.size()));
    for (std::size_t c = 0; c < part.channels.size(); ++c) {
      amplitude.col(static_cast<Index>(c)) =
          fit.amplitudes.col(part.channels[c]).segment(first, which.parameters());
    }
    result.push_back(columns_of(which, part, false).value * amplitude);
  }
  return result;
}

std::vector<MatrixXd> left_over(const DecayData& data, const DecayFit& fit) {
  std::vector<MatrixXd> result;
  const Index constants = factor_width(fit.factors);
  for (const DecayPart& part : data.parts) {
    MatrixXd rest = part.output;
    Index from = 0, record = constants;
    for (const VectorXd& time : part.time) {
      for (std::size_t c = 0; c < part.channels.size(); ++c) {
        rest.col(static_cast<Index>(c)).segment(from, time.size()).array() -=
            fit.amplitudes(record, part.channels[c]);
      }
      from += time.size();
      ++record;
    }
    result.push_back(std::move(rest));
  }
  for (std::size_t k = 0; k < fit.factors.size(); ++k) {
    const std::vector<MatrixXd> of_factor = factor_motion(data, fit, k);
    for (std::size_t i = 0; i < result.size(); ++i) result[i] -= of_factor[i];
  }
  return result;
}

}  // namespace dashpot::analysis
