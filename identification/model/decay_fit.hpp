#pragma once
#include <dashpot/identification/model/decay_data.hpp>

#include <limits>
#include <vector>

namespace dashpot::identification {

/// A sum of decays about constants that fits data best.
struct DecayFit {
  std::vector<DecayFactor> factors;
  Eigen::MatrixXd covariance;  ///< of the factors' `first` and `second`, in their order
  /// Columns of the model (two for each pair, one for a single, then a constant for each record,
  /// each input itself, and the products) x channels.
  Eigen::MatrixXd amplitudes;
  Eigen::VectorXd noise;  ///< of each channel, standard deviation of the residual
  /// Noise of each record, relative to `noise`: a large motion is less linear, and counts less.
  Eigen::VectorXd record_noise;
  double criterion = 0;  ///< -2 log likelihood + 4 for each parameter; smaller is better
  double whiteness = 1;  ///< factor on the covariance, because the residual is not white
  bool converged = false;
};

/// Fits y(t) = c_0 + sum of the factors' free motions and of their products by least squares, each
/// channel weighted by its noise, which is estimated as well: the maximum likelihood for noise that
/// is white and normal. The amplitudes are eliminated (VariableProjection); the factors are found
/// by Levenberg and Marquardt's method. Gives up, with an infinite criterion, if -2 log likelihood
/// will stay above `hopeless`.
DecayFit fit_decays(const DecayData& data, const std::vector<DecayFactor>& start,
                    const Eigen::VectorXd& noise, int max_iterations,
                    double hopeless = std::numeric_limits<double>::infinity());

/// Difference of the eigenvalues (`first` and `second` of the factors) for some data alone, to
/// first order, and its covariance.
struct DecayStep {
  Eigen::VectorXd step;
  Eigen::MatrixXd covariance;
};
DecayStep step_of(const DecayData& data, std::vector<DecayFactor> factors,
                  const Eigen::VectorXd& noise);

/// Returns the part of a fit's criterion that its parameters cost.
double parameter_penalty(const DecayFit& fit, const DecayData& data);

/// A factor's part of the model, and the model's residual: samples x channels for each part of the
/// data.
std::vector<Eigen::MatrixXd> factor_motion(const DecayData& data, const DecayFit& fit,
                                           std::size_t factor);
std::vector<Eigen::MatrixXd> left_over(const DecayData& data, const DecayFit& fit);

/// The sum of the squares of such motion, each channel in units of its `scale`.
double squares_of(const DecayData& data, const std::vector<Eigen::MatrixXd>& motion,
                  const Eigen::VectorXd& scale);

/// The squares of a factor's part, in units of the noise.
double energy_of(const DecayData& data, const DecayFit& fit, std::size_t factor);

}  // namespace dashpot::identification
