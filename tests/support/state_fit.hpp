#pragma once
#include <dashpot/analysis/mode.hpp>

#include <vector>

namespace dashpot::testing {

using analysis::Complex;
using analysis::ModeKind;

/// A motion near an equilibrium, sampled at a constant period, such as a release of the robot
/// shows.
struct Recording {
  Eigen::MatrixXd position;  ///< n x samples, deviation from the equilibrium, rad (m)
  Eigen::MatrixXd velocity;  ///< n x samples, rad/s (m/s)
};

struct IdentificationOptions {
  double period = 0.001;  ///< T, time between two samples, s
  /// s, in samples, see identify_modes. 0: chosen so that the fastest mode that the data determine
  /// turns or decays by about 1 rad in s T, within a quarter of the shortest recording.
  int stride = 0;
  /// Directions in state space in which the motions are smaller than this times their largest count
  /// as not shown by the data. It has to lie above rounding errors and nonlinear effects, and below
  /// the least excitation.
  double rank_tolerance = 1e-10;
  double soft_frequency = 0.1;  ///< modes below this are called soft, rad/s
  /// M, n x n: motions are measured by their energy. Empty: the identity, for coordinates with the
  /// same unit and similar inertias.
  Eigen::MatrixXd mass = {};
};

/// A mode that recordings show; the terms are as in Mode. The errors are estimates, not proofs:
/// first-order errors for the case that all of the residual lies in the worst direction.
struct IdentifiedMode {
  std::array<Complex, 2> eigenvalues{};  ///< a complex pair or two real ones, 1/s
  double natural_frequency = 0;          ///< rad/s; NaN if the eigenvalues' product is negative
  double damping_ratio = 0;
  double damped_frequency = 0;  ///< rad/s
  ModeKind kind = ModeKind::kUnderdamped;
  double error = 0;                    ///< of either eigenvalue, 1/s
  double natural_frequency_error = 0;  ///< rad/s; infinite where the data do not determine it
  double damping_ratio_error = 0;      ///< infinite where the data do not determine it
  Eigen::VectorXcd shape;              ///< u of the first eigenvalue, n, unit length
};

struct IdentifiedModes {
  std::vector<IdentifiedMode> modes;  ///< by falling sqrt|lambda_1 lambda_2|
  /// Eigenvalues without a partner, 1/s: one of two real eigenvalues of which the data show only
  /// one, or the eigenvalue of a z that is negative (then the imaginary part is pi / (s T)) or
  /// zero.
  std::vector<Complex> unpaired;
  int stride = 0;        ///< s
  int rank = 0;          ///< r, number of directions in state space that the data show; 2n: all
  double residual = 0;   ///< |X1 - A X0| / |X1|, Frobenius norms
  double condition = 0;  ///< largest over smallest extent of the motions in these directions
};

/// Identifies the modes that motions show. Near an equilibrium x = (w L' q, L' q') moves as
/// x(t + s T) = A x(t), with M = L L' and w = |L' q'| / |L' q| over all samples, which balances the
/// two halves. With X0 the samples of all recordings side by side, X1 the samples s periods later,
/// and X0 = U S V' to r singular values,
///     A_r = U' X1 V S^-1   (r x r)
/// is the least-squares A within the directions shown. Each of its eigenvalues z gives
/// lambda = log(z) / (s T): the dynamic mode decomposition of Tu et al. 2014 with velocities
/// instead of delays. Complex eigenvalues pair with their conjugates, real ones by the similarity
/// of their shapes. |Im lambda| s T has to be below pi.
///
/// The estimated error of z with right and left eigenvectors x and y (y x = 1) is
///     (|y (U' X1 - A_r S V')| + eps |y| |X1|) |S^-1 x|,
/// so modes that are hardly excited, or hidden behind others, have large errors.
///
/// Throws std::invalid_argument for recordings of different n or of unequal halves, entries that
/// are not finite, not more than 2n pairs of samples s apart, no motion at all, or options that
/// make no sense.
IdentifiedModes identify_modes(const std::vector<Recording>& recordings,
                               const IdentificationOptions& options = {});

}  // namespace dashpot::testing
