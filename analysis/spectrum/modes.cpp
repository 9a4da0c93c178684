#include <dashpot/analysis/base/arithmetic.hpp>
#include <dashpot/analysis/linalg/hessenberg_qr.hpp>
#include <dashpot/analysis/linalg/small_dense.hpp>
#include <dashpot/analysis/mode.hpp>
#include <dashpot/analysis/spectrum/mode_numbers.hpp>
#include <dashpot/analysis/spectrum/modes.hpp>

#include <algorithm>
#include <cmath>
#include <limits>

namespace dashpot::analysis {

const char* to_text(ModeKind kind) noexcept {
  switch (kind) {
    case ModeKind::kUnderdamped:
      return "underdamped";
    case ModeKind::kCritical:
      return "critical";
    case ModeKind::kOverdamped:
      return "overdamped";
    case ModeKind::kUndamped:
      return "undamped";
    case ModeKind::kUnstable:
      return "unstable";
    case ModeKind::kSoft:
      return "soft";
    case ModeKind::kAlternating:
      return "alternating";
  }
  return "unknown";
}

namespace {

constexpr double kNan = std::numeric_limits<double>::quiet_NaN();

/// A vector in the columns of a block.
template <int N>
class BlockVector {
 public:
  explicit BlockVector(const Block& block)
      : first_(block.first), re_(StateVector<N>::Zero(block.size)), im_(re_) {}
  void set(Eigen::Index i, const Complex& value) {
    re_[i] = value.real();
    im_[i] = value.imag();
  }
  /// Entry `row` of the combination of these columns of X.
  Complex combine(const Wide<N>& X, Eigen::Index row) const {
    double re = 0, im = 0;
    for (Eigen::Index i = 0; i < re_.size(); ++i) {
      re += X(row, first_ + i) * re_[i];
      im += X(row, first_ + i) * im_[i];
    }
    return {re, im};
  }

 private:
  Eigen::Index first_;
  StateVector<N> re_, im_;
};

/// Scales u, of this kinetic energy u^H M u, to 1, with its largest entry real and positive.
template <int N>
void normalize(double energy, ComplexVector<N>& u) {
  Complex largest = 0;
  for (const Complex& entry : u) largest = std::norm(entry) > std::norm(largest) ? entry : largest;
  const Complex factor = std::conj(largest) / (modulus(largest) * std::sqrt(energy));
  for (Complex& entry : u) entry = product(entry, factor);
}

/// Eigenvector of a block of `matrix` (Lambda or Gamma) to the eigenvalue mu.
template <int N>
BlockVector<N> eigenvector(const State<N>& matrix, const Block& b, const Complex& mu) {
  BlockVector<N> w(b);
  if (b.size == 1) {
    w.set(0, 1);
  } else if (b.size == 2) {
    const Eigen::Index k = b.first;
    const auto vector =
        eigenvector_2x2(matrix(k, k), matrix(k, k + 1), matrix(k + 1, k), matrix(k + 1, k + 1), mu);
    w.set(0, vector[0]);
    w.set(1, vector[1]);
  } else {
    // Inverse iteration, kept where it grows most: near a defective eigenvalue a further step may
    // well be worse (Wilkinson 1979).
    const State<N> L = matrix.block(b.first, b.first, b.size, b.size);
    ComplexVector<kTwice<N>> x = ComplexVector<kTwice<N>>::Ones(b.size);
    double best = 0;
    Eigen::Matrix<Complex, Eigen::Dynamic, Eigen::Dynamic, 0, kTwice<N>, kTwice<N>> shifted;
    for (int k = 0; k < 3; ++k) {
      shifted = L.template cast<Complex>();
      shifted.diagonal().array() -= mu;
      solve_in_place(shifted, x, kUnit * L.norm());
      const double growth = x.stableNorm();
      x /= growth;
      if (!(growth > best)) continue;
      best = growth;
      for (int j = 0; j < b.size; ++j) w.set(j, x[j]);
    }
  }
  return w;
}

struct PairedRoot : BlockRoot {
  int partner = -1;   ///< index of the other root of its mode
  bool used = false;  ///< of a zero mode
};

template <int N>
class ModeExtractor {
 public:
  ModeExtractor(const System<N>& system, const BasisResidual<N>& residual,
                const BlockEnclosure<N>& enclosure, double soft_frequency, Spectrum<N>& spectrum)
      : system_(system),
        residual_(residual),
        enclosure_(enclosure),
        basis_(spectrum.basis),
        spectrum_(spectrum),
        soft_frequency_(soft_frequency),
        M_norm_(system.mass.norm()),
        C_norm_(system.damping.norm()),
        K_norm_(system.stiffness.norm()) {}

