#include <dashpot/analysis/linalg/small_dense.hpp>
#include <dashpot/analysis/spectrum/enclosure.hpp>

namespace dashpot::analysis {
namespace {

/// The radius of a disc is found within kLeap^(1 / 2^kHalves), 4 %, over the range of numbers.
constexpr double kLeap = 16;
constexpr int kHalves = 6, kMostLeaps = 530;

}  // namespace

template <int N>
void enclose(const BasisResidual<N>& residual, ModalBasis<N>& basis,
             BlockEnclosure<N>& enclosure) noexcept {
  const auto& blocks = basis.blocks;
  const int count = blocks.size();
  enclosure.reset(count);
  if (!is_finite(residual.F)) return;
  const bool provable = is_finite(residual.F_error);
  State<N> coupling2 = State<N>::Zero(count, count), separation = coupling2;
  StateVector<N> own(count), moved(count);
  for (int j = 0; j < count; ++j) {
    const Block& bj = blocks[j];
    const auto in = [&bj](const State<N>& X, const Block& bi) {
      return X.block(bi.first, bj.first, bi.size, bj.size);
    };
    const auto F = in(residual.F, bj);
    // F itself is added to Lambda, except for zero modes, whose form is kept.
    own[j] = bj.zero_mode ? (F.cwiseAbs() + in(residual.F_error, bj)).norm()
                          : in(residual.F_error, bj).norm();
    moved[j] = bj.zero_mode ? 0 : kSlack * F.norm();
    for (int i = 0; provable && i < count; ++i) {
      if (i == j) continue;
      const Block& bi = blocks[i];
      const double scale = in(basis.weight, bj).norm() /
                           basis.weight.block(bi.first, bi.first, bi.size, bi.size).norm();
      coupling2(i, j) =
          scale * (in(residual.F, bi).cwiseAbs() + in(residual.F_error, bi)).squaredNorm();
      if (i < j) separation(i, j) = block_separation<N>(basis.Lambda, bi, bj);
    }
  }
  for (int j = 0; j < count; ++j) {
    const Block& b = blocks[j];
    auto block = basis.Lambda.block(b.first, b.first, b.size, b.size);
    if (!b.zero_mode) block += residual.F.block(b.first, b.first, b.size, b.size);
    own[j] += b.zero_mode ? 0 : kUnit * block.norm();
    // Separations were taken before that addition: it moves them by at most the sum of the norms.
    for (int i = 0; i < j; ++i) {
      separation(i, j) -= moved[i] + moved[j];
      separation(j, i) = separation(i, j);
    }
  }
  if (!provable) return;
  prove(PerturbationBounds<State<N>, StateVector<N>>{coupling2, separation, own}, enclosure);
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
  const double norm = block_norm + modulus(mu);
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
