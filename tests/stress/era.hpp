#pragma once
// A textbook's identification beside the project's.

#include <Eigen/Core>
#include <complex>
#include <vector>

namespace dashpot::stress {

/// Poles (1/s, of pairs the one above the axis) that the eigensystem realization algorithm (Juang
/// and Pappa 1985) finds in free decays, and that stay over the orders of its models: frequency
/// within 1 %, ratio within 0.02, modal assurance criterion above 0.95 from one order to the next,
/// in a third of the models. Decays are channels x samples, evenly spaced by `step` (s), and fade
/// about zero. Of correlations it is covariance-driven stochastic subspace identification.
std::vector<std::complex<double>> era_poles(std::vector<Eigen::MatrixXd> decays, double step);

/// Correlations of zero-mean motion, channels x samples, at the lags from 1 to `lags`: a decay for
/// each channel.
std::vector<Eigen::MatrixXd> correlations(const Eigen::MatrixXd& motion, Eigen::Index lags);

}  // namespace dashpot::stress
