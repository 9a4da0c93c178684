#pragma once
#include <dashpot/identification/motion_record.hpp>

#include <vector>

namespace dashpot::identification {

/// An eigenvalue of a realization; of a pair the one with positive imaginary part only.
struct RealizedPole {
  Complex eigenvalue;      ///< 1/s
  Eigen::VectorXcd shape;  ///< channels, unit length
};

/// |u' v|^2 / (|u|^2 |v|^2), the modal assurance criterion.
double likeness(const Eigen::VectorXcd& u, const Eigen::VectorXcd& v);

/// Returns the shape with unit length, its largest entry real and positive.
Eigen::VectorXcd turned(const Eigen::VectorXcd& shape);

/// Models x(k+1) = A x(k), y(k) = C x(k) of rising order for sequences that are sums of decays: the
/// eigensystem realization algorithm (Juang and Pappa 1985), with A from the shift within the
/// observability matrix that the left singular vectors of the block Hankel matrix are. Of
/// correlations it is covariance-driven stochastic subspace identification (Peeters and De Roeck
/// 1999).
class Realization {
 public:
  /// `sequences`: rows x samples each, evenly spaced by `step` (s). The first `channels` rows give
  /// the shapes. The Hankel matrix gets at most `max_rows` rows, and all samples.
  Realization(const std::vector<Eigen::MatrixXd>& sequences, double step, Eigen::Index channels,
              Eigen::Index max_rows);
  /// The block of the Hankel matrix in row i and column j is the sample `delays[i] + delays[j]`, of
  /// rising delays, of which some follow each other.
  Realization(const std::vector<Eigen::MatrixXd>& sequences, double step,
              const std::vector<Eigen::Index>& delays);

  int max_order() const { return static_cast<int>(basis_.cols()); }
  /// Without those that no sum of decays has: eigenvalues of A that are negative or zero.
  std::vector<RealizedPole> poles(int order) const;

 private:
  void take_basis(Eigen::MatrixXd hankel);  // transposed

  double step_;
  Eigen::Index channels_, block_;
  std::vector<Eigen::Index> delays_;  ///< of the blocks of rows
  Eigen::MatrixXd basis_;  ///< singular vectors times roots of singular values, rows x orders
};

/// Poles of models from inputs to outputs of rising order, from order 1: least squares in the
/// frequency domain with one denominator for all channels (LSCF, Guillaume et al. 2003),
///
///     A(z) Y(f) = sum of B_i(z) U_i(f) + T_r(z),
///
/// on the spectra of whole records r, up to `highest` (rad/s). The polynomials T_r describe the
/// beginning and end of a record (leakage), so no window is needed. The records are evenly spaced
/// by `step` (s), their channels of like noise, without missing samples.
std::vector<std::vector<RealizedPole>> common_denominator_poles(
    const std::vector<MotionRecord>& records, double step, int max_order, double highest);

}  // namespace dashpot::identification
