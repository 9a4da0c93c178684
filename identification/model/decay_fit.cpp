#include <dashpot/identification/model/decay_columns.hpp>
#include <dashpot/identification/model/decay_fit.hpp>
#include <dashpot/identification/model/variable_projection.hpp>
#include <dashpot/identification/records/common.hpp>

#include <Eigen/Cholesky>
#include <Eigen/Eigenvalues>
#include <algorithm>
#include <array>
#include <cmath>
#include <utility>

namespace dashpot::identification {
namespace {

/// The criterion's cost of a parameter: between Akaike's 2, which takes noise for modes, and
/// Schwarz's logarithm of the number of samples, about 9, which lets weak modes spoil strong ones.
constexpr double kPenalty = 4;
/// Akaike's is the cost of as many modes of decays as there are channels: an arm is expected to
/// have them, and a model that lacks one shifts its neighbours. With inputs it only finds fewer.
constexpr double kExpected = 2;

/// Radians, or powers of e, from sample to sample: what is faster is over before the second one.
constexpr double kFastest = 10;
constexpr double kMostGrowth = 30;  ///< as an exponent over the record: more than digits can hold
constexpr double kSlowest = 0.1;    ///< radians over the record: what is slower is a constant

// Of Levenberg and Marquardt's method.
constexpr double kFirstDamping = 1e-3, kLeastDamping = 1e-12, kMostDamping = 1e12;
constexpr double kDampingStep = 10;
constexpr int kPatience = 3;               ///< iterations before a fit may be given up,
constexpr double kFurther = 30;            ///< if so many gains like the last one do not save it
constexpr double kLeastRecordNoise = 0.1;  ///< of the mean: no record counts for all others
constexpr double kSettledNoise = 0.02;     ///< change of its logarithm that moves no factor

// Of what is determined. A ridge grows from rounding until the normal matrix is definite.
constexpr double kRidge = 1e-9, kRidgeStep = 100;
constexpr double kUnderflow = 1e-200;  ///< squares of derivatives: smaller ones count as zero
constexpr double kDetermined = 1e-13;  ///< of the largest eigenvalue: what is less is rounding

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
bool makes_sense(const std::vector<DecayFactor>& factors, double longest, double fastest) {
  return std::all_of(factors.begin(), factors.end(), [&](const DecayFactor& factor) {
    const auto lambda = factor.eigenvalues();
    return std::max(modulus(lambda[0]), modulus(lambda[1])) < fastest &&
           std::max(lambda[0].real(), lambda[1].real()) * longest < kMostGrowth &&
           modulus(lambda[0]) * longest > kSlowest;
  });
}

/// s: the longest record, and the mean of its steps.
std::array<double, 2> length_and_step(const DecayData& data) {
  std::array<double, 2> result{};
  for (const DecayPart& part : data.parts) {
    for (const VectorXd& time : part.time) {
      if (time.size() < 2 || time[time.size() - 1] <= result[0]) continue;
      result[0] = time[time.size() - 1];
      result[1] = result[0] / static_cast<double>(time.size() - 1);
    }
  }
  return result;
}

/// Fits `factors` and the noise of channels and records together, starting from `fit`. Each step
/// follows Levenberg and Marquardt with the noise of the last one, and is accepted by the
/// likelihood. Gives up if -2 log likelihood will stay above `hopeless`.
class Descent {
 public:
  Descent(const DecayData& data, DecayFit& fit) : data_(data), fit_(fit) {}

  bool run(int max_iterations, double hopeless) {
    const auto [longest, step_of_time] = length_and_step(data_);
    const double fastest = kFastest / step_of_time;
    const double enough = max_iterations > kFew ? kSmallGain : kSearchGain;
    VariableProjection now(data_, fit_.factors, fit_.noise, fit_.record_noise);
    double lambda = kFirstDamping;
    int quiet = 0;
    for (int i = 0; i < max_iterations; ++i) {
      const double before = misfit(now);
      const bool settled = take_noise(now);
      if (!settled) {
        now = VariableProjection(data_, fit_.factors, fit_.noise, fit_.record_noise);
        quiet = 0;
      }
      now.differentiate();
      bool better = false;
      while (!better && lambda < kMostDamping) {
        MatrixXd A = now.normal;
        A.diagonal() += lambda * now.normal.diagonal().cwiseMax(kTiny);
        const VectorXd step = A.ldlt().solve(now.gradient);
        if (!step.allFinite()) return false;
        if (step.dot(now.gradient) < enough && settled) return true;  // no step promises more
        const std::vector<DecayFactor> next = moved(fit_.factors, step);
        if (makes_sense(next, longest, fastest)) {
          VariableProjection there(data_, next, fit_.noise, fit_.record_noise);
          const double gain = misfit(now) - misfit(there);
          if (gain >= 0) {
            fit_.factors = next;
            now = std::move(there);
            hopeless_ = i > kPatience && misfit(now) - kFurther * (before - misfit(now)) > hopeless;
            if (hopeless_) return false;
            if (gain < enough && ++quiet > 1) return take_noise(now), true;
            lambda = std::max(kLeastDamping, lambda / kDampingStep);
            better = true;
          }
        }
        if (!better) lambda *= kDampingStep;
      }
      if (!better) return true;  // at the minimum to rounding
    }
    take_noise(now);
    return false;
  }

