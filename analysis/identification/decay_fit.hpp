#pragma once
#include <dashpot/analysis/identification.hpp>

#include <array>
#include <limits>
#include <vector>

namespace dashpot::analysis {

/// A factor of the characteristic polynomial of decays, s^2 + 2 zeta omega s + omega^2, underdamped
/// or not, or s - lambda, and how strongly and in which phase each record has it.
struct DecayFactor {
  bool pair = true;
  double first = 0;   ///< log(omega), omega in rad/s; or lambda, 1/s
  double second = 0;  ///< zeta; not used by a single lambda
  /// In record r the motion x(t) of the reference record is scale[r][0] x + scale[r][1] x' / omega,
  /// or scale[r][0] x for a single lambda: one shape for all records. Empty: not known yet.
  std::vector<std::array<double, 2>> scale = {};
  std::size_t reference = 0;

  int parameters() const { return pair ? 2 : 1; }
  /// 1/s; the same one twice where there is one.
  std::array<Complex, 2> eigenvalues() const;

  static DecayFactor of_pair(Complex eigenvalue);  ///< and its conjugate
  static DecayFactor of_single(double eigenvalue) { return {false, eigenvalue, 0}; }
};

/// What records say for channels that have samples at the same times.
struct DecayPart {
  std::vector<Eigen::VectorXd> time;   ///< of each record, s, from its beginning
  Eigen::MatrixXd output;              ///< samples of all records, one after the other, x channels
  std::vector<Eigen::Index> channels;  ///< which of the records' channels
};

/// Decays in the form in which they are fitted, the missing samples left out.
struct DecayData {
  std::vector<DecayPart> parts;
  Eigen::Index channels = 0;
  std::size_t records = 0;
  /// Of each channel, standard deviation: no noise is taken to be less than kLinear of it.
  Eigen::VectorXd motion;

  /// To which share of itself the motion of an arm is linear, at best. What is smaller is not
  /// looked for in it.
  static constexpr double kLinear = 1e-4;

  double least_noise(Eigen::Index channel) const;

  explicit DecayData(const std::vector<MotionRecord>& all);
};

/// A sum of decays about constants that fits data best.
struct DecayFit {
  std::vector<DecayFactor> factors;
  Eigen::MatrixXd covariance;  ///< of the factors' `first` and `second`, in their order
  /// Columns of the model (two for each pair, one for a single, then a constant for each record) x
  /// channels.
  Eigen::MatrixXd amplitudes;
  Eigen::VectorXd noise;  ///< of each channel, standard deviation of what is left over
  /// Of each record, relative to `noise`: what is large is less linear, and counts less.
  Eigen::VectorXd record_noise;
  double criterion = 0;  ///< -2 log likelihood + 4 for each parameter; smaller is better
  double whiteness = 1;  ///< by how much the covariance grew because what is left over is no noise
  bool converged = false;
};

/// Fits y(t) = c_0 + sum of the factors' free motions by least squares, each channel weighted by
/// its noise, which is estimated as well: the maximum likelihood for noise that is white and
/// normal. The amplitudes are eliminated (variable projection, Golub and Pereyra 1973, with
/// Kaufman's Jacobian); the factors are found by Levenberg and Marquardt's method. Gives
/// up, with an infinite criterion, where the squares of what is left over, in units of `noise`,
/// will stay above `hopeless`.
DecayFit fit_decays(const DecayData& data, const std::vector<DecayFactor>& start,
                    const Eigen::VectorXd& noise, int max_iterations,
                    double hopeless = std::numeric_limits<double>::infinity());

/// Samples of a part.
inline Eigen::Index samples_of(const DecayPart& part) {
  return part.output.rows();
}

/// What a fit's criterion counts for its parameters.
double parameter_penalty(const DecayFit& fit, const DecayData& data);

/// The part of the model that belongs to a factor, and what the model leaves over: samples x
/// channels for each part of the data.
std::vector<Eigen::MatrixXd> factor_motion(const DecayData& data, const DecayFit& fit,
                                           std::size_t factor);
std::vector<Eigen::MatrixXd> left_over(const DecayData& data, const DecayFit& fit);

}  // namespace dashpot::analysis
