#include <dashpot/analysis/base/arithmetic.hpp>
#include <dashpot/analysis/linalg/hessenberg_qr.hpp>
#include <dashpot/analysis/spectrum/mode_numbers.hpp>
#include <dashpot/analysis/spectrum/mode_shapes.hpp>
#include <dashpot/analysis/spectrum/modes.hpp>

#include <algorithm>
#include <cmath>
#include <limits>

namespace dashpot::analysis {
namespace {

constexpr double kNan = std::numeric_limits<double>::quiet_NaN();

struct PairedRoot : BlockRoot {
  int partner = -1;   ///< index of the other root of its mode
  bool used = false;  ///< of a zero mode
};

template <int N>
class ModeExtractor {
 public:
  ModeExtractor(const System<N>& system, const BasisResidual<N>& residual,
                const BlockEnclosure<N>& enclosure, double soft_frequency, Spectrum<N>& spectrum)
      : residual_(residual),
        enclosure_(enclosure),
        basis_(spectrum.basis),
        spectrum_(spectrum),
        shapes_(system, residual, spectrum.basis, spectrum.symmetric),
        soft_frequency_(soft_frequency) {}

  void read() {
    list_roots();
    bound_roots(roots_.data(), root_count_, enclosure_.group);
    take_zero_rates();
    pair_roots();
    write_modes();
  }

 private:
  PairedRoot& root(int i) { return roots_[static_cast<std::size_t>(i)]; }
  const PairedRoot& root(int i) const { return roots_[static_cast<std::size_t>(i)]; }

  void list_roots();
  void take_zero_rates();
  void pair_roots();
  void write_modes();

  Invariants invariants(int i, int j) const;
  void write_shapes(int i, int j, Mode<N>& mode) const;

