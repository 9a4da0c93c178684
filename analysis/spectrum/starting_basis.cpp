#include <dashpot/analysis/base/arithmetic.hpp>
#include <dashpot/analysis/linalg/small_dense.hpp>
#include <dashpot/analysis/spectrum/core_eigenvalues.hpp>
#include <dashpot/analysis/spectrum/starting_basis.hpp>

#include <cmath>

namespace dashpot::analysis {
namespace {

/// Two eigenvalues of one mode this close together (relative) count as nearly critical.
constexpr double kCluster = 0.02;
/// Steps of a subspace iteration.
constexpr int kSteps = 8;

template <int N>
class BasisFromEigenvectors {
 public:
  BasisFromEigenvectors(const EnergyForm<N>& form, const ZeroModes<N>& zero_modes, double cluster,
                        bool coinciding, ModalBasis<N>& basis, Work& work)
      : form_(form),
        work_(work),
        cluster_(cluster),
        coinciding_(coinciding),
        zero_modes_(zero_modes),
        basis_(basis),
        n_(form.damping.rows()),
        m_(form.modes),
        c_(form.core()),
        core_(form, zero_modes),
        D_norm_(form.damping.topLeftCorner(c_, c_).norm()),
        K_norm_(form.stiffness.topLeftCorner(c_, c_).norm()),
        zero_span_(form.coupled_zeros, 0) {}

  Status build() {
    basis_.U.setZero(n_, 2 * n_);
    basis_.Lambda.setZero(2 * n_, 2 * n_);
    basis_.blocks.clear();
    if (form_.proportional) {
      write_proportional();
    } else if (c_ > 0) {
      const bool found = core_.find(cluster_, cluster_ <= kCluster, work_);
      if (work_.over()) return Status::kUnfinished;
      if (!found) return Status::kNotConverged;
      for (int i = 0; i < core_.items().size() && !work_.over(); ++i) write_cluster_of(i);
      if (work_.over()) return Status::kUnfinished;
    }
    write_free_zeros();
    write_leftover_zeros();
    return Status::kOk;
  }

 private:
  double frequency(Eigen::Index i) const {
    return std::sqrt(std::abs(zero_modes_.stiffness_values[i]));
  }

  void append(const State<N>& p, const State<N>& Lambda, bool zero_mode = false);
  void append_real(const State<N>& p, double value);
  void append_pair(const State<N>& re_im, Complex value);

  void write_proportional();
  void write_free_zeros();
  void write_leftover_zeros();

  void write_cluster_of(int first);
  void write_cluster(int cluster, int members, Eigen::Index size, Complex mean, bool near_axis);
  void write_single(Complex value);
  void write_zero_rates(double rate, Eigen::Index count);
  State<N> positions(const State<N>& S, const State<N>& Lambda) const;

