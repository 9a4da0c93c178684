#include <dashpot/identification/model/realization.hpp>
#include <dashpot/identification/records/common.hpp>
#include <dashpot/identification/records/motion_spectrum.hpp>

#include <Eigen/Eigenvalues>
#include <Eigen/QR>
#include <Eigen/SVD>
#include <algorithm>
#include <cmath>
#include <numbers>
#include <numeric>
#include <unsupported/Eigen/FFT>
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

namespace {

/// Spectra of the records, one after the other: lines x channels, lines x inputs, z^-1, and the
/// record of each line.
struct Lines {
  MatrixXcd output, input;
  VectorXcd delay;
  std::vector<Index> first;  ///< line of each record, and the end
};

VectorXcd spectrum(const VectorXd& samples) {
  Eigen::FFT<double> fft;
  VectorXcd result;
  fft.fwd(result, samples);
  return result;
}

Lines lines_of(const std::vector<MotionRecord>& records, double step, double highest) {
  Lines lines;
  lines.first.push_back(0);
  for (const MotionRecord& record : records) {
    const Index N = smooth_count(record.time.size());
    const double width = 2 * std::numbers::pi / (static_cast<double>(N) * step);
    const Index count = std::min(static_cast<Index>(highest / width), N / 2 - 1);
    lines.first.push_back(lines.first.back() + std::max<Index>(0, count));
  }
  const Index all = lines.first.back();
  lines.output.resize(all, records.front().output.rows());
  lines.input.resize(all, records.front().input.rows());
  lines.delay.resize(all);
  for (std::size_t r = 0; r < records.size(); ++r) {
    const Index from = lines.first[r], count = lines.first[r + 1] - from;
    const Index N = smooth_count(records[r].time.size());
    const double size = 1 / std::sqrt(static_cast<double>(N));
    for (Index c = 0; c < lines.output.cols(); ++c) {
      const VectorXd y = records[r].output.row(c).head(N);
      lines.output.col(c).segment(from, count) =
          spectrum(y.array() - y.mean()).segment(1, count) * size;
    }
    for (Index i = 0; i < lines.input.cols(); ++i) {
      lines.input.col(i).segment(from, count) =
          spectrum(records[r].input.row(i).head(N).transpose()).segment(1, count) * size;
    }
    for (Index k = 0; k < count; ++k) {
      const double w =
          2 * std::numbers::pi * static_cast<double>(k + 1) / (static_cast<double>(N) * step);
      lines.delay[from + k] = std::polar(1.0, -std::numbers::pi * w / highest);
    }
  }
  return lines;
}

/// Real and imaginary parts below each other.
MatrixXd both(const MatrixXcd& lines) {
  MatrixXd result(2 * lines.rows(), lines.cols());
  result << lines.real(), lines.imag();
  return result;
}

/// The poles of one order; `step` (s) belongs to z.
std::vector<RealizedPole> poles_of(const Lines& lines, int order, double step) {
  const Index width = order + 1, all = lines.delay.size();
  const auto records = static_cast<Index>(lines.first.size()) - 1;
  MatrixXcd powers(all, width);
  for (Index j = 0; j < width; ++j) powers.col(j) = lines.delay.array().pow(static_cast<double>(j));
  MatrixXcd numerators = MatrixXcd::Zero(all, width * (lines.input.cols() + records));
  for (Index i = 0; i < lines.input.cols(); ++i) {
    numerators.middleCols(i * width, width) = lines.input.col(i).asDiagonal() * powers;
  }
  for (Index r = 0; r < records; ++r) {
    const Index from = lines.first[static_cast<std::size_t>(r)];
    const Index count = lines.first[static_cast<std::size_t>(r) + 1] - from;
    numerators.block(from, width * (lines.input.cols() + r), count, width) =
        powers.middleRows(from, count);
  }
  const Eigen::ColPivHouseholderQR<MatrixXd> qr(both(numerators));
  const Index rank = qr.rank(), channels = lines.output.cols();
  if (2 * all - rank < 1) return {};
  MatrixXd normal = MatrixXd::Zero(width, width);
  std::vector<MatrixXd> denominators;
  for (Index c = 0; c < channels; ++c) {
    denominators.push_back(both(lines.output.col(c).asDiagonal() * powers));
    MatrixXd rest = denominators.back();
    rest.applyOnTheLeft(qr.householderQ().transpose());
    const auto left = rest.bottomRows(2 * all - rank);
    normal.noalias() += left.transpose() * left;
  }
  // With the first coefficient 1, poles that noise makes up are damped most.
  VectorXd a(width);
  a[0] = 1;
  a.tail(order) = -normal.bottomRightCorner(order, order)
                       .selfadjointView<Eigen::Lower>()
                       .ldlt()
                       .solve(normal.col(0).tail(order));
  if (!a.allFinite()) return {};
  MatrixXd companion = MatrixXd::Zero(order, order);
  companion.row(0) = -a.tail(order).transpose();
  companion.bottomLeftCorner(order - 1, order - 1).setIdentity();
  const Eigen::EigenSolver<MatrixXd> solver(companion, false);
  std::vector<RealizedPole> result;
  if (solver.info() != Eigen::Success) return result;
  MatrixXd numerator(qr.cols(), channels);
  for (Index c = 0; c < channels; ++c) {
    numerator.col(c) = qr.solve(denominators[static_cast<std::size_t>(c)] * a);
  }
  for (const Complex z : solver.eigenvalues()) {
    if (z.imag() < 0 || (z.imag() == 0 && z.real() <= 0)) continue;
    VectorXcd powers_at(width);
    for (Index j = 0; j < width; ++j) powers_at[j] = std::pow(1.0 / z, static_cast<double>(j));
    VectorXcd shape = VectorXcd::Zero(channels);  // of the residues: B(z) / A'(z)
    for (Index i = 0; i < lines.input.cols(); ++i) {
      const VectorXcd residue =
          numerator.middleRows(i * width, width).cast<Complex>().transpose() * powers_at;
      if (residue.norm() > shape.norm()) shape = residue;
    }
    if (!(shape.norm() > 0)) continue;
    result.push_back({std::log(z) / step, shape.normalized()});
  }
  return result;
}

}  // namespace

std::vector<std::vector<RealizedPole>> common_denominator_poles(
    const std::vector<MotionRecord>& records, double step, int max_order, double highest) {
  const double band = std::min(highest, std::numbers::pi / step);
  const Lines lines = lines_of(records, step, band);
  std::vector<std::vector<RealizedPole>> by_order;
  const auto sources = lines.input.cols() + static_cast<Index>(records.size());
  for (int order = 1; order <= max_order; ++order) {
    if (2 * lines.delay.size() < (order + 1) * (sources + 1)) break;
    by_order.push_back(poles_of(lines, order, std::numbers::pi / band));
  }
  return by_order;
}

}  // namespace dashpot::identification
