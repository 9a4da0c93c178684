#include <dashpot/identification/model/common_denominator.hpp>
#include <dashpot/identification/records/common.hpp>
#include <dashpot/identification/records/motion_spectrum.hpp>

#include <unsupported/Eigen/FFT>

#include <Eigen/Eigenvalues>
#include <Eigen/QR>
#include <algorithm>
#include <cmath>
#include <numbers>

namespace dashpot::identification {
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