  const EnergyForm<N>& form_;
  Work& work_;
  double cluster_;
  bool coinciding_;
  const ZeroModes<N>& zero_modes_;
  ModalBasis<N>& basis_;
  Eigen::Index n_, m_, c_;
  CoreEigenvalues<N> core_;
  double D_norm_, K_norm_;
  /// Workspace of write_single; here, because it is filled with zeros first.
  Eigen::Matrix<Complex, Eigen::Dynamic, Eigen::Dynamic, 0, N, N> shifted_;
  Eigen::Index next_column_ = 0;
  State<N> zero_span_;  ///< directions of the coupled zero modes that have two-column blocks
};

/// Appends a block; p holds its position columns in the leading coordinates of the form.
template <int N>
void BasisFromEigenvectors<N>::append(const State<N>& p, const State<N>& Lambda, bool zero_mode) {
  const Eigen::Index size = p.cols();
  basis_.U.middleCols(next_column_, size).noalias() =
      zero_modes_.coordinates.leftCols(p.rows()).lazyProduct(p);
  basis_.Lambda.block(next_column_, next_column_, size, size) = Lambda;
  basis_.blocks.push_back({static_cast<int>(next_column_), static_cast<int>(size), zero_mode});
  next_column_ += size;
}

template <int N>
void BasisFromEigenvectors<N>::append_real(const State<N>& p, double value) {
  append(p, State<N>::Constant(1, 1, value));
}

/// (re + i im) exp((a + i b) t): columns re, im move with [a b; -b a].
template <int N>
void BasisFromEigenvectors<N>::append_pair(const State<N>& re_im, Complex value) {
  State<N> Lambda(2, 2);
  Lambda << value.real(), value.imag(), -value.imag(), value.real();
  append(re_im, Lambda);
}

template <int N>
void BasisFromEigenvectors<N>::write_proportional() {
  for (Eigen::Index i = 0; i < m_; ++i) {
    const double d = form_.damping(i, i), kappa = zero_modes_.stiffness_values[i];
    const double discriminant = 0.25 * d * d - kappa;
    const double root = std::sqrt(std::abs(discriminant));
    State<N> p = State<N>::Zero(m_, 2);
    if (2 * root <= kCluster * std::max(std::abs(d), std::sqrt(std::abs(kappa)))) {
      // Critical, nearly: coordinates of elastic and kinetic energy, [0 w; -w -d].
      const double omega = frequency(i);
      State<N> Lambda(2, 2);
      Lambda << 0, omega, -omega, -d;
      p(i, 0) = 1 / omega;
      append(p, Lambda);
    } else if (discriminant < 0) {
      p(i, 0) = 1;
      append_pair(p, Complex(-0.5 * d, root));
    } else {
      const double fast = d > 0 ? -0.5 * d - root : -0.5 * d + root;
      p.resize(m_, 1);
      p.setZero();
      p(i, 0) = 1;
      append_real(p, kappa / fast);
      append_real(p, fast);
    }
  }
}

template <int N>
void BasisFromEigenvectors<N>::write_free_zeros() {
  for (int i = 0; i < form_.free_zeros; ++i) {
    State<N> p = State<N>::Zero(n_, 2), Lambda(2, 2);
    p(c_ + i, 0) = 1;
    Lambda << 0, 1, 0, -form_.free_rates[i];
    append(p, Lambda, true);
  }
}

/// Positions of coupled zero modes whose velocities went into other blocks: constant motions that
/// complete what the two-column blocks span.
template <int N>
void BasisFromEigenvectors<N>::write_leftover_zeros() {
  const Eigen::Index missing = 2 * n_ - next_column_;
  if (missing <= 0) return;
  const Eigen::Index z = c_ - m_;
  State<N> span = zero_span_;
  orthonormalize(span);
  for (Eigen::Index k = 0; k < missing; ++k) {
    const Eigen::Index farthest = farthest_axis(span);
    span.conservativeResize(z, span.cols() + 1);
    span.col(span.cols() - 1) = Vector<N>::Unit(z, farthest);
    orthonormalize(span);
    State<N> p = State<N>::Zero(n_, 1);
    p.col(0).segment(m_, z) = span.col(span.cols() - 1);
    append(p, State<N>::Zero(1, 1), true);
  }
}

/// Writes the cluster whose first item this is.
template <int N>
void BasisFromEigenvectors<N>::write_cluster_of(int first) {
  const int cluster = core_.items()[first].cluster;
  int members = 0;
  Eigen::Index size = 0;
  Complex mean = 0;
  bool near_axis = false;
  for (int i = 0; i < core_.items().size(); ++i) {
    if (core_.items()[i].cluster != cluster) continue;
    if (i < first) return;  // written already
    const Complex value = core_.items()[i].value;
    ++members;
    size += value.imag() == 0 ? 1 : 2;
    mean += value;
    near_axis = near_axis || 2 * value.imag() <= kCluster * modulus(value);
  }
  mean /= static_cast<double>(members);
  bool equal_rates = true;
  for (int i = 0; i < core_.items().size(); ++i) {
    if (core_.items()[i].cluster != cluster) continue;
    equal_rates &=
        core_.items()[i].zero_rate && modulus(core_.items()[i].value - mean) <= core_.rounding();
  }
  if (equal_rates) {
    write_zero_rates(mean.real(), size);
  } else if (members == 1 && !(near_axis && size == 2)) {
    write_single(mean);
  } else {
    write_cluster(cluster, members, size, mean, near_axis);
  }
}

/// Writes a cluster of `members` items and `size` columns, split as far as that is possible.
template <int N>
void BasisFromEigenvectors<N>::write_cluster(int cluster, int members, Eigen::Index size,
                                             Complex mean, bool near_axis) {
  const int steps = cluster_ > kCluster ? 40 : kSteps;  // wide clusters part slowly from the rest
  const State<N>& A = core_.matrix();
  const Complex shift = near_axis ? mean.real() : mean;
  const State<N> S = invariant_subspace<N>(A, shift, shift, size, steps, work_);
  // To split the cluster: inverse iterations for each member, and products.
  const std::int64_t splitting_work = members * (cubed(size, 24) + squared(size, 240) + 900) +
                                      cubed(size, 60) + cubed(A.rows(), 4) + 5000;
  if (!work_.take(splitting_work)) return;
  ComplexStateVector<N> values(members);
  for (int i = 0, next = 0; i < core_.items().size(); ++i) {
    if (core_.items()[i].cluster == cluster) values[next++] = core_.items()[i].value;
  }
  const State<N> AS = A * S;
  const SplitCluster<N> split = split_cluster<N>(S.transpose() * AS, values, mean, coinciding_);
  for (const Block& b : split.blocks) {
    const State<N> Lambda = split.Lambda.block(b.first, b.first, b.size, b.size);
    append(positions(S * split.columns.middleCols(b.first, b.size), Lambda), Lambda);
  }
}

/// The vector of the quadratic lambda^2 + lambda D + Kp, mostly in one step.
template <int N>
void BasisFromEigenvectors<N>::write_single(Complex value) {
  const auto D = form_.damping.topLeftCorner(c_, c_);
  const auto Kp = form_.stiffness.topLeftCorner(c_, c_);
  const double size = std::norm(value) + modulus(value) * D_norm_ + K_norm_;
  const double good = 1e-4 / (kEps * size * static_cast<double>(c_));
  const auto vector = [&](auto& Q, const auto& lambda) {
    Q.resize(c_, c_);
    return inverse_iteration(Q, c_, kEps * size, good, work_, [&] {
      for (Eigen::Index j = 0; j < c_; ++j) {
        for (Eigen::Index i = 0; i < c_; ++i) Q(i, j) = Kp(i, j) + lambda * D(i, j);
        Q(j, j) += lambda * lambda;
      }
    });
  };
  if (value.imag() == 0) {
    Square<N> Q;
    append_real(vector(Q, value.real()), value.real());
    return;
  }
  const ComplexVector<N> u = vector(shifted_, value);
  State<N> re_im(c_, 2);
  re_im.col(0) = u.real();
  re_im.col(1) = u.imag();
  append_pair(re_im, value);
}

/// Blocks of `count` coupled zero modes whose velocities change alike, as exp(rate t), with the
/// states (s, v): any basis of what changes so. The columns of each are p0, the zero modes' part of
/// v, and p1 = s / omega in the coordinates of the nonzero modes: Lambda = [0 1; 0 rate] gives the
/// second column the velocity p0 + rate p1 = v.
template <int N>
void BasisFromEigenvectors<N>::write_zero_rates(double rate, Eigen::Index count) {
  const State<N> states =
      count == 1 ? State<N>(core_.vector(rate, work_))
                 : invariant_subspace<N>(core_.matrix(), rate, rate, count, kSteps, work_);
  for (Eigen::Index k = 0; k < count; ++k) {
    const auto z = states.col(k);
    const double size = z.tail(c_ - m_).norm();
    State<N> p = State<N>::Zero(c_, 2), Lambda(2, 2);
    p.col(0).tail(c_ - m_) = z.tail(c_ - m_) / size;
    zero_span_.conservativeResize(c_ - m_, zero_span_.cols() + 1);
    zero_span_.col(zero_span_.cols() - 1) = p.col(0).tail(c_ - m_);
    for (Eigen::Index i = 0; i < m_; ++i) p(i, 1) = z[i] / (frequency(i) * size);
    Lambda << 0, 1, 0, rate;
    append(p, Lambda, true);
  }
}

/// Position columns of the invariant columns S = (elastic coordinate, velocity) with A S = S
/// Lambda.
template <int N>
State<N> BasisFromEigenvectors<N>::positions(const State<N>& S, const State<N>& Lambda) const {
  State<N> p(c_, S.cols());
  for (Eigen::Index i = 0; i < m_; ++i) p.row(i) = S.row(i) / frequency(i);
  if (c_ > m_) {
    // Zero modes have no elastic coordinate: their position is the velocity times Lambda^-1.
    State<N> transposed = Lambda.transpose();
    State<N> rows = S.bottomRows(c_ - m_).transpose();
    solve_in_place(transposed, rows, kEps * Lambda.norm());
    p.bottomRows(c_ - m_) = rows.transpose();
  }
  return p;
}

}  // namespace

template <int N>
Status build_starting_basis(const EnergyForm<N>& form, const ZeroModes<N>& zero_modes,
                            double cluster, bool coinciding, ModalBasis<N>& basis,
                            Work& work) noexcept {
  return BasisFromEigenvectors<N>(form, zero_modes, cluster, coinciding, basis, work).build();
}

template Status build_starting_basis(const EnergyForm<kDynamic>&, const ZeroModes<kDynamic>&,
                                     double, bool, ModalBasis<kDynamic>&, Work&) noexcept;
template Status build_starting_basis(const EnergyForm<kMaxDof>&, const ZeroModes<kMaxDof>&, double,
                                     bool, ModalBasis<kMaxDof>&, Work&) noexcept;

}  // namespace dashpot::analysis
