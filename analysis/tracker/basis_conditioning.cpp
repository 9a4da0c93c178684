#include <dashpot/analysis/tracker/block_eigenbasis.hpp>

#include <dashpot/analysis/base/arithmetic.hpp>

#include <algorithm>
#include <cmath>

namespace dashpot::analysis {
namespace {

/// Columns of a block are rotated or balanced again when they lean this much towards each other, or
/// their squared lengths are so many times each other.
constexpr double kLeaning = 0.6, kUneven = 9;
/// Least rate that balances positions and velocities of a block, relative to the largest one: zero
/// modes have no frequency of their own.
constexpr double kLeastRate = 1e-3;

/// Squared lengths of the columns of four blocks, and the products of the two columns.
struct Lengths {
  Vec4d first{}, second{}, mixed{};

  void add(const BlockEigenbasis& basis, int row, int i, const Vec4d& weight) {
    const Vec4d x = load(basis.Z.row(row) + i), y = load(basis.Z.row(row) + basis.modes + i);
    first += weight * x * x;
    second += weight * y * y;
    mixed += weight * x * y;
  }
};

/// w^2 of blocks i to i + 3.
Vec4d squared_rates(const BlockEigenbasis& basis, int i, double least) {
  const Vec4d rate = magnitude(basis.blocks_from(i).determinant());
  return rate > least ? rate : Vec4d{} + least;
}

/// Orthonormal columns by Cholesky's factor R of their products: Z R^-1, and R times the rows of Y
/// without their signs.
void orthonormalize_block(double first, double second, double mixed, int i,
                          BlockEigenbasis& basis) {
  const double r00 = std::sqrt(first), r01 = mixed / r00, r11 = std::sqrt(second - r01 * r01);
  if (!(r11 > 0)) return;
  const int j = basis.modes + i;
  for (int row = 0; row < basis.columns(); ++row) {
    const double x = basis.Z(row, i) / r00;
    basis.Z(row, i) = x;
    basis.Z(row, j) = (basis.Z(row, j) - r01 * x) / r11;
    basis.Y(i, row) = r00 * basis.Y(i, row) - r01 * basis.Y(j, row);
    basis.Y(j, row) *= r11;
  }
}

}  // namespace

bool rotate_hyperbolically(const TrackedResidual& residual, double tolerance,
                           BlockEigenbasis& basis) noexcept {
  bool any = false;
  for (int i = 0; i < basis.modes; ++i) {
    // Kinetic energies v' M v of the columns; elastic ones differ by Z' S Z = Sigma. In the energy
    // metric the products are 2 first + 1, 2 second - 1 and 2 mixed.
    double first = 0, second = 0, mixed = 0;
    for (int k = basis.modes; k < basis.columns(); ++k) {
      first -= basis.Z(k, i) * residual.MV(k, i);
      second -= basis.Z(k, basis.modes + i) * residual.MV(k, basis.modes + i);
      mixed -= basis.Z(k, i) * residual.MV(k, basis.modes + i);
    }
    const double tangent = -2 * mixed / (first + second);
    if (!(std::abs(tangent) > tolerance) || !(std::abs(tangent) < 1)) continue;
    any = true;
    const double angle = 0.5 * std::atanh(tangent), c = std::cosh(angle), s = std::sinh(angle);
    for (int row = 0; row < basis.columns(); ++row) {
      const double x = basis.Z(row, i), y = basis.Z(row, basis.modes + i);
      basis.Z(row, i) = c * x + s * y;
      basis.Z(row, basis.modes + i) = s * x + c * y;
    }
  }
  return any;
}

bool balance(const SymmetricPencil& pencil, bool all, BlockEigenbasis& basis) noexcept {
  const int n = pencil.joints, p = pencil.rank;
  double largest = 0;
  for (int i = 0; i < basis.modes; ++i) {
    largest = std::max(largest, std::abs(basis.block(i).determinant()));
  }
  const double least = kLeastRate * kLeastRate * largest;
  bool any = false;
  for (int i = 0; i < basis.modes; i += 4) {
    Lengths elastic, kinetic;
    for (int k = 0; k < p; ++k) {
      elastic.add(basis, k, i, Vec4d{} + (pencil.factored ? 1 : pencil.M[k + k * n]));
    }
    for (int k = 0; k < n; ++k) kinetic.add(basis, p + k, i, Vec4d{} + pencil.M[k + k * n]);
    const Vec4d rate = pencil.factored ? Vec4d{} + 1 : squared_rates(basis, i, least);
    const Vec4d first = rate * elastic.first + kinetic.first,
                second = rate * elastic.second + kinetic.second,
                mixed = rate * elastic.mixed + kinetic.mixed;
    for (int lane = 0; lane < 4 && i + lane < basis.modes; ++lane) {
      const double x = first[lane], y = second[lane], xy = mixed[lane];
      const bool even = x < kUneven * y && y < kUneven * x && xy * xy < kLeaning * kLeaning * x * y;
      if (even && !all) continue;
      orthonormalize_block(x, y, xy, i + lane, basis);
      any = true;
    }
  }
  return any;
}

void recondition(const SymmetricPencil& pencil, const TrackedResidual& residual,
                 BlockEigenbasis& basis) noexcept {
  if (basis.two_sided) {
    balance(pencil, false, basis);
  } else {
    rotate_hyperbolically(residual, kLeaning, basis);
  }
}

}  // namespace dashpot::analysis
