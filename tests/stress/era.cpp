#include <dashpot/tests/stress/era.hpp>

#include <Eigen/Eigenvalues>
#include <algorithm>
#include <cmath>

namespace dashpot::stress {
namespace {

using Eigen::Index;
using Eigen::MatrixXd;
using Complex = std::complex<double>;

constexpr Index kMostOrder = 40, kOrderStep = 2, kMostRows = 420;
constexpr double kSameFrequency = 0.01, kSameRatio = 0.02, kSameShape = 0.95;

struct Pole {
  Complex value;
  Eigen::VectorXcd shape;
};

/// A pole that goes on from order to order.
struct Chain {
  std::vector<Pole> poles;
  bool ended = false;
};

double ratio(Complex value) {
  return -value.real() / std::abs(value);
}

bool same(const Pole& a, const Pole& b) {
  const double likeness =
      std::norm(a.shape.dot(b.shape)) / (a.shape.squaredNorm() * b.shape.squaredNorm());
  return std::abs(std::abs(a.value) / std::abs(b.value) - 1) < kSameFrequency &&
         std::abs(ratio(a.value) - ratio(b.value)) < kSameRatio && likeness > kSameShape;
}

/// The block Hankel matrix of `rows` x `columns` blocks from sample `from` on, a column for each
/// decay in each block.
MatrixXd hankel(const std::vector<MatrixXd>& decays, Index from, Index rows, Index columns) {
  const Index channels = decays.front().rows(), count = static_cast<Index>(decays.size());
  MatrixXd H(rows * channels, columns * count);
  for (Index j = 0; j < columns; ++j) {
    for (Index d = 0; d < count; ++d) {
      const MatrixXd part = decays[static_cast<std::size_t>(d)].middleCols(from + j, rows);
      H.col(j * count + d) = part.reshaped();
    }
  }
  return H;
}

/// Models of rising order: A = S^-1/2 U' H1 V S^-1/2 with H0 = U S V'.
class Models {
 public:
  Models(const std::vector<MatrixXd>& decays, double step)
      : step_(step), channels_(decays.front().rows()) {
    const Index samples = decays.front().cols();
    const Index rows = std::min(samples / 2, kMostRows / channels_);
    const MatrixXd H0 = hankel(decays, 0, rows, samples - rows);
    const MatrixXd H1 = hankel(decays, 1, rows, samples - rows);
    const Eigen::SelfAdjointEigenSolver<MatrixXd> solver(H0 * H0.transpose());
    U_ = solver.eigenvectors().rowwise().reverse().leftCols(std::min(kMostOrder, H0.rows()));
    const Eigen::VectorXd squares = solver.eigenvalues().reverse().head(U_.cols());
    S_ = squares.cwiseMax(1e-14 * squares[0]).cwiseSqrt();
    shifted_ = U_.transpose() * (H1 * (H0.transpose() * U_)) * S_.cwiseInverse().asDiagonal();
  }

  Index most() const { return U_.cols(); }

  std::vector<Pole> poles(Index order) const {
    const Eigen::VectorXd root = S_.head(order).cwiseSqrt();
    const MatrixXd A = root.cwiseInverse().asDiagonal() * shifted_.topLeftCorner(order, order) *
                       root.cwiseInverse().asDiagonal();
    const Eigen::EigenSolver<MatrixXd> solver(A);
    const MatrixXd C = U_.topLeftCorner(channels_, order) * root.asDiagonal();
    std::vector<Pole> found;
    for (Index i = 0; i < order; ++i) {
      const Complex value = std::log(solver.eigenvalues()[i]) / step_;
      if (!(value.imag() > 0 && value.real() < 0)) continue;
      found.push_back({value, C * solver.eigenvectors().col(i)});
    }
    return found;
  }

 private:
  double step_;
  Index channels_;
  MatrixXd U_, shifted_;
  Eigen::VectorXd S_;
};

/// Continues chains with the poles of the next order, or begins new ones.
void extend(std::vector<Chain>& chains, const std::vector<Pole>& poles) {
  std::vector<bool> used(poles.size());
  for (Chain& chain : chains) {
    if (chain.ended) continue;
    chain.ended = true;
    for (std::size_t i = 0; i < poles.size() && chain.ended; ++i) {
      if (used[i] || !same(chain.poles.back(), poles[i])) continue;
      chain.poles.push_back(poles[i]);
      used[i] = true;
      chain.ended = false;
    }
  }
  for (std::size_t i = 0; i < poles.size(); ++i) {
    if (!used[i]) chains.push_back({{poles[i]}});
  }
}

}  // namespace

std::vector<Complex> era_poles(std::vector<MatrixXd> decays, double step) {
  Index samples = decays.front().cols();
  Eigen::VectorXd squares = Eigen::VectorXd::Zero(decays.front().rows());
  for (const MatrixXd& decay : decays) {
    samples = std::min(samples, decay.cols());
    squares += decay.rowwise().squaredNorm();
  }
  for (MatrixXd& decay : decays) {
    decay = squares.cwiseSqrt().cwiseInverse().asDiagonal() * decay.leftCols(samples);
  }
  const Models models(decays, step);
  std::vector<Chain> chains;
  std::size_t orders = 0;
  for (Index order = kOrderStep; order <= models.most(); order += kOrderStep, ++orders) {
    extend(chains, models.poles(order));
  }
  std::stable_sort(chains.begin(), chains.end(),
                   [](const Chain& a, const Chain& b) { return a.poles.size() > b.poles.size(); });
  std::vector<Pole> kept;
  for (const Chain& chain : chains) {
    const Pole& middle = chain.poles[chain.poles.size() / 2];
    const auto is_it = [&middle](const Pole& pole) { return same(pole, middle); };
    if (3 * chain.poles.size() < orders) break;
    if (std::none_of(kept.begin(), kept.end(), is_it)) kept.push_back(middle);
  }
  std::vector<Complex> values;
  for (const Pole& pole : kept) values.push_back(pole.value);
  return values;
}

std::vector<MatrixXd> correlations(const MatrixXd& motion, Index lags) {
  const Index samples = motion.cols() - lags;
  std::vector<MatrixXd> decays(static_cast<std::size_t>(motion.rows()),
                               MatrixXd(motion.rows(), lags));
  for (Index lag = 1; lag <= lags; ++lag) {
    const MatrixXd R = motion.middleCols(lag, samples) * motion.leftCols(samples).transpose();
    for (Index c = 0; c < motion.rows(); ++c) {
      decays[static_cast<std::size_t>(c)].col(lag - 1) = R.col(c) / static_cast<double>(samples);
    }
  }
  return decays;
}

}  // namespace dashpot::stress
