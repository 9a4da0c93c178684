#include <dashpot/analysis/linalg/hessenberg_qr.hpp>
#include <dashpot/analysis/linalg/small_dense.hpp>
#include <dashpot/analysis/tracker/cluster_separation.hpp>

#include <Eigen/Eigenvalues>
#include <cmath>
#include <limits>

namespace dashpot::analysis {
namespace {

/// Squared lengths in the metric below this, relative to Euclidean ones, count as zero.
constexpr double kNeutral = 1e-4;
constexpr double kEps = std::numeric_limits<double>::epsilon();

using Small = Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, 0, 4, 4>;
using SmallVector = Eigen::Matrix<double, Eigen::Dynamic, 1, 0, 4, 1>;
using ComplexSmall = Eigen::Matrix<Complex, Eigen::Dynamic, Eigen::Dynamic, 0, 4, 4>;
using ComplexSmallVector = Eigen::Matrix<Complex, Eigen::Dynamic, 1, 0, 4, 1>;

/// The system in the columns of two blocks: N (metric) and T, eigenvalues of N^-1 T.
struct SmallProblem {
  std::array<int, 4> columns{};
  int size = 0;
  Small N, T, B;
  std::array<Complex, 4> values{};
};

void add_columns(const BlockEigenbasis& basis, int block, SmallProblem& problem) {
  problem.columns[static_cast<std::size_t>(problem.size++)] = basis.first(block);
  if (block < basis.modes) {
    problem.columns[static_cast<std::size_t>(problem.size++)] = basis.second(block);
  }
}

/// (N Lambda)(row, column)
double times_block(const BlockEigenbasis& basis, const TrackedResidual& residual, int row,
                   int column) {
  const auto N = [&](int j) {
    return residual.R(row, j) + (row == j ? (row < basis.modes ? 1.0 : -1.0) : 0.0);
  };
  const int m = basis.modes;
  if (column >= 2 * m) return N(column) * basis.rate[static_cast<std::size_t>(column - 2 * m)];
  const int i = column % m;
  const auto k = static_cast<std::size_t>(i);
  return column < m ? N(i) * basis.l00[k] + N(m + i) * basis.l10[k]
                    : N(i) * basis.l01[k] + N(m + i) * basis.l11[k];
}

bool pose(const TrackedResidual& residual, const CloseBlocks& close, const BlockEigenbasis& basis,
          SmallProblem& problem) {
  add_columns(basis, close.first, problem);
  add_columns(basis, close.second, problem);
  const int size = problem.size;
  problem.N.resize(size, size);
  problem.T.resize(size, size);
  for (int i = 0; i < size; ++i) {
    const int row = problem.columns[static_cast<std::size_t>(i)];
    for (int j = 0; j < size; ++j) {
      const int column = problem.columns[static_cast<std::size_t>(j)];
      problem.N(i, j) =
          residual.R(row, column) + (row == column ? (row < basis.modes ? 1 : -1) : 0);
      problem.T(i, j) = residual.G(row, column) + times_block(basis, residual, row, column);
    }
  }
  Small N = problem.N;
  problem.B = problem.T;
  solve_in_place(N, problem.B, std::numeric_limits<double>::min());
  if (!problem.B.allFinite()) return false;
  Small H = problem.B;
  reduce_to_hessenberg(H);
  return hessenberg_eigenvalues(H, problem.values.data());
}

ComplexSmallVector eigenvector(const SmallProblem& problem, const Complex& value) {
  ComplexSmallVector x = ComplexSmallVector::Ones(problem.size);
  for (int k = 0; k < problem.size; ++k) x[k] += 0.1 * k;
  for (int step = 0; step < 3; ++step) {
    ComplexSmall shifted = problem.B.cast<Complex>();
    shifted.diagonal().array() -= value;
    solve_in_place(shifted, x, kEps * problem.B.norm());
    x /= x.norm();
  }
  return x;
}

/// Columns of both sign types that span what x and y span, or of type - alone if there is no y.
bool normalize(const SmallProblem& problem, const Small& vectors, Small& out) {
  const Small gram = vectors.transpose() * problem.N * vectors;
  const Eigen::SelfAdjointEigenSolver<Small> eigen(gram);
  const auto& lengths = eigen.eigenvalues();
  const Eigen::Index last = lengths.size() - 1;
  if (!(lengths[0] < -kNeutral)) return false;
  const SmallVector minus = vectors * eigen.eigenvectors().col(0) / std::sqrt(-lengths[0]);
  if (out.cols() == 1) {
    out.col(0) = minus;
    return true;
  }
  if (!(lengths[last] > kNeutral)) return false;
  out.col(0) = vectors * eigen.eigenvectors().col(last) / std::sqrt(lengths[last]);
  out.col(1) = minus;
  return true;
}

/// What is orthogonal to X, in the metric.
bool complement(const SmallProblem& problem, const Small& X, Small& out) {
  Small signs = X.transpose() * problem.N * X;  // nearly diag(1, -1) or -1
  for (Eigen::Index i = 0; i < signs.rows(); ++i) {
    for (Eigen::Index j = 0; j < signs.cols(); ++j) {
      signs(i, j) = i != j ? 0 : signs(i, i) > 0 ? 1 : -1;
    }
  }
  const Small projector =
      Small::Identity(problem.size, problem.size) - X * signs * X.transpose() * problem.N;
  return normalize(problem, projector, out);
}

/// Two eigenvalues that go together, or one of a zero mode, such that the rest go together as well
/// and lie no further apart: what is further apart has the better conditioned eigenvectors.
struct Choice {
  int first = -1, second = -1;
};

Choice choose(const SmallProblem& problem) {
  const int size = problem.size;
  const auto value = [&](int i) { return problem.values[static_cast<std::size_t>(i)]; };
  Choice pair, rest;
  double nearest = std::numeric_limits<double>::infinity();
  const bool any_complex = [&] {
    for (int i = 0; i < size; ++i) {
      if (value(i).imag() != 0) return true;
    }
    return false;
  }();
  std::array<double, 4> sign{};
  for (int i = 0; i < size && !any_complex; ++i) {
    const SmallVector x = eigenvector(problem, value(i)).real();
    sign[static_cast<std::size_t>(i)] = x.dot(problem.N * x);
  }
  for (int i = 0; i < size; ++i) {
    for (int j = i + 1; j < size; ++j) {
      const bool fits =
          any_complex ? value(i).imag() != 0 && value(i) == std::conj(value(j))
                      : sign[static_cast<std::size_t>(i)] * sign[static_cast<std::size_t>(j)] < 0;
      const double gap = modulus(value(i) - value(j));
      if (fits && gap < nearest) nearest = gap, pair = {i, j};
    }
  }
  for (int i = 0; i < size; ++i) {
    if (i == pair.first || i == pair.second) continue;
    (rest.first < 0 ? rest.first : rest.second) = i;
  }
  if (size == 2) return {0, -1};  // of two zero modes: either
  if (size == 3 || pair.first < 0) return rest;
  return modulus(value(rest.first) - value(rest.second)) >= nearest ? rest : pair;
}

/// The columns of the chosen eigenvalues.
bool solve_chosen(const SmallProblem& problem, const Choice& choice, Small& out) {
  const auto value = [&](int i) { return problem.values[static_cast<std::size_t>(i)]; };
  const ComplexSmallVector x = eigenvector(problem, value(choice.first));
  Small vectors(problem.size, choice.second < 0 ? 1 : 2);
  vectors.col(0) = x.real();
  out.resize(problem.size, vectors.cols());
  if (choice.second >= 0) {
    vectors.col(1) = value(choice.first).imag() != 0
                         ? SmallVector(x.imag())
                         : SmallVector(eigenvector(problem, value(choice.second)).real());
    vectors.col(1) /= vectors.col(1).norm();
  }
  vectors.col(0) /= vectors.col(0).norm();
  return vectors.allFinite() && normalize(problem, vectors, out);
}

}  // namespace

bool separate_blocks(const TrackedResidual& residual, const CloseBlocks& close,
                     BlockEigenbasis& basis) noexcept {
  SmallProblem problem;
  if (!pose(residual, close, basis, problem)) return false;
  const Choice choice = choose(problem);
  if (choice.first < 0) return false;
  Small X;
  if (!solve_chosen(problem, choice, X)) return false;
  Small Y(problem.size, problem.size - X.cols());
  if (!complement(problem, X, Y)) return false;
  // In the order of the columns: the first of the two blocks is a mode unless both are zero
  // modes.
  const Eigen::Index split = close.first < basis.modes ? 2 : 1;
  bool X_first = X.cols() == split;
  if (X.cols() == Y.cols()) {
    const double share = X.topRows(split).squaredNorm() / X.squaredNorm();
    X_first = share >= Y.topRows(split).squaredNorm() / Y.squaredNorm();
  }
  Small columns(problem.size, problem.size);
  columns << (X_first ? X : Y), (X_first ? Y : X);
  for (int row = 0; row < basis.columns(); ++row) {
    std::array<double, 4> z{};
    for (std::size_t j = 0; j < 4 && static_cast<int>(j) < problem.size; ++j) {
      z[j] = basis.Z(row, problem.columns[j]);
    }
    for (int j = 0; j < problem.size; ++j) {
      double sum = 0;
      for (int k = 0; k < problem.size; ++k) sum += columns(k, j) * z[static_cast<std::size_t>(k)];
      basis.Z(row, problem.columns[static_cast<std::size_t>(j)]) = sum;
    }
  }
  return true;
}

}  // namespace dashpot::analysis
