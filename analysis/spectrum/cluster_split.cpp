#include <dashpot/analysis/spectrum/cluster_split.hpp>

#include <Eigen/SVD>
#include <algorithm>

namespace dashpot::analysis {
namespace {

/// A cluster is split into eigenvectors if their matrix has a condition number below this.
constexpr double kSeparable = 1e4;
/// Below this the planes of pairs are not looked for.
constexpr double kWellApart = 100;
/// Eigenvalues this close together (relative) coincide.
constexpr double kCoincidingValues = 1e-13;
/// Couplings between modes that coincide at critical damping, relative to those in each of them.
constexpr double kCriticalCoupling = 1e-6;

/// The columns in blocks of `step`.
template <int N>
SplitCluster<N> in_blocks(int step, const State<N>& small, const State<N>& columns) {
  SplitCluster<N> split{{small, columns}, {}};
  for (int k = 0; k < columns.cols(); k += step) split.blocks.push_back({k, step, false});
  return split;
}

/// Splits eigenvalues that coincide; false if they do not, or are defective.
template <int N>
bool split_coinciding(const State<N>& small, Complex mean, SplitCluster<N>& split) {
  const Eigen::Index size = small.rows();
  const double tolerance = kCoincidingValues * modulus(mean);
  State<N> J = shifted<N>(small, mean.real());
  if (mean.imag() == 0) {
    if (!(J.norm() <= tolerance)) return false;
    split = in_blocks<N>(1, small, State<N>::Identity(size, size));
    return true;
  }
  // J = (small - a) / b has J^2 = -1: the directions e and J e move together.
  J /= mean.imag();
  // A cluster that is wide holds a real eigenvalue too, perhaps, which has no direction to go with.
  if (size % 2 != 0 || !(shifted<N>(J * J, -1).norm() * mean.imag() <= tolerance)) return false;
  State<N> W(size, 0);
  for (Eigen::Index k = 0; k < size; k += 2) {
    const Eigen::Index farthest = farthest_axis(W);
    W.conservativeResize(size, k + 2);
    W.col(k) = StateVector<N>::Unit(size, farthest);
    W.col(k + 1) = J.col(farthest);
    orthonormalize(W);
  }
  split = in_blocks<N>(2, small, W);
  return true;
}

/// Splits modes that coincide at critical damping: with J = small - a, J^2 = 0 as far as rounding
/// errors tell, each of the size / 2 right singular vectors v of J spans a plane with J v, and
/// these planes are orthogonal. False if they do not take all of J.
template <int N>
bool split_critical(const State<N>& small, double a, SplitCluster<N>& split) {
  const Eigen::Index size = small.rows(), pairs = size / 2;
  const Eigen::JacobiSVD<State<N>> svd(shifted<N>(small, a),
                                       Eigen::ComputeFullU | Eigen::ComputeFullV);
  const auto& lengths = svd.singularValues();
  if (size % 2 != 0 || !(lengths[pairs] < kCriticalCoupling * lengths[pairs - 1])) return false;
  State<N> W(size, size);
  for (Eigen::Index k = 0; k < pairs; ++k) {
    W.col(2 * k) = svd.matrixV().col(k);
    W.col(2 * k + 1) = svd.matrixU().col(k);
  }
  orthonormalize(W);
  split = in_blocks<N>(2, small, W);
  double coupling2 = split.Lambda.squaredNorm();
  for (const Block& b : split.blocks) {
    coupling2 -= split.Lambda.block(b.first, b.first, 2, 2).squaredNorm();
  }
  return coupling2 < kCriticalCoupling * kCriticalCoupling * lengths[0] * lengths[0];
}

/// Splits off a plane for each two conjugate eigenvalues, and a vector for each real one. With
/// `paired` real ones are in planes as well: the outermost, the next within, and so on. Around a
/// critically damped frequency these are the modes, whose planes are well apart even where the two
/// vectors in each are not. The condition is infinite if a value is left over.
template <int N>
SplitCluster<N> split_apart(const State<N>& small, const ComplexStateVector<N>& values,
                            bool paired) {
  constexpr int kSteps = 3;
  Work work;  // its caller has counted it
  StateVector<N> real(small.rows());
  State<N> columns(small.rows(), small.cols());
  BlockList<N> blocks;
  int column = 0;
  const auto add = [&](const Complex& x, const Complex& y, int size) {
    columns.middleCols(column, size) =
        invariant_subspace<N>(small, x, y, size, kSteps, work, column);
    blocks.push_back({column, size, false});
    column += size;
  };
  Eigen::Index reals = 0;
  for (const Complex& value : values) {
    if (value.imag() == 0) {
      real[reals++] = value.real();
    } else {
      add(value, value, 2);
    }
  }
  if (paired && reals % 2 != 0) return {};
  std::sort(real.data(), real.data() + reals);
  for (Eigen::Index i = 0; i < (paired ? reals / 2 : reals); ++i) {
    if (paired) {
      add(real[i], real[reals - 1 - i], 2);
    } else {
      add(real[i], real[i], 1);
    }
  }
  return {{small, columns}, blocks};
}

}  // namespace

template <int N>
SplitCluster<N> split_cluster(const State<N>& small, const ComplexStateVector<N>& values,
                              Complex mean, bool coinciding) noexcept {
  SplitCluster<N> split;
  if (split_coinciding<N>(small, mean, split)) return split;
  if (coinciding && split_critical<N>(small, mean.real(), split)) return split;
  split = split_apart<N>(small, values, false);
  if (split.condition < kWellApart) return split;
  SplitCluster<N> planes = split_apart<N>(small, values, true);
  if (planes.condition < split.condition && planes.condition < kSeparable) return planes;
  if (split.condition < kSeparable) return split;
  if (split_critical<N>(small, mean.real(), planes)) return planes;
  return in_blocks<N>(static_cast<int>(small.cols()), small,
                      State<N>::Identity(small.rows(), small.cols()));
}

template SplitCluster<kDynamic> split_cluster<kDynamic>(const State<kDynamic>&,
                                                        const ComplexStateVector<kDynamic>&,
                                                        Complex, bool) noexcept;
template SplitCluster<kMaxDof> split_cluster<kMaxDof>(const State<kMaxDof>&,
                                                      const ComplexStateVector<kMaxDof>&, Complex,
                                                      bool) noexcept;

}  // namespace dashpot::analysis
