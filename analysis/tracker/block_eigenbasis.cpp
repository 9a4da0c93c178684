#include <dashpot/analysis/base/arithmetic.hpp>
#include <dashpot/analysis/tracker/block_eigenbasis.hpp>

#include <algorithm>
#include <cmath>

namespace dashpot::analysis {
namespace {

/// X(row, column), X(row + 1, column + 1), ...: four entries, of which `count` exist.
Vec4d diagonal(const PackedMatrix& X, int row, int column, int count, double otherwise) {
  Vec4d lanes;
  for (int k = 0; k < 4; ++k) lanes[k] = k < count ? X(row + k, column + k) : otherwise;
  return lanes;
}

void set_blocks(const PackedMatrix& N, const PackedMatrix& T, BlockEigenbasis& basis) {
  const int m = basis.modes;
  for (int i = 0; i < m; i += 4) {
    const int k = m + i, count = std::min(4, m - i);
    const Vec4d n00 = diagonal(N, i, i, count, 1), n01 = diagonal(N, i, k, count, 0),
                n10 = diagonal(N, k, i, count, 0), n11 = diagonal(N, k, k, count, 1);
    const Vec4d t00 = diagonal(T, i, i, count, 0), t01 = diagonal(T, i, k, count, 0),
                t10 = diagonal(T, k, i, count, 0), t11 = diagonal(T, k, k, count, 0);
    const Vec4d inverse = 1 / (n00 * n11 - n01 * n10);
    store(&basis.l00[at(i)], inverse * (n11 * t00 - n01 * t10));
    store(&basis.l01[at(i)], inverse * (n11 * t01 - n01 * t11));
    store(&basis.l10[at(i)], inverse * (n00 * t10 - n10 * t00));
    store(&basis.l11[at(i)], inverse * (n00 * t11 - n10 * t01));
  }
  for (int k = 0; k < basis.zeros; ++k) {
    basis.rate[at(k)] = T(2 * m + k, 2 * m + k) / N(2 * m + k, 2 * m + k);
  }
}

/// G = T - N Lambda, in the place of T. Lambda is zero in the lanes beyond the last mode, and so
/// they write back what they read.
void subtract_blocks(const BlockEigenbasis& basis, const PackedMatrix& N, PackedMatrix& G) {
  const int m = basis.modes;
  for (int i = 0; i < basis.columns(); ++i) {
    const double* const n = N.row(i);
    double* const g = G.row(i);
    std::array<Vec4d, kMaxDof / 4> first, second;
    for (int j = 0; j < m; j += 4) {
      const Vec4d n0 = load(n + j), n1 = load(n + m + j);
      const Block2<Vec4d> L = basis.blocks_from(j);
      first[at(j / 4)] = load(g + j) - (n0 * L.a + n1 * L.c);
      second[at(j / 4)] = load(g + m + j) - (n0 * L.b + n1 * L.d);
    }
    for (int j = 0; j < m; j += 4) store(g + j, first[at(j / 4)]);
    for (int j = 0; j < m; j += 4) store(g + m + j, second[at(j / 4)]);
    for (int k = 0; k < basis.zeros; ++k) g[2 * m + k] -= n[2 * m + k] * basis.rate[at(k)];
  }
}

void take_diagonal(const BlockEigenbasis& basis, PackedMatrix& G,
                   BlockEigenbasis::Entries& squares) {
  for (int i = 0; i < basis.modes; ++i) {
    squares[at(i)] = 0;
    for (const int row : {i, basis.modes + i}) {
      for (const int column : {i, basis.modes + i}) {
        squares[at(i)] += G(row, column) * G(row, column);
        G(row, column) = 0;
      }
    }
  }
}

/// R = Z' S Z (Sigma is not yet subtracted) and G = Z' B Z, with S Z = [Z_s or K Z_s; -M V] and
/// B Z = [W V; W' Z_s + C V]. In a two-sided basis Y is in the place of Z',
/// and without a factor S Z = [Z_q; -M V] and B Z = [V; K Z_q + C V].
void multiply(const SymmetricPencil& pencil, const BlockEigenbasis& basis,
              TrackedResidual& residual) {
  const int n = pencil.joints, p = pencil.rank, states = pencil.states(), width = basis.Z.width;
  const bool plain = basis.two_sided && !pencil.factored;
  const auto product = [multiplication = padded_multiply(width), width](
                           const Strided& A, int rows, int inner, const double* X,
                           const double* start, double sign, double* out) {
    multiplication(A, rows, inner, X, start, sign, out, width);
  };
  const double *const elastic = basis.Z.row(0), *const velocity = basis.Z.row(p);
  product({pencil.M, 1, n}, n, n, velocity, nullptr, -1, residual.MV.row(p));
  if (plain) {
    std::copy(velocity, velocity + n * width, residual.image.row(0));
    product({pencil.W, 1, n}, n, n, elastic, nullptr, 1, residual.image.row(p));
  } else {
    product({pencil.W, 1, p}, p, n, velocity, nullptr, 1, residual.image.row(0));
    product({pencil.W, p, 1}, n, p, elastic, nullptr, 1, residual.image.row(p));
  }
  const double* const upper = pencil.factored || plain ? elastic : residual.image.row(p);
  std::copy(upper, upper + p * width, residual.MV.row(0));
  product({pencil.C, 1, n}, n, n, velocity, residual.image.row(p), 1, residual.image.row(p));
  const Strided left =
      basis.two_sided ? Strided{basis.Y.row(0), width, 1} : Strided{basis.Z.row(0), 1, width};
  product(left, basis.columns(), states, residual.MV.row(0), nullptr, 1, residual.R.row(0));
  product(left, basis.columns(), states, residual.image.row(0), nullptr, 1, residual.G.row(0));
}

}  // namespace

SymmetricPencil symmetric_pencil(const System<kMaxDof>& system) noexcept {
  SymmetricPencil pencil;
  pencil.joints = static_cast<int>(system.dof());
  const auto rows = static_cast<int>(system.stiffness_factor.rows());
  pencil.factored = rows > 0 && rows <= pencil.joints;
  pencil.rank = pencil.factored ? rows : pencil.joints;
  pencil.M = system.mass.data();
  pencil.C = system.damping.data();
  pencil.W = pencil.factored ? system.stiffness_factor.data() : system.stiffness.data();
  return pencil;
}

void evaluate(const SymmetricPencil& pencil, BlockEigenbasis& basis,
              TrackedResidual& residual) noexcept {
  for (PackedMatrix* rows : {&residual.R, &residual.G, &residual.MV, &residual.image}) {
    rows->width = basis.Z.width;
  }
  multiply(pencil, basis, residual);
  set_blocks(residual.R, residual.G, basis);
  subtract_blocks(basis, residual.R, residual.G);
  for (int i = 0; i < basis.columns(); ++i) residual.R(i, i) -= i < basis.modes ? 1 : -1;
  take_diagonal(basis, residual.G, residual.diagonal);
}

std::int64_t iteration_work(const BlockEigenbasis& basis) noexcept {
  const std::int64_t left = basis.two_sided ? cubed(basis.columns(), 6) : 0;
  return cubed(basis.columns(), 16) + squared(basis.columns(), 130) + left;
}

int packed_width(int modes, int zeros) noexcept {
  const int lanes = modes + (modes + zeros + 3) / 4 * 4;
  return (std::max(2 * modes + zeros, lanes) + 3) / 4 * 4;
}

void take_step(const PackedMatrix& E, TrackedResidual& residual, BlockEigenbasis& basis) noexcept {
  const int m = basis.modes, size = basis.columns(), width = basis.Z.width;
  const auto product = padded_multiply(width);
  product({basis.Z.row(0), width, 1}, size, size, E.row(0), basis.Z.row(0), 1, basis.Z.row(0),
          width);
  if (!basis.two_sided) return;
  PackedMatrix& step = residual.MV;
  for (int i = 0; i < size; ++i) {
    const double *const R = residual.R.row(i), *const e = E.row(i);
    double* const out = step.row(i);
    const double row_sign = i < m ? 1 : -1;
    for (int j = 0; j < m; ++j) out[j] = -R[j] - row_sign * e[j];
    for (int j = m; j < size; ++j) out[j] = R[j] + row_sign * e[j];
  }
  product({step.row(0), width, 1}, size, size, basis.Y.row(0), basis.Y.row(0), 1,
          residual.image.row(0), width);
  copy(residual.image, size, basis.Y);
}

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
