#pragma once
// The quadratic eigenvalue solver of S. Hammarling, C. J. Munro and F. Tisseur, ACM Trans. Math.
// Softw. 39 (2013) 18, as far as it matters to regular masses: the scaling of Fan, Lin and Van
// Dooren, the second companion form, zero eigenvalues deflated by the rank of K, and LAPACK's QZ.
#include <dashpot/analysis/system.hpp>

#include <lapacke.h>

#include <Eigen/QR>
#include <algorithm>
#include <cmath>
#include <complex>
#include <vector>

namespace dashpot::bench {

/// The work space that dggev3 asks for with n rows. With less, LAPACK 3.11 writes beyond it.
inline Eigen::VectorXd qz_work_space(Eigen::Index n) {
  const auto rows = static_cast<lapack_int>(n);
  double size = 0;
  LAPACKE_dggev3_work(LAPACK_COL_MAJOR, 'V', 'V', rows, nullptr, rows, nullptr, rows, nullptr,
                      nullptr, nullptr, nullptr, rows, nullptr, rows, &size, -1);
  return Eigen::VectorXd(static_cast<Eigen::Index>(size));
}

/// [C -I; K 0] x = -l [M 0; 0 I] x in these coordinates: rows of M times Q_M' (M P = Q_M R), rows
/// of K times Q_K', of which only the first `rank` are not zero.
class Quadeig {
 public:
  using Matrix = Eigen::MatrixXd;
  using Vector = Eigen::VectorXd;

  explicit Quadeig(Eigen::Index n) : n_(n), work_(qz_work_space(2 * n)) {}

  /// The eigenvalues, 2n; vectors are computed, too, as rivals do.
  std::vector<std::complex<double>> solve(const analysis::System<>& system) {
    const double m = norm(system.mass), c = norm(system.damping), k = norm(system.stiffness);
    const double gamma = std::sqrt(k / m), delta = 2 / (k + c * gamma);
    const Eigen::ColPivHouseholderQR<Matrix> mass(gamma * gamma * delta * system.mass);
    Eigen::ColPivHouseholderQR<Matrix> stiffness(delta * system.stiffness);
    const Eigen::Index rank = stiffness.rank(), size = n_ + rank;
    const Matrix Q_M = mass.householderQ(), Q_K = stiffness.householderQ();
    Matrix R_M = mass.matrixR().triangularView<Eigen::Upper>();
    const Matrix R_K = stiffness.matrixR().topRows(rank).triangularView<Eigen::Upper>();
    A_.setZero(size, size);
    A_.topLeftCorner(n_, n_) =
        Q_M.transpose() * (gamma * delta * system.damping) * mass.colsPermutation();
    A_.topRightCorner(n_, rank) = -Q_M.transpose() * Q_K.leftCols(rank);
    A_.bottomLeftCorner(rank, n_) =
        R_K * (stiffness.colsPermutation().transpose() * Matrix(mass.colsPermutation()));
    B_.setZero(size, size);
    B_.topLeftCorner(n_, n_) = -R_M;
    B_.bottomRightCorner(rank, rank) = -Matrix::Identity(rank, rank);
    Vector re(size), im(size), beta(size);
    vectors_.resize(size, size);
    const auto dim = static_cast<lapack_int>(size);
    LAPACKE_dggev3_work(LAPACK_COL_MAJOR, 'N', 'V', dim, A_.data(), dim, B_.data(), dim, re.data(),
                        im.data(), beta.data(), nullptr, 1, vectors_.data(), dim, work_.data(),
                        static_cast<lapack_int>(work_.size()));
    std::vector<std::complex<double>> values(static_cast<std::size_t>(n_ - rank));
    for (Eigen::Index i = 0; i < size; ++i) {
      values.emplace_back(gamma * re[i] / beta[i], gamma * im[i] / beta[i]);
    }
    return values;
  }

 private:
  /// The largest sum of a row; the scaling wants only its size.
  static double norm(const Matrix& A) { return A.cwiseAbs().rowwise().sum().maxCoeff(); }

  Eigen::Index n_;
  Vector work_;
  Matrix A_, B_, vectors_;
};

}  // namespace dashpot::bench