  bool is_hopeless() const { return hopeless_; }

  /// -2 log likelihood at the noise that suits best.
  double misfit(const VariableProjection& there) const {
    const VectorXd count = there.count.rowwise().sum();
    const VectorXd inverse = fit_.record_noise.cwiseAbs2().cwiseInverse();
    double sum = 2 * there.count.colwise().sum().dot(fit_.record_noise.array().log().matrix());
    for (Index c = 0; c < data_.channels; ++c) {
      const double least = std::pow(data_.least_noise(c), 2);
      const double square = there.squares.row(c).dot(inverse) / count[c];
      // Below the least noise the residual still counts by its squares.
      sum += count[c] * (square > least ? std::log(square) : std::log(least) + square / least - 1);
    }
    return sum;
  }

 private:
  static constexpr int kFew = 15;              // iterations of a first estimate
  static constexpr double kSearchGain = 0.02;  // of -2 log likelihood: nothing, beside a parameter
  static constexpr double kSmallGain = 1e-4;

  /// True if they change little.
  bool take_noise(const VariableProjection& there) {
    const VectorXd noise_before = fit_.noise, record_before = fit_.record_noise;
    const VectorXd inverse = fit_.record_noise.cwiseAbs2().cwiseInverse();
    const VectorXd count = there.count.rowwise().sum();
    const double linear = static_cast<double>(there.amplitudes.rows()) +
                          static_cast<double>(factor_width(fit_.factors)) *
                              static_cast<double>(data_.sources()) /
                              static_cast<double>(data_.channels);
    for (Index c = 0; c < data_.channels; ++c) {
      const double squares = there.squares.row(c).dot(inverse);
      fit_.noise[c] =
          std::max(std::sqrt(squares / std::max(1.0, count[c] - linear)), data_.least_noise(c));
    }
    // Each record's, about one: never so unequal that one counts for nothing.
    if (data_.records > 1) {
      const MatrixXd relative = fit_.noise.cwiseAbs2().cwiseInverse().asDiagonal() * there.squares;
      fit_.record_noise = (relative.colwise().sum().transpose())
                              .cwiseQuotient(there.count.colwise().sum().transpose())
                              .cwiseSqrt()
                              .cwiseMax(kLeastRecordNoise);
      fit_.record_noise /= std::exp(fit_.record_noise.array().log().mean());
    }
    return std::max((fit_.noise.array() / noise_before.array()).log().abs().maxCoeff(),
                    (fit_.record_noise.array() / record_before.array()).log().abs().maxCoeff()) <
           kSettledNoise;
  }

