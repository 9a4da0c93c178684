#pragma once
#include <Eigen/Core>
#include <array>
#include <complex>
#include <vector>

namespace dashpot::testing {

/// A motion near an equilibrium, sampled at a constant period, such as a release of the robot
/// shows.
struct Recording {
  Eigen::MatrixXd position;  ///< n x samples, deviation from the equilibrium, rad (m)
  Eigen::MatrixXd velocity;  ///< n x samples, rad/s (m/s)
};

struct FittedMode {
  std::array<std::complex<double>, 2> eigenvalues;  ///< a complex pair or two real ones, 1/s
  double natural_frequency = 0;                     ///< rad/s
  double damping_ratio = 0;
};

struct StateFit {
  std::vector<FittedMode> modes;  ///< by falling natural frequency
  double residual = 0;            ///< |X1 - A X0| / |X1|, Frobenius norms
};

/// Fits the modes that motions show, by a method that shares nothing with `identification`. Near an
/// equilibrium x = (w L' q, L' q') moves as x(t + s T) = A x(t), with T the period, M = L L' the
/// mass, n x n, and w = |L' q'| / |L' q| over all samples, which balances the two halves. With X0
/// the samples side by side, X1 the samples s periods later, and X0 = U S V' to r singular values,
///     A_r = U' X1 V S^-1   (r x r)
/// is the least-squares A in the directions that the motions show. Each of its eigenvalues z gives
/// log(z) / (s T): the dynamic mode decomposition of Tu et al. 2014 with velocities instead of
/// delays. The fastest mode that the data determine turns by about 1 rad in s T.
StateFit fit_states(const std::vector<Recording>& recordings, double period,
                    const Eigen::MatrixXd& mass);

}  // namespace dashpot::testing
