#include <dashpot/analysis/spectrum/enclosure.hpp>

#include <algorithm>
#include <cmath>
#include <limits>

namespace dashpot::analysis {
namespace {

constexpr double kUnit = std::numeric_limits<double>::epsilon() / 2;
constexpr double kInfinity = std::numeric_limits<double>::infinity();

/// The radius of a disc is found within kLeap^(1 / 2^kHalves), 4 %, over the range of numbers.
constexpr double kLeap = 16;
constexpr int kHalves = 6, kMostLeaps = 530;

/// Sizes of the blocks of the perturbation, and separations.
template <int N>
struct BlockTable {
  /// Off the diagonal the squared Frobenius norm of |F| + F_error, columns scaled to unit weight;
  /// on it the norm itself (no square) of what is not added to Lambda: F_error, and |F| + F_error
  /// for zero modes
  State<N> norm2;
  State<N> separation;  ///< lower bounds
};

template <int N>
void fill_table(const BasisResidual<N>& residual, const ModalBasis<N>& basis,
                BlockTable<N>& table) {
  const auto& blocks = basis.blocks;
  const int count = blocks.size();
  table.norm2.setZero(count, count);
  table.separation.setConstant(count, count, kInfinity);
  for (int j = 0; j < count; ++j) {
    const Block& bj = blocks[j];
    const auto w_j = basis.weight.block(bj.first, bj.first, bj.size, bj.size);
    for (int i = 0; i < count; ++i) {
      const Block& bi = blocks[i];
      const auto F = residual.F.block(bi.first, bj.first, bi.size, bj.size);
      const auto error = residual.F_error.block(bi.first, bj.first, bi.size, bj.size);
      if (i == j) {
        // F itself is added to Lambda, except for zero modes, whose form is kept.
        table.norm2(i, i) = bi.zero_mode ? (F.cwiseAbs() + error).norm() : error.norm();
        continue;
      }
      const auto w_i = basis.weight.block(bi.first, bi.first, bi.size, bi.size);
      const double scale = std::sqrt(w_j.norm() / w_i.norm());
      table.norm2(i, j) = scale * scale * (F.cwiseAbs() + error).squaredNorm();
      if (i < j) {
        const double separation = block_separation<N>(basis.Lambda, bi, bj);
        table.separation(i, j) = table.separation(j, i) = separation;
      }
    }
  }
}

/// Bound for one group, or a negative number if it has to grow by the group of block `merge`.
/// `everything` bounds the spectral norm of the whole perturbation.
template <int N>
double group_radius(const BlockTable<N>& table, const BlockEnclosure<N>& enclosure, int group,
                    double everything, int& merge) {
  const auto count = static_cast<int>(enclosure.group.size());
  double inner = 0, inner_diagonal = 0, right = 0, left = 0, separation = kInfinity;
  merge = -1;
  for (int i = 0; i < count; ++i) {
    if (enclosure.group[i] != group) continue;
    inner_diagonal = std::max(inner_diagonal, table.norm2(i, i));
    for (int j = 0; j < count; ++j) {
      if (i == j) continue;
      if (enclosure.group[j] == group) {
        inner += table.norm2(i, j);
        continue;
      }
      right += table.norm2(i, j);
      left += table.norm2(j, i);
      const double apart = std::max(0.0, table.separation(i, j));  // 0 if not a number
      if (apart < separation || merge < 0) {
        separation = apart;
        merge = j;
      }
    }
  }
  inner = std::sqrt(inner) + inner_diagonal;
  right = std::sqrt(right);
  left = std::sqrt(left);
  if (merge < 0) return inner;
  // |E22|: everything outside, bounded by everything there is.
  const double delta = separation - inner - everything;
  if (!(delta > 0) || !(4 * right * left < delta * delta)) return -1;
  return inner + 2 * right * left / delta;
}

}  // namespace

template <int N>
void enclose(const BasisResidual<N>& residual, ModalBasis<N>& basis,
             BlockEnclosure<N>& enclosure) noexcept {
  const int count = basis.blocks.size();
  enclosure.radius.setConstant(count, kInfinity);
  enclosure.group.resize(count);
  for (int i = 0; i < count; ++i) enclosure.group[i] = i;
  if (!residual.F.allFinite()) return;
  const bool provable = residual.F_error.allFinite();
  BlockTable<N> table;
  if (provable) {
    fill_table(residual, basis, table);
    table.separation *= 1 - 1e-10;  // its own rounding errors
  }
  for (const Block& b : basis.blocks) {
    if (b.zero_mode) continue;
    auto block = basis.Lambda.block(b.first, b.first, b.size, b.size);
    block += residual.F.block(b.first, b.first, b.size, b.size);
  }
  if (!provable) return;
  // Separations were taken before that addition: it moves them by at most the sum of the norms.
  for (int i = 0; i < count; ++i) {
    const Block& b = basis.blocks[i];
    const auto block = basis.Lambda.block(b.first, b.first, b.size, b.size);
    const double moved =
        b.zero_mode ? 0 : residual.F.block(b.first, b.first, b.size, b.size).norm();
    table.norm2(i, i) = (1 + 1e-10) * table.norm2(i, i) + kUnit * block.norm();
    for (int j = 0; j < count; ++j) {
      if (j == i) continue;
      table.separation(i, j) -= (1 + 1e-10) * moved;
      table.separation(j, i) -= (1 + 1e-10) * moved;
    }
  }
  double everything = 0, largest_diagonal = 0;
  for (int i = 0; i < count; ++i) {
    largest_diagonal = std::max(largest_diagonal, table.norm2(i, i));
    for (int j = 0; j < count; ++j) everything += i == j ? 0 : table.norm2(i, j);
  }
  everything = (1 + 1e-10) * (std::sqrt(everything) + largest_diagonal);
  for (int i = 0; i < count; ++i) {
    if (enclosure.group[i] != i) continue;
    for (;;) {
      int merge = -1;
      const double radius = group_radius(table, enclosure, i, everything, merge);
      if (radius >= 0) {
        for (int k = 0; k < count; ++k) {
          if (enclosure.group[k] == i) enclosure.radius[k] = (1 + 1e-10) * radius;
        }
        break;
      }
      if (merge < 0) break;  // not a number: nothing is proved
      const int absorbed = enclosure.group[merge];
      for (int k = 0; k < count; ++k) {
        if (enclosure.group[k] == absorbed) enclosure.group[k] = i;
      }
    }
  }
}

double disc_radius(const Complex* eigenvalues, int count, int which, double block_norm,
                   double radius) noexcept {
  if (count == 1 || radius == 0 || !std::isfinite(radius)) return radius;
  // An eigenvalue z of the perturbed block (k x k) makes the smallest singular value of block - z
  // at most `radius`, and so
  //     prod |z - mu_j| = |det(block - z)| <= radius |block - z|^(k-1).
  // At distance d from mu_i, the nearest, |z - mu_j| >= max(d, |mu_i - mu_j| / 2): find the d from
  // which on the product is too large for that.
  const Complex mu = eigenvalues[which];
  const double norm = block_norm + modulus(mu) * std::sqrt(static_cast<double>(count));
  if (count == 2) {
    // d max(d, half_gap) > radius (norm + d), solved for d.
    const double half_gap = 0.5 * modulus(eigenvalues[0] - eigenvalues[1]);
    const double simple = radius * norm / (half_gap - radius);
    if (half_gap > radius && simple <= half_gap) return (1 + 1e-10) * simple;
    return (1 + 1e-10) * 0.5 * (radius + std::sqrt(radius * (radius + 4 * norm)));
  }
  const auto is_outside = [&](double d) {
    const double inverse = 1 / (norm + d);
    double product = 1;
    for (int j = 0; j < count; ++j) {
      product *= std::max(d, 0.5 * modulus(mu - eigenvalues[j])) * inverse;
    }
    return (1 - 1e-10) * product * (norm + d) > radius;
  };
  // What is outside stays so with a larger d: the border is found by leaps, then by halves of the
  // last one.
  double inside = radius, outside = radius;
  for (int leap = 0; !is_outside(outside); ++leap) {
    if (leap == kMostLeaps) return kInfinity;
    inside = outside;
    outside *= kLeap;
  }
  for (int half = 0; half < kHalves && inside < outside; ++half) {
    const double middle = std::sqrt(inside) * std::sqrt(outside);
    (is_outside(middle) ? outside : inside) = middle;
  }
  return outside;
}

template void enclose(const BasisResidual<kDynamic>&, ModalBasis<kDynamic>&,
                      BlockEnclosure<kDynamic>&) noexcept;
template void enclose(const BasisResidual<kMaxDof>&, ModalBasis<kMaxDof>&,
                      BlockEnclosure<kMaxDof>&) noexcept;

}  // namespace dashpot::analysis