  const DecayData& data_;
  DecayFit& fit_;
  bool hopeless_ = false;
};

/// Variance of the estimates over the variance for white noise, because the residual is alike from
/// sample to sample: the mean over the parameters, in the coordinates in which they are
/// uncorrelated, of sums of scores over stretches of time (batch means).
double variance_growth(const VariableProjection& evaluation) {
  const Index p = evaluation.normal.rows();
  if (p == 0) return 1;
  // Where factors are alike, some direction is not determined, and says nothing.
  for (double ridge = kRidge; ridge < 1; ridge *= kRidgeStep) {
    MatrixXd normal = evaluation.normal;
    normal.diagonal() = normal.diagonal().cwiseMax(kTiny) * (1 + ridge);
    const Eigen::LLT<MatrixXd> factor(normal);
    if (factor.info() != Eigen::Success) continue;
    return std::max(1.0, evaluation.squared_scores(factor) / static_cast<double>(p));
  }
  return 1;
}

/// The step of Gauss and Newton, of the eigenvalues.
DecayStep step_of(const VariableProjection& there, const DecayData& data,
                  const std::vector<DecayFactor>& factors, double whiteness) {
  const Index p = there.normal.rows(), eigen = factor_width(factors);
  // Scaled, so that parameters of unlike size do not look deficient. A parameter that moves
  // nothing, so that squares underflow, is not determined.
  const VectorXd scale = there.normal.diagonal().unaryExpr(
      [](double square) { return square > kUnderflow ? 1 / std::sqrt(square) : 0; });
  // Where two factors have become alike, some direction is not determined; the others still are.
  const Eigen::SelfAdjointEigenSolver<MatrixXd> solver(scale.asDiagonal() * there.normal *
                                                       scale.asDiagonal());
  const VectorXd least = VectorXd::Constant(p, kDetermined * solver.eigenvalues().maxCoeff());
  const VectorXd inverse = solver.eigenvalues().cwiseMax(least).cwiseInverse();
  const MatrixXd all = scale.asDiagonal() * solver.eigenvectors() * inverse.asDiagonal() *
                       solver.eigenvectors().transpose() * scale.asDiagonal();
  std::vector<Index> eigenvalues;  // among the parameters
  Index first = 0;
  for (const DecayFactor& factor : factors) {
    for (Index i = 0; i < factor.parameters(); ++i) eigenvalues.push_back(first + i);
    first += factor.parameters() * static_cast<Index>(data.sources());
  }
  DecayStep result{(all * there.gradient)(eigenvalues), all(eigenvalues, eigenvalues) * whiteness};
  if (solver.info() != Eigen::Success || !result.covariance.allFinite()) {
    result.covariance.setConstant(eigen, eigen, std::numeric_limits<double>::infinity());
  }
  for (Index i = 0; i < eigen; ++i) {
    if (scale[eigenvalues[static_cast<std::size_t>(i)]] == 0) {
      result.covariance(i, i) = std::numeric_limits<double>::infinity();
    }
  }
  return result;
}

}  // namespace

DecayFit fit_decays(const DecayData& data, const std::vector<DecayFactor>& start,
                    const VectorXd& noise, int max_iterations, double hopeless) {
  DecayFit fit;
  fit.factors = start;
  fit.noise = noise;
  fit.record_noise.setOnes(static_cast<Index>(data.records));
  find_scales(data, noise, fit.factors);
  Descent descent(data, fit);
  fit.converged = descent.run(max_iterations, hopeless);
  fit.criterion = std::numeric_limits<double>::infinity();
  if (descent.is_hopeless()) return fit;
  VariableProjection there(data, fit.factors, fit.noise, fit.record_noise);
  there.differentiate();
  fit.amplitudes = there.amplitudes;
  fit.criterion = parameter_penalty(fit, data) + descent.misfit(there);
  fit.whiteness = variance_growth(there);
  fit.covariance = step_of(there, data, fit.factors, fit.whiteness).covariance;
  return fit;
}

DecayStep step_of(const DecayData& data, std::vector<DecayFactor> factors, const VectorXd& noise) {
  find_scales(data, noise, factors);
  VariableProjection there(data, factors, noise, VectorXd::Ones(static_cast<Index>(data.records)));
  there.differentiate();
  return step_of(there, data, factors, variance_growth(there));
}

double parameter_penalty(const DecayFit& fit, const DecayData& data) {
  const Index width = factor_width(fit.factors),
              expected = data.inputs > 0 ? 0 : std::min(width, 2 * data.channels);
  const auto each = static_cast<double>(static_cast<Index>(data.sources()) + data.channels);
  const auto others = static_cast<double>((fit.amplitudes.rows() - width) * data.channels);
  return kExpected * each * static_cast<double>(expected) +
         kPenalty * (each * static_cast<double>(width - expected) + others);
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

double squares_of(const DecayData& data, const std::vector<MatrixXd>& motion,
                  const VectorXd& scale) {
  double sum = 0;
  for (std::size_t i = 0; i < motion.size(); ++i) {
    const auto& channels = data.parts[i].channels;
    for (std::size_t c = 0; c < channels.size(); ++c) {
      sum += motion[i].col(static_cast<Index>(c)).squaredNorm() / scale[channels[c]];
    }
  }
  return sum;
}

double energy_of(const DecayData& data, const DecayFit& fit, std::size_t factor) {
  return squares_of(data, factor_motion(data, fit, factor), fit.noise.cwiseAbs2());
}

std::vector<MatrixXd> left_over(const DecayData& data, const DecayFit& fit) {
  std::vector<MatrixXd> result;
  const Index others_from = factor_width(fit.factors) + static_cast<Index>(data.records);
  const std::vector<MotionProduct> products = products_of(fit.factors);
  for (const DecayPart& part : data.parts) {
    MatrixXd others(samples_of(part), part.inputs() + product_width(products));
    others << direct_columns(part), product_columns(products, part);
    result.emplace_back(part.output -
                        others *
                            fit.amplitudes(Eigen::seqN(others_from, others.cols()), part.channels));
  }
  for (std::size_t k = 0; k < fit.factors.size(); ++k) {
    const std::vector<MatrixXd> of_factor = factor_motion(data, fit, k);
    for (std::size_t i = 0; i < result.size(); ++i) result[i] -= of_factor[i];
  }
  for (std::size_t i = 0; i < result.size(); ++i) take_constants(data.parts[i], result[i]);
  return result;
}

}  // namespace dashpot::identification
