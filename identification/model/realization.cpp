#include <dashpot/identification/model/realization.hpp>
#include <dashpot/identification/records/common.hpp>

#include <Eigen/Eigenvalues>
#include <Eigen/QR>
#include <Eigen/SVD>
#include <algorithm>
#include <cmath>
#include <numeric>
#include <utility>

namespace dashpot::identification {

/// A decay that falls to this share by the next sample is over, and no sum of decays shows it.
constexpr double kOver = 1e-4;
constexpr double kRank = 1e-14;  ///< of the largest singular value: the rest is rounding

double likeness(const Eigen::VectorXcd& u, const Eigen::VectorXcd& v) {
  return std::norm(u.dot(v)) / std::max(kTiny, u.squaredNorm() * v.squaredNorm());
}

Eigen::VectorXcd turned(const Eigen::VectorXcd& shape) {
  Index largest = 0;
  shape.cwiseAbs().maxCoeff(&largest);
  const double size = std::abs(shape[largest]);
  if (size == 0) return shape;
  return (shape * (std::conj(shape[largest]) / size)).normalized();
}

Realization::Realization(const std::vector<MatrixXd>& sequences, double step, Index channels,
                         Index max_rows)
    : step_(step), channels_(channels), block_(sequences.front().rows()) {
  Index shortest = sequences.front().cols();
  for (const MatrixXd& sequence : sequences) shortest = std::min(shortest, sequence.cols());
  const Index blocks = std::clamp<Index>(max_rows / block_, 2, std::max<Index>(2, shortest / 2));
  delays_.resize(static_cast<std::size_t>(blocks));
  std::iota(delays_.begin(), delays_.end(), Index{0});
  Index columns = 0;
  for (const MatrixXd& sequence : sequences) {
    columns += std::max<Index>(0, sequence.cols() - blocks + 1);
  }
  MatrixXd hankel(columns, blocks * block_);
  Index at = 0;
  for (const MatrixXd& sequence : sequences) {
    for (Index k = 0; k + blocks <= sequence.cols(); ++k, ++at) {
      for (Index b = 0; b < blocks; ++b) {
        hankel.row(at).segment(b * block_, block_) = sequence.col(k + b).transpose();
      }
    }
  }
  take_basis(std::move(hankel));
}

Realization::Realization(const std::vector<MatrixXd>& sequences, double step,
                         const std::vector<Index>& delays)
    : step_(step), channels_(sequences.front().rows()), block_(channels_), delays_(delays) {
  const auto blocks = static_cast<Index>(delays.size());
  MatrixXd hankel(static_cast<Index>(sequences.size()) * blocks, blocks * block_);
  Index at = 0;
  for (const MatrixXd& sequence : sequences) {
    for (const Index column : delays) {
      for (Index b = 0; b < blocks; ++b) {
        hankel.row(at).segment(b * block_, block_) =
            sequence.col(delays[static_cast<std::size_t>(b)] + column).transpose();
      }
      ++at;
    }
  }
  take_basis(std::move(hankel));
}

void Realization::take_basis(MatrixXd hankel) {
  if (hankel.rows() > hankel.cols()) {
    const Eigen::HouseholderQR<MatrixXd> qr(hankel);
    hankel = qr.matrixQR().topRows(hankel.cols()).triangularView<Eigen::Upper>();
  }
  const Eigen::BDCSVD<MatrixXd> svd(hankel, Eigen::ComputeThinV);
  const auto& sizes = svd.singularValues();
  Index rank = 0;
  while (rank < sizes.size() && sizes[rank] > kRank * sizes[0]) ++rank;
  Index shifts = 0;
  for (std::size_t i = 1; i < delays_.size(); ++i) shifts += delays_[i] == delays_[i - 1] + 1;
  rank = std::min(rank, shifts * block_);
  basis_ = svd.matrixV().leftCols(rank) * sizes.head(rank).cwiseSqrt().asDiagonal();
}

std::vector<RealizedPole> Realization::poles(int order) const {
  const MatrixXd observability = basis_.leftCols(order);
  MatrixXd before(observability.rows(), order), after = before;
  Index rows = 0;
  for (std::size_t i = 1; i < delays_.size(); ++i) {
    if (delays_[i] != delays_[i - 1] + 1) continue;
    const auto block = static_cast<Index>(i) * block_;
    before.middleRows(rows, block_) = observability.middleRows(block - block_, block_);
    after.middleRows(rows, block_) = observability.middleRows(block, block_);
    rows += block_;
  }
  const MatrixXd A = before.topRows(rows).colPivHouseholderQr().solve(after.topRows(rows));
  const Eigen::EigenSolver<MatrixXd> solver(A);
  std::vector<RealizedPole> result;
  if (solver.info() != Eigen::Success) return result;
  for (Index i = 0; i < order; ++i) {
    const Complex z = solver.eigenvalues()[i];
    if (z.imag() < 0 || std::abs(z) < kOver || (z.imag() == 0 && z.real() <= 0)) continue;
    const Eigen::VectorXcd shape = observability.topRows(channels_) * solver.eigenvectors().col(i);
    result.push_back({std::log(z) / step_, shape.normalized()});
  }
  return result;
}

}  // namespace dashpot::identification
