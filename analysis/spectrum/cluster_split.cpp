#include <dashpot/analysis/base/arithmetic.hpp>
#include <dashpot/analysis/linalg/small_dense.hpp>
#include <dashpot/analysis/spectrum/cluster_split.hpp>

#include <Eigen/SVD>
#include <algorithm>
#include <cmath>
#include <limits>

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

/// Adds blocks of `step` columns for as many columns as `split` has.
template <int N>
void add_blocks(int step, SplitCluster<N>& split) {
  for (int k = 0; k < split.columns.cols(); k += step) split.blocks.push_back({k, step, false});
}

/// Eigenvalues that coincide; false if they do not, or are defective.
template <int N>
bool split_coinciding(const State<N>& small, Complex mean, SplitCluster<N>& split) {
  const Eigen::Index size = small.rows();
  const double a = mean.real(), b = mean.imag(), tolerance = kCoincidingValues * modulus(mean);
  State<N> J = small;
  J.diagonal().array() -= a;
  if (b == 0) {
    if (!(J.norm() <= tolerance)) return false;
    split.columns.setIdentity(size, size);
    split.Lambda = a * split.columns;
    add_blocks(1, split);
    return true;
  }
  // J = (small - a) / b has J^2 = -1: directions (e, -J e) move with [a b; -b a].
  J /= b;
  State<N> J2 = J * J;
  J2.diagonal().array() += 1;
  // A cluster that is wide holds a real eigenvalue too, perhaps, which has no direction to go with.
  if (size % 2 != 0 || !(J2.norm() * b <= tolerance)) return false;
  State<N> done(size, 0);
  split.columns.resize(size, size);
  split.Lambda = a * State<N>::Identity(size, size);
  for (Eigen::Index k = 0; k < size; k += 2) {
    const Eigen::Index farthest = farthest_axis(done);
    done.conservativeResize(size, k + 2);
    done.col(k) = StateVector<N>::Unit(size, farthest);
    done.col(k + 1) = J * done.col(k);
    orthonormalize(done);
    split.columns.col(k) = done.col(k);
    split.columns.col(k + 1) = -(J * done.col(k));
    split.Lambda(k, k + 1) = b;
    split.Lambda(k + 1, k) = -b;
  }
  add_blocks(2, split);
  return true;
}

/// Modes that coincide at critical damping: with J = small - a, J^2 = 0 as far as rounding errors
/// tell, each of the size / 2 right singular vectors v of J spans a plane with J v, and these
/// planes are orthogonal. False if they do not take all of J.
template <int N>
bool split_critical(const State<N>& small, double a, SplitCluster<N>& split) {
  const Eigen::Index size = small.rows(), pairs = size / 2;
  State<N> J = small;
  J.diagonal().array() -= a;
  const Eigen::JacobiSVD<State<N>> svd(J, Eigen::ComputeFullU | Eigen::ComputeFullV);
  const auto& lengths = svd.singularValues();
  if (size % 2 != 0 || !(lengths[pairs] < kCriticalCoupling * lengths[pairs - 1])) return false;
  State<N>& W = split.columns;
  W.resize(size, size);
  for (Eigen::Index k = 0; k < pairs; ++k) {
    W.col(2 * k) = svd.matrixV().col(k);
    W.col(2 * k + 1) = svd.matrixU().col(k);
  }
  orthonormalize(W);
  split.Lambda = W.transpose() * small * W;
  split.blocks.clear();
  add_blocks(2, split);
  double coupling2 = split.Lambda.squaredNorm();
  for (const Block& b : split.blocks) {
    coupling2 -= split.Lambda.block(b.first, b.first, 2, 2).squaredNorm();
  }
  return coupling2 < kCriticalCoupling * kCriticalCoupling * lengths[0] * lengths[0];
}

/// Sets Lambda from the columns, and returns their condition number.
template <int N>
double condition(const State<N>& small, SplitCluster<N>& split) {
  const State<N>& W = split.columns;
  State<N> factor = W, inverse = State<N>::Identity(W.rows(), W.rows());
  solve_in_place(factor, inverse, std::numeric_limits<double>::min());
  split.Lambda = inverse * small * W;
  return W.norm() * inverse.norm();
}

/// Single eigenvalues; returns the condition number of their vectors.
template <int N>
double split_apart(const State<N>& small, const ComplexStateVector<N>& values,
                   SplitCluster<N>& split) {
  const Eigen::Index size = small.rows();
  State<N>& W = split.columns;
  W.resize(size, size);
  Eigen::Matrix<Complex, Eigen::Dynamic, Eigen::Dynamic, Eigen::ColMajor, kTwice<N>, kTwice<N>>
      shifted;  // once: it is filled with zeros first
  int column = 0;
  for (Eigen::Index i = 0; i < values.size(); ++i) {
    ComplexStateVector<N> w = ComplexStateVector<N>::Ones(size);
    for (Eigen::Index k = 0; k < size; ++k) w[k] += 0.1 * static_cast<double>(k * (i + 1));
    for (int k = 0; k < 3; ++k) {
      shifted = small.template cast<Complex>();
      shifted.diagonal().array() -= values[i];
      solve_in_place(shifted, w, kEps * small.norm());
      w /= w.stableNorm();
    }
    const int step = values[i].imag() > 0 ? 2 : 1;
    split.blocks.push_back({column, step, false});
    W.col(column) = w.real();
    if (step == 2) W.col(column + 1) = w.imag();
    column += step;
  }
  return condition(small, split);
}