  void read() {
    list_roots();
    bound_roots(roots_.begin(), roots_.size(), enclosure_.group);
    take_zero_rates();
    pair_roots();
    write_modes();
  }

 private:
  void list_roots();
  void take_zero_rates();
  void pair_roots();
  void write_modes();

  Invariants invariants(int i, int j) const;
  void write_shapes(int i, int j, Mode<N>& mode) const;
  void write_shape(const Block& block, const Complex& mu, std::size_t which, Mode<N>& mode) const;
  ComplexVector<N> left_shape(const Block& block, const Complex& mu) const;

  const System<N>& system_;
  const BasisResidual<N>& residual_;
  const BlockEnclosure<N>& enclosure_;
  const ModalBasis<N>& basis_;
  Spectrum<N>& spectrum_;
  double soft_frequency_;
  double M_norm_, C_norm_, K_norm_;  ///< Frobenius norms of the coefficients
  BoundedList<PairedRoot, kTwice<N>> roots_;
};

template <int N>
void ModeExtractor<N>::list_roots() {
  for (int k = 0; k < basis_.blocks.size(); ++k) {
    const Block& b = basis_.blocks[k];
    const State<N> Lambda = basis_.Lambda.block(b.first, b.first, b.size, b.size);
    Eigen::Matrix<Complex, Eigen::Dynamic, 1, Eigen::ColMajor, kTwice<N>, 1> values(b.size);
    if (b.size == 1) {
      values[0] = Lambda(0, 0);
    } else if (b.size == 2) {
      eigenvalues_2x2(Lambda(0, 0), Lambda(0, 1), Lambda(1, 0), Lambda(1, 1), values[0], values[1]);
    } else {
      State<N> H = Lambda;
      reduce_to_hessenberg(H);
      if (!hessenberg_eigenvalues(H, values.data())) values.setConstant(kNan);
    }
    // Backward error of the block's own QR iteration, generously. Blocks of zero modes are
    // triangular.
    const double factor = b.zero_mode ? 0 : b.size > 2 ? 64 * b.size : 8;
    const double radius = enclosure_.radius[k] + factor * b.size * kUnit * Lambda.norm();
    for (int e = 0; e < b.size; ++e) {
      PairedRoot r;
      r.value = values[e];
      r.block = k;
      r.used = b.zero_mode;  // of no mode, but its disc may hold the eigenvalue of another
      r.radius = disc_radius(values.data(), b.size, e, Lambda.norm(), radius);
      roots_.push_back(r);
    }
  }
}

template <int N>
void ModeExtractor<N>::take_zero_rates() {
  const int r = spectrum_.zero_modes.count;
  spectrum_.zero_mode_rates = Vector<N>::Zero(r);
  spectrum_.zero_mode_rates_bound = Vector<N>::Constant(r, kInfinity);
  int found = 0;
  for (int i = 0; i + 1 < roots_.size() && found < r; ++i) {
    const Block& b = basis_.blocks[roots_[i].block];
    if (!b.zero_mode || b.size != 2) continue;
    // eigenvalues_2x2 returns 0 and then the rate, as it stands in the block.
    spectrum_.zero_mode_rates[found] = roots_[i + 1].value.real();
    spectrum_.zero_mode_rates_bound[found++] = roots_[i + 1].bound;
    ++i;
  }
  // The rest are real eigenvalues whose motion is mostly along the zero modes.
  for (; found < r; ++found) {
    double best = -1;
    int chosen = -1;
    for (int i = 0; i < roots_.size(); ++i) {
      if (roots_[i].used || roots_[i].value.imag() != 0) continue;
      const Block& b = basis_.blocks[roots_[i].block];
      if (b.size != 1) continue;
      const auto momentum = residual_.MU.col(b.first);
      const double kinetic = basis_.U.col(b.first).dot(momentum);
      const bool negative = basis_.weight(b.first, b.first) < 0;
      const double share =
          (spectrum_.zero_modes.basis.transpose() * momentum).squaredNorm() / kinetic +
          (negative ? 1 : 0);
      if (share > best) best = share, chosen = i;
    }
    if (chosen < 0) {
      // Left are complex pairs (of coefficients that are not symmetric): they count as modes.
      spectrum_.zero_mode_rates.tail(r - found).setConstant(kNan);
      return;
    }
    roots_[chosen].used = true;
    spectrum_.zero_mode_rates[found] = roots_[chosen].value.real();
    spectrum_.zero_mode_rates_bound[found] = roots_[chosen].bound;
  }
}

/// Complex roots pair with their conjugates; real ones of one two-column block with each other;
/// other real ones by the likeness of their shapes, one of each sign type where the system is
/// symmetric.
template <int N>
void ModeExtractor<N>::pair_roots() {
  for (int i = 0; i < roots_.size(); ++i) {
    if (roots_[i].used || roots_[i].partner >= 0) continue;
    for (int j = i + 1; j < roots_.size(); ++j) {
      if (roots_[j].used || roots_[j].partner >= 0 || roots_[j].block != roots_[i].block) continue;
      const bool conjugate =
          roots_[i].value.imag() != 0 && roots_[j].value == std::conj(roots_[i].value);
      const bool real_pair =
          basis_.blocks[roots_[i].block].size == 2 && roots_[i].value.imag() == 0;
      if (conjugate || real_pair) {
        roots_[i].partner = j;
        roots_[j].partner = i;
        break;
      }
    }
  }
  const auto free = [&](int i) {
    return !roots_[i].used && roots_[i].partner < 0 && roots_[i].value.imag() == 0;
  };
  const auto likeness = [&](int i, int j) {
    const Eigen::Index ci = basis_.blocks[roots_[i].block].first;
    const Eigen::Index cj = basis_.blocks[roots_[j].block].first;
    const double overlap = basis_.U.col(ci).dot(residual_.MU.col(cj));
    const double score =
        overlap * overlap /
        (basis_.U.col(ci).dot(residual_.MU.col(ci)) * basis_.U.col(cj).dot(residual_.MU.col(cj)));
    return basis_.weight(ci, ci) * basis_.weight(cj, cj) < 0 ? score + 2 : score;
  };
  State<N> scores(roots_.size(), roots_.size());
  for (int i = 0; i < roots_.size(); ++i) {
    for (int j = i + 1; free(i) && j < roots_.size(); ++j)
      scores(i, j) = free(j) ? likeness(i, j) : 0;
  }
  for (;;) {
    double best = -1;
    int first = -1, second = -1;
    for (int i = 0; i < roots_.size(); ++i) {
      for (int j = i + 1; free(i) && j < roots_.size(); ++j) {
        if (free(j) && !(scores(i, j) <= best)) best = scores(i, j), first = i, second = j;
      }
    }
    if (first < 0) return;
    roots_[first].partner = second;
    roots_[second].partner = first;
  }
}

template <int N>
Invariants ModeExtractor<N>::invariants(int i, int j) const {
  const Block& block = basis_.blocks[roots_[i].block];
  Invariants v = root_invariants(roots_[i], roots_[j]);
  if (roots_[i].block == roots_[j].block && block.size == 2) {
    const auto L = basis_.Lambda.block(block.first, block.first, 2, 2);
    const Invariants of_block =
        block_invariants(L(0, 0), L(0, 1), L(1, 0), L(1, 1), enclosure_.radius[roots_[i].block]);
    if (enclosure_.alone(roots_[i].block)) return of_block;
    // In a group with other blocks only the discs are known.
    v.sum = of_block.sum;
    v.product = of_block.product;
    v.discriminant = of_block.discriminant;
  }
  return v;
}

template <int N>
ComplexVector<N> ModeExtractor<N>::left_shape(const Block& block, const Complex& mu) const {
  const BlockVector<N> w = eigenvector<N>(basis_.Gamma, block, mu);
  ComplexVector<N> y(basis_.Y.rows());
  for (Eigen::Index row = 0; row < y.size(); ++row) y[row] = w.combine(basis_.Y, row);
  const Vector<N> re = y.real(), im = y.imag();
  normalize<N>(re.dot(system_.mass * re) + im.dot(system_.mass * im), y);
  return y;
}

/// Writes shapes[which] and left_shapes[which] of a mode: the eigenvectors to the eigenvalue mu
/// (1/s) of a block of the basis. The mode takes the backward error and the condition number of
/// this pair if they are larger. Errors do not depend on lengths, so the sums use vectors of any
/// length.
template <int N>
void ModeExtractor<N>::write_shape(const Block& block, const Complex& mu, std::size_t which,
                                   Mode<N>& mode) const {
  const BlockVector<N> w = eigenvector<N>(basis_.Lambda, block, mu);
  ComplexVector<N>&u = mode.shapes[which], &y = mode.left_shapes[which];
  u.resize(basis_.U.rows());
  if (!spectrum_.symmetric) y = left_shape(block, mu);
  double energy = 0, length2 = 0, residual2 = 0;
  Complex slope = 0;
  for (Eigen::Index row = 0; row < u.size(); ++row) {
    const Complex x = w.combine(basis_.U, row), Mx = w.combine(residual_.MU, row),
                  Cx = w.combine(residual_.CU, row), Kx = w.combine(residual_.KU, row);
    energy += x.real() * Mx.real() + x.imag() * Mx.imag();
    length2 += std::norm(x);
    residual2 += std::norm(product(mu, product(mu, Mx) + Cx) + Kx);
    slope += product(spectrum_.symmetric ? x : y[row], product(2.0 * mu, Mx) + Cx);
    u[row] = x;
  }
  const double length = std::sqrt(length2), left = spectrum_.symmetric ? length : y.norm();
  const double size = std::norm(mu) * M_norm_ + modulus(mu) * C_norm_ + K_norm_;
  const double backward_error = std::sqrt(residual2) / (size * length);
  mode.backward_error =
      std::max(mode.backward_error,
               backward_error >= 0 ? backward_error : std::numeric_limits<double>::infinity());
  mode.condition = std::max(mode.condition, left * length * size / (modulus(mu) * modulus(slope)));
  normalize<N>(energy, u);
  if (spectrum_.symmetric) y = u;
}

template <int N>
void ModeExtractor<N>::write_shapes(int i, int j, Mode<N>& mode) const {
  mode.backward_error = mode.condition = 0;
  const bool in_order = roots_[i].value == mode.eigenvalues[0];
  const auto write = [&](int k, std::size_t which) {
    write_shape(basis_.blocks[roots_[k].block], roots_[k].value, which, mode);
  };
  write(in_order ? i : j, 0);
  if (mode.eigenvalues[0].imag() == 0) {
    write(in_order ? j : i, 1);
  } else {
    mode.shapes[1] = mode.shapes[0].conjugate();
    mode.left_shapes[1] = mode.left_shapes[0].conjugate();
  }
}

template <int N>
void ModeExtractor<N>::write_modes() {
  int count = 0;
  for (int i = 0; i < roots_.size(); ++i) count += !roots_[i].used && roots_[i].partner > i ? 1 : 0;
  spectrum_.modes.resize(count);  // two roots of 2n each: n at most
  // By insertion, in the order of falling sqrt|l1 l2|: a mode without natural frequency has this.
  Eigen::Matrix<int, Eigen::Dynamic, 1, Eigen::ColMajor, kTwice<N>, 1> order(count);
  StateVector<N> key(roots_.size());
  int next = 0;
  for (int i = 0; i < roots_.size(); ++i) {
    const int j = roots_[i].partner;
    if (roots_[i].used || j <= i) continue;
    key[i] = std::sqrt(modulus(roots_[i].value) * modulus(roots_[j].value));
    int position = next++;
    for (; position > 0 && key[order[position - 1]] < key[i]; --position) {
      order[position] = order[position - 1];
    }
    order[position] = i;
  }
  for (int k = 0; k < spectrum_.modes.size(); ++k) {
    const int i = order[k], j = roots_[i].partner;
    const bool upper_first = roots_[i].value.imag() >= 0;
    Mode<N>& mode = spectrum_.modes[k];
    const int first = upper_first ? i : j, second = upper_first ? j : i;
    static_cast<ModeNumbers&>(mode) =
        mode_numbers(roots_[first], roots_[second], invariants(first, second), soft_frequency_);
    const Block &a = basis_.blocks[roots_[i].block], &b = basis_.blocks[roots_[j].block];
    mode.columns = {a.first, a.first == b.first && a.size == 2 ? a.first + 1 : b.first};
    write_shapes(first, second, mode);
  }
}

}  // namespace

template <int N>
void read_modes(const System<N>& system, const BasisResidual<N>& residual,
                const BlockEnclosure<N>& enclosure, double soft_frequency,
                Spectrum<N>& spectrum) noexcept {
  ModeExtractor<N>(system, residual, enclosure, soft_frequency, spectrum).read();
}

template void read_modes(const System<kDynamic>&, const BasisResidual<kDynamic>&,
                         const BlockEnclosure<kDynamic>&, double, Spectrum<kDynamic>&) noexcept;
template void read_modes(const System<kMaxDof>&, const BasisResidual<kMaxDof>&,
                         const BlockEnclosure<kMaxDof>&, double, Spectrum<kMaxDof>&) noexcept;

}  // namespace dashpot::analysis
