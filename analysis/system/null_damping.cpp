#include <dashpot/analysis/base/arithmetic.hpp>
#include <dashpot/analysis/null_damping.hpp>
#include <dashpot/analysis/system/checks.hpp>

#include <Eigen/Cholesky>
#include <Eigen/Eigenvalues>
#include <Eigen/SVD>
#include <limits>

namespace dashpot::analysis {
namespace {

using Eigen::Index;
using Eigen::MatrixXd;
using Extended = long double;
/// Rounding of numbers that were double before.
constexpr Extended kRounding = static_cast<Extended>(std::numeric_limits<double>::epsilon());
using ExtendedMatrix = Eigen::Matrix<Extended, Eigen::Dynamic, Eigen::Dynamic>;
using ExtendedVector = Eigen::Matrix<Extended, Eigen::Dynamic, 1>;

constexpr Extended kExtendedUnit = std::numeric_limits<Extended>::epsilon();

/// F (m x k) with K_C = F F', from the eigenvalues of K_C scaled to a unit diagonal.
struct SpringFactor {
  ExtendedMatrix F;
  ExtendedVector scale;
  Extended error = 0;  ///< |scale^-1 (error of F)|; zero if F has full rank, where it spans all
};

SpringFactor spring_factor(const MatrixXd& K_C) {
  MatrixXd K = K_C, K_error;
  make_symmetric(K, K_error);
  const Index m = K.rows();
  SpringFactor factor;
  if (m == 0) return factor;
  factor.scale = K.diagonal().cast<Extended>().cwiseAbs().cwiseSqrt();
  const ExtendedVector unscale =
      (factor.scale.array() > 0).select(factor.scale.cwiseInverse(), Extended(0));
  const Eigen::SelfAdjointEigenSolver<ExtendedMatrix> eigen(
      ExtendedMatrix(unscale.asDiagonal() * K.cast<Extended>() * unscale.asDiagonal()));
  // Entries of K_C are rounded, so that eigenvalues of this size are taken for zero.
  const ExtendedVector& values = eigen.eigenvalues();
  Extended rounding = 16 * static_cast<Extended>(m) * kRounding * values.cwiseAbs().maxCoeff();
  if (K_error.rows() > 0) {
    rounding += (unscale.asDiagonal() * K_error.cast<Extended>() * unscale.asDiagonal()).norm();
  }
  const Index kept = (values.array() > rounding).count();
  const ExtendedVector roots = values.tail(kept).cwiseSqrt();
  factor.F = factor.scale.asDiagonal() * eigen.eigenvectors().rightCols(kept) * roots.asDiagonal();
  const bool full = kept == (factor.scale.array() > 0).count();
  if (!full && kept > 0) factor.error = rounding / roots[0];
  return factor;
}

}  // namespace

NullSpaceDamping null_space_damping(MatrixXd M, const MatrixXd& J, const MatrixXd& K_C,
                                    const MatrixXd& D, MatrixXd M_error) {
  const Index n = M.rows();
  make_symmetric(M, M_error);
  const Eigen::LLT<ExtendedMatrix> cholesky(M.cast<Extended>());
  const SpringFactor springs = spring_factor(K_C);
  const ExtendedMatrix JT = J.transpose().cast<Extended>();
  ExtendedVector omega(0);
  ExtendedMatrix U(n, 0);
  if (springs.F.cols() > 0) {
    const ExtendedMatrix J_hat = cholesky.matrixL().solve(JT * springs.F);
    const Eigen::JacobiSVD<ExtendedMatrix> svd(J_hat, Eigen::ComputeThinU);
    omega = svd.singularValues();
    U = svd.matrixU();
  }
  const Extended floor = static_cast<Extended>(std::max(n, J.rows())) * kRounding *
                         (omega.size() > 0 ? omega[0] : Extended(0));
  const Index rank = (omega.array() > floor).count();
  const ExtendedMatrix V = U.leftCols(rank), L = cholesky.matrixL();
  const ExtendedMatrix P = ExtendedMatrix::Identity(n, n) - V * V.transpose();
  const ExtendedMatrix half = cholesky.matrixL().solve(D.cast<Extended>());
  const ExtendedMatrix D_hat = cholesky.matrixL().solve(ExtendedMatrix(half.transpose()));
  const ExtendedMatrix product = L * P * D_hat * P * L.transpose();

  NullSpaceDamping result;
  result.damping = (0.5L * (product + product.transpose())).cast<double>();
  // With S = diag(sqrt(M_ii)) and x = |L^-1 S|, an error E of M is one of x^2 |S^-1 E S^-1| in
  // L^-1 M L^-T. `relative` is that and the rounding errors of Cholesky factors, solutions and
  // products (Higham, Accuracy and Stability of Numerical Algorithms, 2002, Theorems 8.5, 10.3).
  const ExtendedVector s = M.diagonal().cast<Extended>().cwiseSqrt(), inverse = s.cwiseInverse();
  const Extended x2 = cholesky.matrixL().solve(ExtendedMatrix(s.asDiagonal())).squaredNorm();
  Extended relative =
      24 * static_cast<Extended>((n + J.rows()) * (n + J.rows())) * kExtendedUnit * x2;
  if (M_error.rows() > 0) {
    relative +=
        x2 * (inverse.asDiagonal() * M_error.cast<Extended>() * inverse.asDiagonal()).norm();
  }
  // Wedin: the span of V turns by |error of L^-1 J' F| / (gap between singular values).
  const ExtendedMatrix scaled_J = inverse.asDiagonal() * JT.cwiseAbs();
  const Extended turned_by =
      std::sqrt(x2) * (relative * (scaled_J * springs.F.cwiseAbs()).norm() +
                       springs.error * (scaled_J * springs.scale.asDiagonal()).norm());
  const Extended gap = (rank > 0 ? omega[rank - 1] : std::numeric_limits<Extended>::max()) -
                       (rank < omega.size() ? omega[rank] : Extended(0));
  const bool clear = 4 * turned_by < gap && relative < 0.01L;
  const Extended turn = rank == n ? 0 : 2 * turned_by / gap;
  const Extended D_size =
      x2 * (inverse.asDiagonal() * D.cast<Extended>() * inverse.asDiagonal()).norm();
  const Extended error = D_size * (3 * turn + 6 * relative);
  result.error.setConstant(n, n, kInfinity);
  if (!clear) return result;
  result.error = (error * s * s.transpose()).cast<double>() +
                 std::numeric_limits<double>::epsilon() * result.damping.cwiseAbs();
  return result;
}

}  // namespace dashpot::analysis