  const BasisResidual<N>& residual_;
  const BlockEnclosure<N>& enclosure_;
  const ModalBasis<N>& basis_;
  Spectrum<N>& spectrum_;
  ModeShapes<N> shapes_;
  double soft_frequency_;
  std::conditional_t<N == kDynamic, std::vector<PairedRoot>,
                     std::array<PairedRoot, static_cast<std::size_t>(N == kDynamic ? 1 : 2 * N)>>
      roots_;
  int root_count_ = 0;
};

template <int N>
void ModeExtractor<N>::list_roots() {
  if constexpr (N == kDynamic) roots_.resize(static_cast<std::size_t>(basis_.U.cols()));
  root_count_ = 0;
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
    // Backward error of the block's own QR iteration, generously. Those of zero modes are
    // triangular.
    const double factor = b.zero_mode ? 0 : b.size > 2 ? 64 * b.size : 8;
    const double radius = enclosure_.radius[k] + factor * b.size * kUnit * Lambda.norm();
    for (int e = 0; e < b.size; ++e) {
      PairedRoot& r = root(root_count_++);
      r = PairedRoot{};
      r.value = values[e];
      r.block = k;
      r.used = b.zero_mode;  // of no mode, but its disc may hold the eigenvalue of another
      r.radius = disc_radius(values.data(), b.size, e, Lambda.norm(), radius);
    }
  }
}

template <int N>
void ModeExtractor<N>::take_zero_rates() {
  const int r = spectrum_.zero_modes.count;
  spectrum_.zero_mode_rates = Vector<N>::Zero(r);
  spectrum_.zero_mode_rates_bound = Vector<N>::Constant(r, kInfinity);
  int found = 0;
  for (int i = 0; i + 1 < root_count_ && found < r; ++i) {
    const Block& b = basis_.blocks[root(i).block];
    if (!b.zero_mode || b.size != 2) continue;
    // eigenvalues_2x2 returns 0 and then the rate, as it stands in the block.
    spectrum_.zero_mode_rates[found] = root(i + 1).value.real();
    spectrum_.zero_mode_rates_bound[found++] = root(i + 1).bound;
    ++i;
  }
  // The rest are real eigenvalues whose motion is mostly along the zero modes.
  for (; found < r; ++found) {
    double best = -1;
    int chosen = -1;
    for (int i = 0; i < root_count_; ++i) {
      if (root(i).used || root(i).value.imag() != 0) continue;
      const Block& b = basis_.blocks[root(i).block];
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
    root(chosen).used = true;
    spectrum_.zero_mode_rates[found] = root(chosen).value.real();
    spectrum_.zero_mode_rates_bound[found] = root(chosen).bound;
  }
}

/// Complex roots pair with their conjugates; real ones of one two-column block with each other;
/// other real ones by the likeness of their shapes, one of each sign type where the system is
/// symmetric.
template <int N>
void ModeExtractor<N>::pair_roots() {
  for (int i = 0; i < root_count_; ++i) {
    if (root(i).used || root(i).partner >= 0) continue;
    for (int j = i + 1; j < root_count_; ++j) {
      if (root(j).used || root(j).partner >= 0 || root(j).block != root(i).block) continue;
      const bool conjugate = root(i).value.imag() != 0 && root(j).value == std::conj(root(i).value);
      const bool real_pair = basis_.blocks[root(i).block].size == 2 && root(i).value.imag() == 0;
      if (conjugate || real_pair) {
        root(i).partner = j;
        root(j).partner = i;
        break;
      }
    }
  }
  const auto free = [&](int i) {
    return !root(i).used && root(i).partner < 0 && root(i).value.imag() == 0;
  };
  const auto likeness = [&](int i, int j) {
    const Eigen::Index ci = basis_.blocks[root(i).block].first;
    const Eigen::Index cj = basis_.blocks[root(j).block].first;
    const double overlap = basis_.U.col(ci).dot(residual_.MU.col(cj));
    const double score =
        overlap * overlap /
        (basis_.U.col(ci).dot(residual_.MU.col(ci)) * basis_.U.col(cj).dot(residual_.MU.col(cj)));
    return basis_.weight(ci, ci) * basis_.weight(cj, cj) < 0 ? score + 2 : score;
  };
  State<N> scores(root_count_, root_count_);
  for (int i = 0; i < root_count_; ++i) {
    for (int j = i + 1; free(i) && j < root_count_; ++j)
      scores(i, j) = free(j) ? likeness(i, j) : 0;
  }
  for (;;) {
    double best = -1;
    int first = -1, second = -1;
    for (int i = 0; i < root_count_; ++i) {
      for (int j = i + 1; free(i) && j < root_count_; ++j) {
        if (free(j) && !(scores(i, j) <= best)) best = scores(i, j), first = i, second = j;
      }
    }
    if (first < 0) return;
    root(first).partner = second;
    root(second).partner = first;
  }
}

template <int N>
Invariants ModeExtractor<N>::invariants(int i, int j) const {
  const Block& block = basis_.blocks[root(i).block];
  Invariants v = root_invariants(root(i), root(j));
  if (root(i).block == root(j).block && block.size == 2) {
    const auto L = basis_.Lambda.block(block.first, block.first, 2, 2);
    const Invariants of_block =
        block_invariants(L(0, 0), L(0, 1), L(1, 0), L(1, 1), enclosure_.radius[root(i).block]);
    if (enclosure_.alone(root(i).block)) return of_block;
    // In a group with other blocks only the discs are known.
    v.sum = of_block.sum;
    v.product = of_block.product;
    v.discriminant = of_block.discriminant;
  }
  return v;
}

template <int N>
void ModeExtractor<N>::write_shapes(int i, int j, Mode<N>& mode) const {
  mode.backward_error = mode.condition = 0;
  const bool in_order = root(i).value == mode.eigenvalues[0];
  const auto write_shape = [&](int k, std::size_t which) {
    shapes_.write(basis_.blocks[root(k).block], root(k).value, which, mode);
  };
  write_shape(in_order ? i : j, 0);
  if (mode.eigenvalues[0].imag() == 0) {
    write_shape(in_order ? j : i, 1);
  } else {
    mode.shapes[1] = mode.shapes[0].conjugate();
    mode.left_shapes[1] = mode.left_shapes[0].conjugate();
  }
}

template <int N>
void ModeExtractor<N>::write_modes() {
  int count = 0;
  for (int i = 0; i < root_count_; ++i) count += !root(i).used && root(i).partner > i ? 1 : 0;
  spectrum_.modes.resize(count);  // two roots of 2n each: n at most
  // By insertion, in the order of falling sqrt|l1 l2|: a mode without natural frequency has this.
  Eigen::Matrix<int, Eigen::Dynamic, 1, Eigen::ColMajor, kTwice<N>, 1> order(count);
  StateVector<N> key(root_count_);
  int next = 0;
  for (int i = 0; i < root_count_; ++i) {
    const int j = root(i).partner;
    if (root(i).used || j <= i) continue;
    key[i] = std::sqrt(modulus(root(i).value) * modulus(root(j).value));
    int position = next++;
    for (; position > 0 && key[order[position - 1]] < key[i]; --position) {
      order[position] = order[position - 1];
    }
    order[position] = i;
  }
  for (int k = 0; k < spectrum_.modes.size(); ++k) {
    const int i = order[k], j = root(i).partner;
    const bool upper_first = root(i).value.imag() >= 0;
    Mode<N>& mode = spectrum_.modes[k];
    const int first = upper_first ? i : j, second = upper_first ? j : i;
    static_cast<ModeNumbers&>(mode) =
        mode_numbers(root(first), root(second), invariants(first, second), soft_frequency_);
    const Block &a = basis_.blocks[root(i).block], &b = basis_.blocks[root(j).block];
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

template <int N>
Quality worst_quality(const Spectrum<N>& spectrum) noexcept {
  Quality worst;
  for (const Mode<N>& mode : spectrum.modes) {
    worst.bound = std::max(worst.bound, relative_bound(mode));
    worst.backward_error = std::max(worst.backward_error, mode.backward_error);
  }
  return worst;
}

template void read_modes(const System<kDynamic>&, const BasisResidual<kDynamic>&,
                         const BlockEnclosure<kDynamic>&, double, Spectrum<kDynamic>&) noexcept;
template void read_modes(const System<kMaxDof>&, const BasisResidual<kMaxDof>&,
                         const BlockEnclosure<kMaxDof>&, double, Spectrum<kMaxDof>&) noexcept;
template Quality worst_quality(const Spectrum<kDynamic>&) noexcept;
template Quality worst_quality(const Spectrum<kMaxDof>&) noexcept;

}  // namespace dashpot::analysis
