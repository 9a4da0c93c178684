#include <dashpot/analysis/linalg/hessenberg_qr.hpp>
#include <dashpot/analysis/linalg/small_dense.hpp>
#include <dashpot/analysis/spectrum/starting_basis.hpp>

#include <cmath>
#include <limits>

namespace dashpot::analysis {
namespace {

constexpr double kEps = std::numeric_limits<double>::epsilon();
/// Two eigenvalues of one mode this close together (relative) count as nearly critical.
constexpr double kCluster = 0.02;
/// A cluster is parted into eigenvectors if their matrix has a condition number below this.
constexpr double kSeparable = 1e4;

template <int N>
using ComplexState =
    Eigen::Matrix<Complex, Eigen::Dynamic, Eigen::Dynamic, Eigen::ColMajor, kTwice<N>, kTwice<N>>;
template <int N>
using ComplexStateVector = Eigen::Matrix<Complex, Eigen::Dynamic, 1, Eigen::ColMajor, kTwice<N>, 1>;

/// An eigenvalue of the core; a complex pair is represented by its upper half.
struct Item {
  Complex value;
  int cluster = 0;
  bool zero_rate = false;  ///< the velocity of a coupled zero mode
};

template <int N>
class BasisFromEigenvectors {
 public:
  BasisFromEigenvectors(const EnergyForm<N>& form, const ZeroModes<N>& zero_modes, double cluster,
                        ModalBasis<N>& basis, Work& work)
      : form_(form),
        work_(work),
        cluster_(cluster),
        zero_modes_(zero_modes),
        basis_(basis),
        n_(form.damping.rows()),
        m_(form.modes),
        c_(form.core()),
        zero_span_(form.coupled_zeros, 0) {}

  Status build() {
    basis_.U.setZero(n_, 2 * n_);
    basis_.Lambda.setZero(2 * n_, 2 * n_);
    basis_.blocks.clear();
    if (form_.proportional) {
      write_proportional();
    } else if (c_ > 0) {
      form_state_matrix();
      if (!find_items()) return work_.over() ? Status::kUnfinished : Status::kNotConverged;
      mark_zero_rates();
      for (int i = 0; i < item_count_ && !work_.over(); ++i) write_cluster_of(i);
      if (work_.over()) return Status::kUnfinished;
    }
    write_free_zeros();
    write_leftover_zeros();
    return Status::kOk;
  }

 private:
  Item& item(int i) { return items_[static_cast<std::size_t>(i)]; }
  const Item& item(int i) const { return items_[static_cast<std::size_t>(i)]; }
  double frequency(Eigen::Index i) const {
    return std::sqrt(std::abs(zero_modes_.stiffness_values[i]));
  }

  void append(const State<N>& p, const State<N>& Lambda, bool zero_mode = false);
  void append_real(const State<N>& p, double value);
  void append_pair(const State<N>& re_im, Complex value);

  void write_proportional();
  void write_free_zeros();
  void write_leftover_zeros();

  void form_state_matrix();
  bool find_items();
  void mark_zero_rates();
  StateVector<N> state_vector(double value) const;

  void write_cluster_of(int first);
  void write_single(Complex value);
  bool grants_inverse_iteration(Eigen::Index size, std::int64_t factor) const;
  void write_zero_rate(double rate);
  bool write_coinciding(const State<N>& S, const State<N>& small, Complex mean);
  bool write_parted(const State<N>& S, const State<N>& small, int cluster);
  State<N> invariant_subspace(Complex mean, bool near_axis, Eigen::Index size) const;
  State<N> positions(const State<N>& S, const State<N>& Lambda) const;

