#include <dashpot/analysis/identification/decay_columns.hpp>
#include <dashpot/analysis/identification/decay_fit.hpp>
#include <dashpot/analysis/identification/decay_scales.hpp>
#include <dashpot/analysis/identification/variable_projection.hpp>

#include <Eigen/Cholesky>
#include <Eigen/Eigenvalues>
#include <algorithm>
#include <cmath>
#include <limits>
#include <utility>

namespace dashpot::analysis {
namespace {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

/// Of one more parameter, in the criterion: between Akaike's 2, which takes noise for modes, and
/// Schwarz's logarithm of the number of samples, about 9, which lets weak modes spoil strong ones.
constexpr double kPenalty = 4;

std::vector<DecayFactor> moved(const std::vector<DecayFactor>& factors, const VectorXd& step) {
  std::vector<DecayFactor> result = factors;
  Index at = 0;
  for (DecayFactor& factor : result) {
    factor.first += step[at++];
    if (factor.pair) factor.second += step[at++];
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
  VariableProjection now(data, factors, noise, record_noise);
  now.differentiate();
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
        VariableProjection there(data, next, noise, record_noise);
        const double gain = now.cost - there.cost;
        if (gain >= 0) {
          factors = next;
          const double size = step.dot(now.normal * step);
          if (gain < 1e-4 || size < 1e-4) return true;  // far below what noise does
          if (i > 3 && now.cost - 30 * gain > hopeless) return false;
          now = std::move(there);
          now.differentiate();
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
double variance_growth(const VariableProjection& evaluation) {
  const Index p = evaluation.normal.rows();
  const Eigen::LLT<MatrixXd> factor(evaluation.normal);
  if (p == 0 || factor.info() != Eigen::Success) return 1;
  return std::max(1.0, evaluation.squared_scores(factor) / static_cast<double>(p));
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
    const VariableProjection there(data, fit.factors, fit.noise, fit.record_noise);
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
  VariableProjection there(data, fit.factors, fit.noise, fit.record_noise);
  there.differentiate();
  fit.amplitudes = there.amplitudes;
  fit.whiteness = variance_growth(there);
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
  std::vector<Index> eigenvalues;  // among the parameters
  Index first = 0;
  for (const DecayFactor& factor : fit.factors) {
    for (Index i = 0; i < factor.parameters(); ++i) eigenvalues.push_back(first + i);
    first += factor.parameters() * static_cast<Index>(data.sources());
  }
  fit.covariance = all(eigenvalues, eigenvalues);
  if (solver.info() != Eigen::Success || !fit.covariance.allFinite()) {
    fit.covariance.setConstant(eigen, eigen, std::numeric_limits<double>::infinity());
  }
  for (Index i = 0; i < eigen; ++i) {
    if (scale[eigenvalues[static_cast<std::size_t>(i)]] == 0) {
      fit.covariance(i, i) = std::numeric_limits<double>::infinity();
    }
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