/// Planes of two eigenvalues: conjugate ones, and of the real ones the outermost, the next within,
/// and so on. Returns the condition number of the planes; infinite if a value is left over. Around
/// a critically damped frequency a, where (small - a)^2 is small, these are the modes: their planes
/// are well apart even where the two vectors in each are not.
template <int N>
double split_pairs(const State<N>& small, const ComplexStateVector<N>& values, double a,
                   SplitCluster<N>& split) {
  const Eigen::Index size = small.rows();
  StateVector<N> real(size), sum(size), product(size);  // of the values less a
  Eigen::Index reals = 0, pairs = 0;
  for (const Complex& value : values) {
    const double x = value.real() - a;
    if (value.imag() == 0) {
      real[reals++] = x;
    } else {
      sum[pairs] = 2 * x;
      product[pairs++] = x * x + value.imag() * value.imag();
    }
  }
  if (reals % 2 != 0) return std::numeric_limits<double>::infinity();
  std::sort(real.data(), real.data() + reals);
  for (Eigen::Index i = 0; 2 * i < reals; ++i) {
    sum[pairs] = real[i] + real[reals - 1 - i];
    product[pairs++] = real[i] * real[reals - 1 - i];
  }
  State<N> J = small;
  J.diagonal().array() -= a;
  const State<N> J2 = J * J;
  split.columns.resize(size, size);
  split.blocks.clear();
  for (Eigen::Index k = 0; k < pairs; ++k) {
    State<N> plane(size, 2);
    for (Eigen::Index i = 0; i < size; ++i) {
      const auto angle = static_cast<double>((i + 1) * (2 * k + 3));  // any start
      plane.row(i) << std::cos(angle), std::sin(angle);
    }
    for (int step = 0; step < 3; ++step) {
      State<N> shifted = J2 - sum[k] * J;
      shifted.diagonal().array() += product[k];
      const double least_pivot = kEps * shifted.norm();
      solve_in_place(shifted, plane, least_pivot);
      orthonormalize(plane);
    }
    split.columns.middleCols(2 * k, 2) = plane;
  }
  add_blocks(2, split);
  return condition(small, split);
}

}  // namespace

template <int N>
State<N> invariant_subspace(const State<N>& A, Complex mean, bool near_axis, Eigen::Index size,
                            int steps, Work& work) noexcept {
  const Eigen::Index states = A.rows();
  State<N> shift;
  if (near_axis) {
    shift = A;
    shift.diagonal().array() -= mean.real();
  } else {
    shift.noalias() = A * A;
    shift -= 2 * mean.real() * A;
    shift.diagonal().array() += std::norm(mean);
  }
  State<N> S(states, size);
  for (Eigen::Index j = 0; j < size; ++j) {
    for (Eigen::Index i = 0; i < states; ++i) {
      S(i, j) = std::cos(static_cast<double>((i + 1) * (2 * j + 3)));  // any full-rank start
    }
  }
  const std::int64_t step_work = cubed(states, 2) + squared(states, 20) +
                                 size * (squared(states, 5) + 18 * size * states + 200);
  for (int k = 0; k < steps && work.take(step_work); ++k) {
    State<N> factor = shift;
    solve_in_place(factor, S, kEps * shift.norm());
    orthonormalize(S);
  }
  return S;
}

template <int N>
SplitCluster<N> split_cluster(const State<N>& small, const ComplexStateVector<N>& values,
                              Complex mean, bool coinciding) noexcept {
  SplitCluster<N> split;
  if (split_coinciding<N>(small, mean, split)) return split;
  if (coinciding && split_critical<N>(small, mean.real(), split)) return split;
  split.blocks.clear();
  const double apart = split_apart<N>(small, values, split);
  if (apart < kWellApart) return split;
  SplitCluster<N> planes;
  const double paired = split_pairs<N>(small, values, mean.real(), planes);
  if (paired < apart && paired < kSeparable) return planes;
  if (apart < kSeparable) return split;
  if (split_critical<N>(small, mean.real(), planes)) return planes;
  split.columns.setIdentity(small.rows(), small.cols());
  split.Lambda = small;
  split.blocks.clear();
  add_blocks(static_cast<int>(small.cols()), split);
  return split;
}

template State<kDynamic> invariant_subspace<kDynamic>(const State<kDynamic>&, Complex, bool,
                                                      Eigen::Index, int, Work&) noexcept;
template State<kMaxDof> invariant_subspace<kMaxDof>(const State<kMaxDof>&, Complex, bool,
                                                    Eigen::Index, int, Work&) noexcept;
template SplitCluster<kDynamic> split_cluster<kDynamic>(const State<kDynamic>&,
                                                        const ComplexStateVector<kDynamic>&,
                                                        Complex, bool) noexcept;
template SplitCluster<kMaxDof> split_cluster<kMaxDof>(const State<kMaxDof>&,
                                                      const ComplexStateVector<kMaxDof>&, Complex,
                                                      bool) noexcept;

}  // namespace dashpot::analysis