  const EnergyForm<N>& form_;
  Work& work_;
  double cluster_;
  const ZeroModes<N>& zero_modes_;
  ModalBasis<N>& basis_;
  Eigen::Index n_, m_, c_;
  State<N> A_;
  double A_norm_ = 0, D_norm_ = 0, K_norm_ = 0;
  /// Workspace of write_single; here, because it is filled with zeros first.
  Eigen::Matrix<Complex, Eigen::Dynamic, Eigen::Dynamic, 0, N, N> shifted_;
  std::conditional_t<N == kDynamic, std::vector<Item>,
                     std::array<Item, static_cast<std::size_t>(N == kDynamic ? 1 : 2 * N)>>
      items_;
  int item_count_ = 0;
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

template <int N>
void BasisFromEigenvectors<N>::form_state_matrix() {
  A_.setZero(m_ + c_, m_ + c_);
  for (Eigen::Index i = 0; i < m_; ++i) {
    const double omega = frequency(i);
    A_(i, m_ + i) = omega;
    if (form_.symmetric) {
      A_(m_ + i, i) = -std::copysign(omega, zero_modes_.stiffness_values[i]);
    } else {
      A_.col(i).tail(c_) = -form_.stiffness.col(i).head(c_) / omega;
    }
  }
  A_.bottomRightCorner(c_, c_) = -form_.damping.topLeftCorner(c_, c_);
  A_norm_ = A_.norm();
  D_norm_ = form_.damping.topLeftCorner(c_, c_).norm();
  K_norm_ = form_.stiffness.topLeftCorner(c_, c_).norm();
}

/// Eigenvalues, and their clusters: connected components of "near each other".
template <int N>
bool BasisFromEigenvectors<N>::find_items() {
  const Eigen::Index size = A_.rows();
  ComplexStateVector<N> values(size);
  if constexpr (N == kDynamic) items_.resize(static_cast<std::size_t>(size));
  if (!work_.take(cubed(size, 9) + squared(size, 20))) return false;
  State<N> H = A_;
  reduce_to_hessenberg(H);
  if (!hessenberg_eigenvalues(H, values.data(), work_)) return false;
  item_count_ = 0;
  for (const Complex& value : values) {
    if (value.imag() < 0) continue;
    const int i = item_count_++;
    item(i) = {value, i, false};
    for (int j = 0; j < i; ++j) {
      const double larger = std::max(modulus(value), modulus(item(j).value));
      if (modulus(value - item(j).value) > cluster_ * larger) continue;
      const int from = item(i).cluster, to = item(j).cluster;
      for (int k = 0; k <= i; ++k) {
        if (item(k).cluster == from) item(k).cluster = to;
      }
    }
  }
  return true;
}

/// True if a system of this size may be solved for one vector; `factor` is 1, or 2 for complex
/// numbers.
template <int N>
bool BasisFromEigenvectors<N>::grants_inverse_iteration(Eigen::Index size,
                                                        std::int64_t factor) const {
  return work_.take(factor * (cubed(size, 2) + squared(size, 24) + 60 * size) + 2500);
}

/// Eigenvector of A to a real eigenvalue.
template <int N>
StateVector<N> BasisFromEigenvectors<N>::state_vector(double value) const {
  StateVector<N> z = StateVector<N>::Ones(A_.rows());
  for (int k = 0; k < 3 && grants_inverse_iteration(A_.rows(), 1); ++k) {
    State<N> shifted = A_;
    shifted.diagonal().array() -= value;
    solve_in_place(shifted, z, kEps * A_norm_);
    z /= z.stableNorm();
  }
  return z;
}

/// Of the real eigenvalues, marks those whose motion is mostly that of a coupled zero mode.
template <int N>
void BasisFromEigenvectors<N>::mark_zero_rates() {
  if (form_.coupled_zeros == 0) return;
  StateVector<N> score = StateVector<N>::Constant(item_count_, -1);  // -1: not eligible
  for (int i = 0; i < item_count_; ++i) {
    if (item(i).value.imag() != 0) continue;
    const StateVector<N> z = state_vector(item(i).value.real());
    const double kinetic = z.tail(c_).squaredNorm();  // of a total energy of 1
    // Velocities of zero modes have more kinetic than elastic energy.
    score[i] = z.tail(c_ - m_).squaredNorm() / kinetic + (kinetic > 0.5 ? 1 : 0);
  }
  for (int wanted = form_.coupled_zeros; wanted > 0; --wanted) {
    Eigen::Index best = 0;
    if (score.maxCoeff(&best) < 0) return;
    item(static_cast<int>(best)).zero_rate = true;
    score[best] = -1;
  }
}

/// Writes the cluster whose first item this is.
template <int N>
void BasisFromEigenvectors<N>::write_cluster_of(int first) {
  const int cluster = item(first).cluster;
  int members = 0;
  Eigen::Index size = 0;
  Complex mean = 0;
  bool near_axis = false;
  for (int i = 0; i < item_count_; ++i) {
    if (item(i).cluster != cluster) continue;
    if (i < first) return;  // written already
    const Complex value = item(i).value;
    ++members;
    size += value.imag() == 0 ? 1 : 2;
    mean += value;
    near_axis = near_axis || 2 * value.imag() <= kCluster * modulus(value);
  }
  mean /= static_cast<double>(members);
  if (members == 1 && item(first).zero_rate) {
    write_zero_rate(mean.real());
  } else if (members == 1 && !(near_axis && size == 2)) {
    write_single(mean);
  } else {
    const State<N> S = invariant_subspace(mean, near_axis, size);
    // To part the cluster: inverse iterations for each member, and products.
    const std::int64_t parting_work = members * (cubed(size, 24) + squared(size, 240) + 900) +
                                      cubed(size, 60) + cubed(A_.rows(), 4) + 5000;
    if (!work_.take(parting_work)) return;
    const State<N> AS = A_ * S;
    const State<N> small = S.transpose() * AS;
    if (write_coinciding(S, small, mean) || write_parted(S, small, cluster)) return;
    append(positions(S, small), small);
  }
}

/// One step of inverse iteration, u <- Q(value)^-1 u normalised, and a second if the first met an
/// unlucky start: Q is singular to rounding, so that a good step grows u by about 1 / (eps |Q|).
template <int N>
void BasisFromEigenvectors<N>::write_single(Complex value) {
  const auto D = form_.damping.topLeftCorner(c_, c_);
  const auto Kp = form_.stiffness.topLeftCorner(c_, c_);
  const double size = std::norm(value) + modulus(value) * D_norm_ + K_norm_;
  const double good = 1e-4 / (kEps * size * static_cast<double>(c_));
  if (value.imag() == 0) {
    State<N> u = State<N>::Ones(c_, 1);
    for (int k = 0; k < 3 && grants_inverse_iteration(c_, 1); ++k) {
      Square<N> Q = Kp + value.real() * D;
      Q.diagonal().array() += value.real() * value.real();
      solve_in_place(Q, u, kEps * size);
      const double growth = u.norm();
      u /= growth;
      if (growth > good) break;
    }
    append_real(u, value.real());
    return;
  }
  ComplexVector<N> u = ComplexVector<N>::Ones(c_);
  auto& Q = shifted_;
  Q.resize(c_, c_);
  for (int k = 0; k < 3 && grants_inverse_iteration(c_, 2); ++k) {
    for (Eigen::Index j = 0; j < c_; ++j) {
      for (Eigen::Index i = 0; i < c_; ++i) {
        Q(i, j) = Complex(Kp(i, j) + value.real() * D(i, j), value.imag() * D(i, j));
      }
    }
    Q.diagonal().array() += value * value;
    solve_in_place(Q, u, kEps * size);
    const double growth = u.norm();
    u /= growth;
    if (growth > good) break;
  }
  State<N> re_im(c_, 2);
  re_im.col(0) = u.real();
  re_im.col(1) = u.imag();
  append_pair(re_im, value);
}

/// Block of a coupled zero mode whose velocity changes as exp(rate t), with the state (s, v). Its
/// columns are p0, the zero modes' part of v, and p1 = s / omega in the coordinates of the nonzero
/// modes: Lambda = [0 1; 0 rate] gives the second column the velocity p0 + rate p1 = v.
template <int N>
void BasisFromEigenvectors<N>::write_zero_rate(double rate) {
  const StateVector<N> z = state_vector(rate);
  if (std::abs(rate) <= 8 * kEps * A_norm_) rate = 0;
  const double size = z.tail(c_ - m_).norm();
  State<N> p = State<N>::Zero(c_, 2), Lambda(2, 2);
  p.col(0).tail(c_ - m_) = z.tail(c_ - m_) / size;
  zero_span_.conservativeResize(c_ - m_, zero_span_.cols() + 1);
  zero_span_.col(zero_span_.cols() - 1) = p.col(0).tail(c_ - m_);
  for (Eigen::Index i = 0; i < m_; ++i) p(i, 1) = z[i] / (frequency(i) * size);
  Lambda << 0, 1, 0, rate;
  append(p, Lambda, true);
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

/// Orthonormal basis of the invariant subspace of A to the eigenvalues near `mean` (and its
/// conjugate), by subspace iteration with a real shift near the real axis and a conjugate pair of
/// shifts elsewhere.
template <int N>
State<N> BasisFromEigenvectors<N>::invariant_subspace(Complex mean, bool near_axis,
                                                      Eigen::Index size) const {
  const Eigen::Index states = A_.rows();
  State<N> shift;
  if (near_axis) {
    shift = A_;
    shift.diagonal().array() -= mean.real();
  } else {
    shift.noalias() = A_ * A_;
    shift -= 2 * mean.real() * A_;
    shift.diagonal().array() += std::norm(mean);
  }
  State<N> S(states, size);
  for (Eigen::Index j = 0; j < size; ++j) {
    for (Eigen::Index i = 0; i < states; ++i) {
      S(i, j) = std::cos(static_cast<double>((i + 1) * (2 * j + 3)));  // any full-rank start
    }
  }
  const int steps = cluster_ > kCluster ? 40 : 8;  // wide clusters part slowly from the rest
  const std::int64_t step_work = cubed(states, 2) + squared(states, 20) +
                                 size * (squared(states, 5) + 18 * size * states + 200);
  for (int k = 0; k < steps && work_.take(step_work); ++k) {
    State<N> factor = shift;
    solve_in_place(factor, S, kEps * shift.norm());
    orthonormalize(S);
  }
  return S;
}

/// Writes a cluster whose eigenvalues coincide to rounding without being defective: any orthonormal
/// directions serve as its vectors.
template <int N>
bool BasisFromEigenvectors<N>::write_coinciding(const State<N>& S, const State<N>& small,
                                                Complex mean) {
  const Eigen::Index size = small.rows();
  const double a = mean.real(), b = mean.imag();
  State<N> J = small;
  J.diagonal().array() -= a;
  const double tolerance = 1e-13 * modulus(mean);
  if (b == 0) {
    if (J.norm() > tolerance) return false;
    for (Eigen::Index k = 0; k < size; ++k) {
      append_real(positions(S.col(k), State<N>::Constant(1, 1, a)), a);
    }
    return true;
  }
  // J = (small - a) / b has J^2 = -1: directions (e, -J e) move with [a b; -b a].
  J /= b;
  State<N> J2 = J * J;
  J2.diagonal().array() += 1;
  if (J2.norm() * b > tolerance) return false;
  State<N> done(size, 0);
  for (Eigen::Index k = 0; k < size; k += 2) {
    const Eigen::Index farthest = farthest_axis(done);
    done.conservativeResize(size, k + 2);
    done.col(k) = StateVector<N>::Unit(size, farthest);
    done.col(k + 1) = J * done.col(k);
    orthonormalize(done);
    State<N> pair(size, 2), Lambda(2, 2);
    pair.col(0) = done.col(k);
    pair.col(1) = -(J * done.col(k));
    Lambda << a, b, -b, a;
    append(positions(S * pair, Lambda), Lambda);
  }
  return true;
}

/// Writes a cluster as single eigenvalues if their vectors are well apart.
template <int N>
bool BasisFromEigenvectors<N>::write_parted(const State<N>& S, const State<N>& small, int cluster) {
  const Eigen::Index size = small.rows();
  State<N> W(size, size);
  ComplexState<N> shifted;  // once: it is filled with zeros first
  Eigen::Index column = 0;
  for (int i = 0; i < item_count_; ++i) {
    if (item(i).cluster != cluster) continue;
    ComplexStateVector<N> w = ComplexStateVector<N>::Ones(size);
    for (Eigen::Index k = 0; k < size; ++k) w[k] += 0.1 * static_cast<double>(k * (i + 1));
    for (int k = 0; k < 3; ++k) {
      shifted = small.template cast<Complex>();
      shifted.diagonal().array() -= item(i).value;
      solve_in_place(shifted, w, kEps * small.norm());
      w /= w.stableNorm();
    }
    W.col(column++) = w.real();
    if (item(i).value.imag() > 0) W.col(column++) = w.imag();
  }
  State<N> factor = W, inverse = State<N>::Identity(size, size);
  solve_in_place(factor, inverse, std::numeric_limits<double>::min());
  if (!(W.norm() * inverse.norm() < kSeparable)) return false;
  const State<N> Lambda = inverse * small * W;
  column = 0;
  for (int i = 0; i < item_count_; ++i) {
    if (item(i).cluster != cluster) continue;
    const Eigen::Index step = item(i).value.imag() > 0 ? 2 : 1;
    const State<N> block = Lambda.block(column, column, step, step);
    append(positions(S * W.middleCols(column, step), block), block);
    column += step;
  }
  return true;
}

}  // namespace

template <int N>
Status build_starting_basis(const EnergyForm<N>& form, const ZeroModes<N>& zero_modes,
                            double cluster, ModalBasis<N>& basis, Work& work) noexcept {
  return BasisFromEigenvectors<N>(form, zero_modes, cluster, basis, work).build();
}

template Status build_starting_basis(const EnergyForm<kDynamic>&, const ZeroModes<kDynamic>&,
                                     double, ModalBasis<kDynamic>&, Work&) noexcept;
template Status build_starting_basis(const EnergyForm<kMaxDof>&, const ZeroModes<kMaxDof>&, double,
                                     ModalBasis<kMaxDof>&, Work&) noexcept;

}  // namespace dashpot::analysis
