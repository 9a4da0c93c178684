#include <dashpot/analysis/null_damping.hpp>

#include <Eigen/Cholesky>
#include <Eigen/Eigenvalues>
#include <Eigen/SVD>

namespace dashpot::analysis {

using Eigen::MatrixXd;

MatrixXd null_space_damping(const MatrixXd& M, const MatrixXd& J, const MatrixXd& K_C,
                            const MatrixXd& D) {
  const Eigen::LLT<MatrixXd> cholesky(M);
  const Eigen::SelfAdjointEigenSolver<MatrixXd> eigen(K_C);
  const MatrixXd root =
      eigen.eigenvalues().cwiseMax(0).cwiseSqrt().asDiagonal() * eigen.eigenvectors().transpose();
  const MatrixXd held = cholesky.matrixL().solve((root * J).transpose());  // n x m
  const Eigen::JacobiSVD<MatrixXd> svd(held, Eigen::ComputeThinU);
  const MatrixXd V = svd.matrixU().leftCols(svd.rank());
  const MatrixXd P = MatrixXd::Identity(M.rows(), M.rows()) - V * V.transpose();
  const MatrixXd L = cholesky.matrixL();
  const MatrixXd N = cholesky.matrixU().solve(P * L.transpose());
  const MatrixXd result = N.transpose() * D * N;
  return 0.5 * (result + result.transpose());
}

}  // namespace dashpot::analysis
