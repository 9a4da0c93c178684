#include <dashpot/analysis/tracker/block_eigenbasis.hpp>

#include <dashpot/analysis/base/arithmetic.hpp>

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

}  // namespace dashpot::analysis
