#include <dashpot/analysis/base/arithmetic.hpp>
#include <dashpot/analysis/tracker/block_eigenbasis.hpp>

#include <Eigen/Core>
#include <algorithm>
#include <cmath>

namespace dashpot::analysis {
namespace {

/// A step as large as this does not say what it seems to.
constexpr double kSmallStep = 0.3;
/// Between what may coincide: modes that are alike, and zero modes, whose couplings and rates are
/// often small together. They are better parted all at once.
constexpr double kSureStep = 1e-3;
/// Up to this size it does no harm if it comes of rounding errors.
constexpr double kTinyStep = 1e-6;
/// Squares of half the difference of a mode's two eigenvalues from here on, relative to the squared
/// size of its block: not critical.
constexpr double kTwoRates = 1e-4;
/// Distance of the eigenvalues of two modes, relative to the distance of each mode's own two, below
/// which they may coincide.
constexpr double kAlike = 0.03;
/// Alike modes coincide that differ by less than this part of the couplings that the rest of the
/// step, to its square, and rounding errors bring about.
constexpr double kSame = 0.3;

void clear_padding(const BlockEigenbasis& basis, PackedMatrix& X) {
  for (int i = 0; i < basis.columns(); ++i) {
    for (int j = basis.columns(); j < X.width; ++j) X(i, j) = 0;
  }
}

/// E between mode i and all others.
void solve_row(const BlockEigenbasis& basis, const PackedMatrix& G, int i, PackedMatrix& E) {
  const int m = basis.modes;
  const Block2<double> A = basis.block(i);
  std::array<Block2<Vec4d>, kMaxDof / 4> X;
  for (int j = 0; j < m; j += 4) {
    const Block2<Vec4d> B = basis.blocks_from(j);
    const Block2<Vec4d> Q{-load(G.row(i) + j), -load(G.row(i) + m + j), load(G.row(m + i) + j),
                          load(G.row(m + i) + m + j)};
    X[at(j / 4)] = solve_sylvester(A, B, Q);
  }
  // What lanes beyond the last mode hold is overwritten by the next part of the row.
  for (int j = 0; j < m; j += 4) {
    store(E.row(i) + j, X[at(j / 4)].a);
    store(E.row(m + i) + j, X[at(j / 4)].c);
  }
  for (int j = 0; j < m; j += 4) {
    store(E.row(i) + m + j, X[at(j / 4)].b);
    store(E.row(m + i) + m + j, X[at(j / 4)].d);
  }
}

/// E between mode i and zero mode k, both ways, and between zero modes.
void solve_zeros(const BlockEigenbasis& basis, const PackedMatrix& G, PackedMatrix& E) {
  const int m = basis.modes;
  for (int k = 0; k < basis.zeros; ++k) {
    const int column = 2 * m + k;
    const double x = basis.rate[at(k)];
    for (int i = 0; i < m; ++i) {
      auto [a, b, c, d] = basis.block(i);
      a -= x, d -= x;
      const double inverse = 1 / (a * d - b * c);
      const double q0 = -G(i, column), q1 = G(m + i, column);
      E(i, column) = inverse * (d * q0 - b * q1);
      E(m + i, column) = inverse * (a * q1 - c * q0);
      const double w0 = G(column, i), w1 = G(column, m + i);  // x e - e Lambda_i = w
      E(column, i) = -inverse * (w0 * d - w1 * c);
      E(column, m + i) = -inverse * (w1 * a - w0 * b);
    }
    for (int l = 0; l < basis.zeros; ++l) {
      E(column, 2 * m + l) = G(column, 2 * m + l) / (x - basis.rate[at(l)]);
    }
  }
}

template <typename Visit>
void visit_block(const BlockEigenbasis& basis, int i, int j, const Visit& visit) {
  visit(basis.first(i), basis.first(j));
  if (j < basis.modes) visit(basis.first(i), basis.second(j));
  if (i < basis.modes) {
    visit(basis.second(i), basis.first(j));
    if (j < basis.modes) visit(basis.second(i), basis.second(j));
  }
}

double block_norm(const BlockEigenbasis& basis, const PackedMatrix& X, int i, int j) {
  double sum = 0;
  visit_block(basis, i, j, [&](int row, int column) { sum += X(row, column) * X(row, column); });
  return std::sqrt(sum);
}

/// E_ij = -Sigma_i R_ij / 2: the columns stay orthonormal, and are not told apart.
void only_orthonormalize(const BlockEigenbasis& basis, const PackedMatrix& R, int i, int j,
                         PackedMatrix& E) {
  visit_block(basis, i, j, [&](int row, int column) {
    E(row, column) = row < basis.modes ? -0.5 * R(row, column) : 0.5 * R(row, column);
  });
}

double squared_norm(const BlockEigenbasis& basis, const PackedMatrix& X) {
  Vec4d squares{};
  for (int i = 0; i < basis.columns(); ++i) {
    for (int j = 0; j < X.width; j += 4) squares += load(X.row(i) + j) * load(X.row(i) + j);
  }
  return sum(squares);
}

/// Couplings that the square of a step brings about: they go away with it.
double disturbance(const BlockEigenbasis& basis, double squared_size) {
  double rates = 0;
  for (int i = 0; i < basis.modes; ++i) rates += basis.block(i).squared_norm();
  return std::sqrt(rates) * squared_size;
}

/// Couplings between zero modes that come of what the rest of the step, to its square, lets them
/// have of the modes' damping: they go away with it.
double zeros_disturbance(const BlockEigenbasis& basis, const PackedMatrix& E) {
  if (basis.zeros < 2) return 0;
  double among_zeros = 0;
  for (int i = 2 * basis.modes; i < basis.columns(); ++i) {
    for (int j = 2 * basis.modes; j < basis.columns(); ++j) among_zeros += E(i, j) * E(i, j);
  }
  return disturbance(basis, std::max(0.0, squared_norm(basis, E) - among_zeros));
}

/// The square of half the difference of a block's eigenvalues.
double squared_radius(const Block2<double>& A) {
  return 0.25 * A.trace() * A.trace() - A.determinant();
}

/// How far the eigenvalues of two modes are apart of which both vibrate or both are overdamped.
double distance(const Block2<double>& A, const Block2<double>& B) {
  const double a = squared_radius(A), b = squared_radius(B);
  return 0.5 * std::abs(A.trace() - B.trace()) +
         std::abs(a - b) / (std::sqrt(std::abs(a)) + std::sqrt(std::abs(b)));
}

/// Whether two modes are far nearer to each other than their own eigenvalues are, and neither is
/// critical.
bool are_alike(const Block2<double>& A, const Block2<double>& B) {
  const double a = squared_radius(A), b = squared_radius(B);
  return std::abs(a) > kTwoRates * A.squared_norm() && std::abs(b) > kTwoRates * B.squared_norm() &&
         (a > 0) == (b > 0) &&
         distance(A, B) < kAlike * (std::sqrt(std::abs(a)) + std::sqrt(std::abs(b)));
}

using Matrix2 = Eigen::Matrix2d;

Matrix2 matrix(const Block2<double>& block) {
  return (Matrix2() << block.a, block.b, block.c, block.d).finished();
}

/// The equation of E between two modes, L(E) = Lambda_i E - E Lambda_j = -Sigma_i G_ij.
struct PairEquation {
  PairEquation(const BlockEigenbasis& basis, const PackedMatrix& G, int first, int second)
      : i(first), j(second), m(basis.modes), A(basis.block(i)), B(basis.block(j)) {
    Q << -G(i, j), -G(i, m + j), G(m + i, j), G(m + i, m + j);
  }

