#include <dashpot/analysis/base/arithmetic.hpp>
#include <dashpot/analysis/linalg/hessenberg_qr.hpp>
#include <dashpot/analysis/spectrum/core_eigenvalues.hpp>

#include <Eigen/SVD>
#include <algorithm>
#include <cmath>
#include <limits>

namespace dashpot::analysis {

template <int N>
CoreEigenvalues<N>::CoreEigenvalues(const EnergyForm<N>& form,
                                    const ZeroModes<N>& zero_modes) noexcept
    : form_(form), coupled_zeros_(form.coupled_zeros), m_(form.modes), c_(form.core()) {
  A_.setZero(m_ + c_, m_ + c_);
  for (Eigen::Index i = 0; i < m_; ++i) {
    const double omega = std::sqrt(std::abs(zero_modes.stiffness_values[i]));
    A_(i, m_ + i) = omega;
    if (form.symmetric) {
      A_(m_ + i, i) = -std::copysign(omega, zero_modes.stiffness_values[i]);
    } else {
      A_.col(i).tail(c_) = -form.stiffness.col(i).head(c_) / omega;
    }
  }
  A_.bottomRightCorner(c_, c_) = -form.damping.topLeftCorner(c_, c_);
  A_norm_ = A_.norm();
}

namespace {

template <int N>
bool find_eigenvalues(State<N> A, ComplexStateVector<N>& values, Work& work) {
  const Eigen::Index size = A.rows();
  values.resize(size);
  if (!work.take(cubed(size, 9) + squared(size, 20))) return false;
  reduce_to_hessenberg(A);
  return hessenberg_eigenvalues(A, values.data(), work);
}

/// By falling modulus.
template <int N>
void sort(ComplexStateVector<N>& values) {
  std::sort(values.data(), values.data() + values.size(),
            [](const Complex& a, const Complex& b) { return modulus(a) > modulus(b); });
}

}  // namespace

/// Replaces slow eigenvalues of A that drown in rounding errors of the fast ones. The inverse
/// [-w^-1 D w^-1  -w^-1; w^-1  0] gives them, if A is symmetric but for signs.
template <int N>
bool CoreEigenvalues<N>::replace_slow(ComplexStateVector<N>& values, Work& work) noexcept {
  constexpr double kWide =
      1e9;  // condition number of A that leaves slow eigenvalues too few digits
  constexpr double kApart = 1.01;  // no conjugates, and none of a cluster
  if (!form_.symmetric || m_ != c_ || m_ == 0) return true;
  const Vector<N> inverse = A_.topRightCorner(m_, m_).diagonal().cwiseInverse();
  const Vector<N> lower = A_.bottomLeftCorner(m_, m_).diagonal().cwiseInverse();
  double B_norm2 = lower.squaredNorm() + inverse.squaredNorm();
  for (Eigen::Index j = 0; j < m_; ++j) {
    for (Eigen::Index i = 0; i < m_; ++i) {
      const double entry = lower[i] * A_(m_ + i, m_ + j) * inverse[j];
      B_norm2 += entry * entry;
    }
  }
  const double B_norm = std::sqrt(B_norm2);
  if (!(A_norm_ * B_norm > kWide) || !std::isfinite(B_norm)) return true;
  State<N> B = State<N>::Zero(2 * m_, 2 * m_);
  B.topLeftCorner(m_, m_) =
      lower.asDiagonal() * (-A_.bottomRightCorner(m_, m_)) * inverse.asDiagonal();
  B.topRightCorner(m_, m_).diagonal() = lower;
  B.bottomLeftCorner(m_, m_).diagonal() = inverse;
  ComplexStateVector<N> slow;
  if (!find_eigenvalues<N>(B, slow, work)) return false;
  for (Complex& value : slow) {
    value = 1.0 / value;
    // The fast ones have drowned in B's rounding errors, and may come out as zero there.
    if (!std::isfinite(value.real()) || !std::isfinite(value.imag())) value = kInfinity;
  }
  sort<N>(slow);
  sort<N>(values);
  // They are divided where it is clear in both, at the place with the least relative errors.
  double least = std::numeric_limits<double>::infinity();
  Eigen::Index division = 2 * m_;
  for (Eigen::Index k = 0; k < 2 * m_; ++k) {
    const double last_fast = k == 0 ? kInfinity : modulus(values[k - 1]);
    if (k > 0 && !(last_fast > kApart * modulus(values[k]) &&
                   modulus(slow[k - 1]) > kApart * modulus(slow[k]))) {
      continue;
    }
    const double error = std::max(A_norm_ / last_fast, B_norm * modulus(slow[k]));
    if (error < least) least = error, division = k;
  }
  for (Eigen::Index k = division; k < 2 * m_; ++k) values[k] = slow[k];
  return true;
}

template <int N>
bool CoreEigenvalues<N>::find_items(Work& work) noexcept {
  const Eigen::Index size = A_.rows();
  ComplexStateVector<N> values(size);
  if (!find_eigenvalues<N>(A_, values, work) || !replace_slow(values, work)) return false;
  items_.clear();
  Eigen::Index columns = 0;
  for (Complex& value : values) {
    // Rounding may have made a pair of equal rates of several zero modes.
    if (coupled_zeros_ > 1 && std::abs(value.imag()) <= rounding()) value = value.real();
    if (value.imag() < 0) continue;
    items_.push_back({value});
    columns += value.imag() == 0 ? 1 : 2;
  }
  return columns == size;  // not so, if rounding has left one of a pair, or no number
}

/// Connected components of "near each other".
template <int N>
void CoreEigenvalues<N>::find_clusters(double cluster, bool rates_apart) noexcept {
  constexpr double kApart = 1e6;  // rounding errors, which leave the vectors enough digits
  for (int i = 0; i < items_.size(); ++i) {
    items_[i].cluster = i;
    for (int j = 0; j < i; ++j) {
      const double larger = std::max(modulus(items_[i].value), modulus(items_[j].value));
      double width = cluster * larger;
      if (rates_apart && (items_[i].zero_rate || items_[j].zero_rate)) {
        width = std::min(width, kApart * rounding());
      }
      if (modulus(items_[i].value - items_[j].value) > width) continue;
      const int from = items_[i].cluster, to = items_[j].cluster;
      for (int k = 0; k <= i; ++k) {
        if (items_[k].cluster == from) items_[k].cluster = to;
      }
    }
  }
}

/// Eigenvector of A to a real eigenvalue.
template <int N>
StateVector<N> CoreEigenvalues<N>::vector(double value, Work& work) const noexcept {
  State<N> shifted;
  return inverse_iteration(shifted, A_.rows(), kEps * A_norm_,
                           std::numeric_limits<double>::infinity(), work, [&] {
                             shifted = A_;
                             shifted.diagonal().array() -= value;
                           });
}

/// Velocities along which no spring acts, y' Kp = 0: c x coupled zeros, orthonormal.
template <int N>
Square<N> CoreEigenvalues<N>::unsprung() const noexcept {
  Square<N> directions = Square<N>::Identity(c_, c_).rightCols(coupled_zeros_);
  if (form_.symmetric) return directions;
  Square<N> K = form_.stiffness.topLeftCorner(m_, m_).transpose();
  Square<N> y = -form_.stiffness.block(m_, 0, coupled_zeros_, m_).transpose();
  solve_in_place(K, y, kEps * form_.stiffness.norm());
  directions.topRows(m_) = y;
  orthonormalize(directions);
  return directions;
}

/// Marks the real eigenvalues that move mostly a coupled zero mode. Rates that are zero to rounding
/// become zero, so that they share a cluster, whose width is relative.
///
/// A symmetric system's zero modes move with more kinetic than elastic energy. Without symmetry
/// strong damping can deform them, but only they have momentum along which no spring acts, if the
/// dampers slow all such momentum alike: returns whether that is so. Velocities that stay as they
/// are belong to zero modes, whatever the momentum.
template <int N>
bool CoreEigenvalues<N>::mark_zero_rates(Work& work) noexcept {
  constexpr double kAlone = 0.99;   // of the kinetic energy
  constexpr double kHardly = 1e-8;  // of the energy of a momentum
  if (coupled_zeros_ == 0) return false;
  if (!form_.symmetric && !work.take(cubed(c_, 8) + 2500)) return false;
  const Square<N> directions = unsprung();
  // Without symmetry rounding errors move an eigenvalue further.
  const double still = form_.symmetric ? rounding() : 100 * rounding();
  StateVector<N> score = StateVector<N>::Constant(items_.size(), -1);  // -1: not eligible
  for (int i = 0; i < items_.size(); ++i) {
    if (items_[i].value.imag() != 0) continue;
    const StateVector<N> z = vector(items_[i].value.real(), work);
    const double kinetic = z.tail(c_).squaredNorm();  // of a total energy of 1
    const double share = (directions.transpose() * z.tail(c_)).squaredNorm();
    score[i] = form_.symmetric ? share / kinetic + (kinetic > 0.5 ? 1 : 0) : share;
    const bool alone = z.tail(c_ - m_).squaredNorm() > kAlone * kinetic;
    if (alone && modulus(items_[i].value) <= still) score[i] += 2;
  }
  double least = 0;
  for (int wanted = coupled_zeros_; wanted > 0; --wanted) {
    Eigen::Index best = 0;
    least = score.maxCoeff(&best);
    if (least < 0) return false;
    CoreEigenvalue& found = items_[best];
    found.zero_rate = true;
    if (modulus(found.value) <= rounding()) found.value = 0;
    score[best] = -1;
  }
  return !form_.symmetric && score.maxCoeff() <= kHardly * least;
}

template <int N>
bool CoreEigenvalues<N>::find(double cluster, bool rates_apart, Work& work) noexcept {
  if (!find_items(work)) return false;
  const bool uncoupled = mark_zero_rates(work);
  find_clusters(cluster, rates_apart && uncoupled);
  return true;
}

template class CoreEigenvalues<kDynamic>;
template class CoreEigenvalues<kMaxDof>;

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
