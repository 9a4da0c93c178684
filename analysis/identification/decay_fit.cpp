#include <dashpot/analysis/identification/decay_columns.hpp>
#include <dashpot/analysis/identification/decay_fit.hpp>
#include <dashpot/analysis/identification/decay_scales.hpp>

#include <Eigen/Cholesky>
#include <Eigen/Eigenvalues>
#include <Eigen/QR>
#include <algorithm>
#include <cmath>
#include <limits>

namespace dashpot::analysis {
namespace {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

/// Of one more parameter, in the criterion: between Akaike's 2, which takes noise for modes, and
/// Schwarz's logarithm of the number of samples, about 9, which lets weak modes spoil strong ones.
constexpr double kPenalty = 4;

/// The least-squares problem at some factors.
class Evaluation {
 public:
  Evaluation(const DecayData& data, const std::vector<DecayFactor>& factors, const VectorXd& noise,
             const VectorXd& record_noise, bool derivatives)
      : squares(MatrixXd::Zero(data.channels, static_cast<Index>(data.records))),
        count(squares),
        record_noise_(record_noise) {
    const Index eigen = factor_width(factors);
    products_ = products_of(factors);
    const Index width = eigen + static_cast<Index>(data.sources()) + product_width(products_);
    const Index p = eigen * static_cast<Index>(data.sources());
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
    basis.middleCols(at, part.inputs()) = direct_columns(part);
    basis.rightCols(width - at - part.inputs()) = product_columns(products_, part);
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
    const MatrixXd amplitude = size.cwiseInverse().asDiagonal() * qr.solve(output);
    MatrixXd residual = qr.householderQ().transpose() * output;
    residual.topRows(rank).setZero();
    residual.applyOnTheLeft(qr.householderQ());

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
    const MatrixXd Q = qr.householderQ() * MatrixXd::Identity(N, rank);
    MatrixXd J(N * channels, normal.rows());
    Index eigen_at = 0, scale_at = eigen;
    for (std::size_t k = 0; k < factors.size(); ++k) {
      const int parameters = factors[k].parameters();
      const MatrixXd of_factor = amplitude.middleRows(eigen_at, parameters);
      const std::size_t derivatives_of_factor = columns[k].derivative.size();
      MatrixXd change(N, static_cast<Index>(derivatives_of_factor) * channels);
      for (std::size_t j = 0; j < derivatives_of_factor; ++j) {
        change.middleCols(static_cast<Index>(j) * channels, channels).noalias() =
            weight.asDiagonal() * columns[k].derivative[j] * of_factor;
      }
      change.noalias() -= Q * (Q.transpose() * change);
      for (std::size_t j = 0; j < derivatives_of_factor; ++j) {
        const bool of_scale = j >= static_cast<std::size_t>(parameters);
        const Index column = of_scale ? scale_at++ : eigen_at + static_cast<Index>(j);
        for (Index c = 0; c < channels; ++c) {
          J.col(column).segment(c * N, N) = change.col(static_cast<Index>(j) * channels + c) /
                                            noise[part.channels[static_cast<std::size_t>(c)]];
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
  std::vector<MotionProduct> products_;
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
      if (step.dot(now.gradient) < 1e-4) return true;  // no step promises more
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
  const auto nonlinear = static_cast<double>(eigen) * static_cast<double>(data.sources());
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
    fit.amplitudes = there.amplitudes;
    const auto linear = static_cast<double>(fit.amplitudes.rows());
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
  // Scaled, so that parameters of unlike size are no deficiency. One that moves nothing, so that
  // squares underflow, tells nothing and is not determined.
  const VectorXd scale = there.normal.diagonal().unaryExpr(
      [](double square) { return square > 1e-200 ? 1 / std::sqrt(square) : 0; });
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
  for (Index i = 0; i < eigen; ++i) {
    if (scale[i] == 0) fit.covariance(i, i) = std::numeric_limits<double>::infinity();
  }
  return fit;
}

double parameter_penalty(const DecayFit& fit, const DecayData& data) {
  const auto nonlinear = factor_width(fit.factors) * static_cast<Index>(data.sources());
  return kPenalty * (static_cast<double>(nonlinear) + static_cast<double>(fit.amplitudes.size()));
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
    result.emplace_back(columns_of(which, part, false).value * amplitude);
  }
  return result;
}

std::vector<MatrixXd> left_over(const DecayData& data, const DecayFit& fit) {
  std::vector<MatrixXd> result;
  const Index constants = factor_width(fit.factors);
  const std::vector<MotionProduct> products = products_of(fit.factors);
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
    MatrixXd others(samples_of(part), fit.amplitudes.rows() - record);
    others.leftCols(part.inputs()) = direct_columns(part);
    others.rightCols(others.cols() - part.inputs()) = product_columns(products, part);
    for (std::size_t c = 0; c < part.channels.size(); ++c) {
      rest.col(static_cast<Index>(c)) -=
          others * fit.amplitudes.col(part.channels[c]).tail(others.cols());
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