  Matrix2 image(const Matrix2& X) const { return matrix(A) * X - X * matrix(B); }
  void store_in(PackedMatrix& E, const Matrix2& X) const {
    E(i, j) = X(0, 0), E(i, m + j) = X(0, 1), E(m + i, j) = X(1, 0), E(m + i, m + j) = X(1, 1);
  }
  void solve(PackedMatrix& E) const {
    store_in(E, matrix(solve_sylvester(A, B, {Q(0, 0), Q(0, 1), Q(1, 0), Q(1, 1)})));
  }
  /// Solves it for what parts each eigenvalue of one mode from the other one of the other mode:
  /// there L(L(X)) = 4 r X where the modes coincide, with r the squared radius, and L(X) = 0
  /// elsewhere. Adds that to E, and returns the coupling that is left.
  double solve_across(PackedMatrix& E) const {
    Matrix2 X;
    X << E(i, j), E(i, m + j), E(m + i, j), E(m + i, m + j);
    X += image(Q - image(X)) / (2 * (squared_radius(A) + squared_radius(B)));
    store_in(E, X);
    return (Q - image(X)).norm();
  }

  int i, j, m;
  Block2<double> A, B;
  Matrix2 Q;
};

/// Two blocks whose E may not be what it seems, and the coupling that E leaves.
struct UnsurePair {
  int i, j;
  double coupling, step;
  bool alike;
};

}  // namespace

CloseBlocks newton_step(const BlockEigenbasis& basis, const TrackedResidual& residual,
                        double roundoff_bound, PackedMatrix& E, double& size) noexcept {
  E.width = basis.Z.width;
  for (int i = 0; i < basis.modes; ++i) solve_row(basis, residual.G, i, E);
  if (basis.zeros > 0) solve_zeros(basis, residual.G, E);
  for (int i = 0; i < basis.blocks(); ++i) only_orthonormalize(basis, residual.R, i, i, E);
  clear_padding(basis, E);
  size = std::sqrt(squared_norm(basis, E));
  CloseBlocks close;
  if (size < kTinyStep) return close;
  const double zeros_roundoff_bound = roundoff_bound + zeros_disturbance(basis, E);
  std::array<UnsurePair, static_cast<std::size_t>(kMaxDof) * (kMaxDof - 1) / 2> pairs;
  int count = 0;
  for (int i = 0; i < basis.blocks(); ++i) {
    for (int j = 0; j < i; ++j) {
      const double step = std::max(block_norm(basis, E, i, j), block_norm(basis, E, j, i));
      if (step < kTinyStep) continue;
      const bool alike = i < basis.vibrations() && are_alike(basis.block(i), basis.block(j));
      const double sure = alike || j >= basis.modes ? kSureStep : kSmallStep;
      double coupling =
          std::max(block_norm(basis, residual.G, i, j), block_norm(basis, residual.G, j, i));
      if (coupling > roundoff_bound && step < sure) continue;
      only_orthonormalize(basis, residual.R, i, j, E);
      only_orthonormalize(basis, residual.R, j, i, E);
      if (alike) {  // less may be left of the coupling, or more of what were rounding errors
        const double left = std::max(PairEquation(basis, residual.G, i, j).solve_across(E),
                                     PairEquation(basis, residual.G, j, i).solve_across(E));
        coupling = std::min(coupling, left);
      }
      pairs[at(count++)] = {i, j, coupling, step, alike};
    }
  }
  if (count == 0) return close;
  const double disturbed = roundoff_bound + disturbance(basis, squared_norm(basis, E));
  double worst = 0;
  for (int k = 0; k < count; ++k) {
    const auto& [i, j, coupling, step, alike] = pairs[at(k)];
    const bool coincide = alike && distance(basis.block(i), basis.block(j)) < kSame * disturbed;
    const double least = coincide           ? disturbed
                         : j >= basis.modes ? zeros_roundoff_bound
                                            : roundoff_bound;
    if (coupling <= least) continue;
    if (alike && step < kSmallStep) {
      PairEquation(basis, residual.G, i, j).solve(E);
      PairEquation(basis, residual.G, j, i).solve(E);
      continue;
    }
    only_orthonormalize(basis, residual.R, i, j, E);
    only_orthonormalize(basis, residual.R, j, i, E);
    if (coupling < worst) continue;
    worst = coupling;
    close = {j, i};
  }
  size = std::sqrt(squared_norm(basis, E));
  return close;
}

}  // namespace dashpot::analysis
