#include <dashpot/analysis/linalg/small_dense.hpp>
#include <dashpot/analysis/tracker/cluster_separation.hpp>

#include <Eigen/Eigenvalues>
#include <algorithm>
#include <cmath>

namespace dashpot::analysis {
namespace {

/// Blocks whose trace and determinant agree to this, relative to their size, coincide.
constexpr double kCoinciding = 1e-10;
/// What is smaller than this, relative to the rest, has no direction.
constexpr double kNothing = 1e-8;

/// k x k, k <= 2 kMaxDof
using Cluster = Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, 0, kMaxWidth, kMaxWidth>;
using ClusterSolver = Eigen::SelfAdjointEigenSolver<Cluster>;

std::size_t at(int i) {
  return static_cast<std::size_t>(i);
}

bool coincide(const BlockEigenbasis& basis, int i, int j) {
  const auto trace = [&](int k) { return basis.l00[at(k)] + basis.l11[at(k)]; };
  const auto determinant = [&](int k) {
    return basis.l00[at(k)] * basis.l11[at(k)] - basis.l01[at(k)] * basis.l10[at(k)];
  };
  const double size = std::max(std::abs(trace(i)), std::sqrt(std::abs(determinant(i))));
  return std::abs(trace(i) - trace(j)) <= kCoinciding * size &&
         std::abs(determinant(i) - determinant(j)) <= kCoinciding * size * size;
}

/// The first and second columns of some modes, and the system in them.
struct Shared {
  int modes = 0;
  std::array<int, kMaxWidth> columns{};
  Cluster N, T, energy;
};

void pose(const BlockEigenbasis& basis, const TrackedResidual& residual, Shared& shared) {
  const int m = basis.modes, size = 2 * shared.modes;
  for (Cluster* matrix : {&shared.N, &shared.T, &shared.energy}) matrix->resize(size, size);
  for (int i = 0; i < size; ++i) {
    const int row = shared.columns[at(i)];
    const auto N = [&](int j) {
      return residual.R(row, j) + (row == j ? (row < m ? 1.0 : -1.0) : 0.0);
    };
    for (int j = 0; j < size; ++j) {
      const int column = shared.columns[at(j)], mode = column % m;
      const bool first = column < m;
      double T = residual.G(row, column);
      T += N(mode) * (first ? basis.l00[at(mode)] : basis.l01[at(mode)]);
      T += N(m + mode) * (first ? basis.l10[at(mode)] : basis.l11[at(mode)]);
      double kinetic = 0;
      for (int k = m; k < basis.columns(); ++k) {
        kinetic -= basis.Z(k, row) * residual.MV(k, column);
      }
      shared.N(i, j) = N(column);
      shared.T(i, j) = T;
      shared.energy(i, j) = N(column) + 2 * kinetic;
    }
  }
}

/// X with X' N X = diag(I, -I) and X' energy X diagonal, columns of type + first.
bool orthonormal_columns(const Shared& shared, Cluster& X) {
  const int k = shared.modes;
  const ClusterSolver energies(shared.energy);
  if (!(energies.eigenvalues()[0] > kNothing * energies.eigenvalues()[2 * k - 1])) return false;
  X = energies.eigenvectors();
  for (int j = 0; j < 2 * k; ++j) X.col(j) /= std::sqrt(energies.eigenvalues()[j]);
  const Cluster metric = X.transpose() * shared.N * X;
  const ClusterSolver types(metric);
  const auto& lengths = types.eigenvalues();
  if (!(lengths[k - 1] < -kNothing) || !(lengths[k] > kNothing)) return false;
  const Cluster rotated = X * types.eigenvectors();
  for (int j = 0; j < k; ++j) {
    X.col(j) = rotated.col(k + j) / std::sqrt(lengths[k + j]);
    X.col(k + j) = rotated.col(j) / std::sqrt(-lengths[j]);
  }
  return true;
}

/// Pairs them: with T = [A B; B' D], A is made diagonal, and B by rotating the columns of type -.
/// Of coinciding modes Lambda^2 - 2 a Lambda + w^2 = 0, so that D is diagonal then, too.
bool pair_columns(const Shared& shared, Cluster& X) {
  const int k = shared.modes;
  Cluster T = X.transpose() * shared.T * X;
  const Cluster A = T.topLeftCorner(k, k);
  const ClusterSolver elastic(A);
  Cluster rotated = X.leftCols(k) * elastic.eigenvectors();
  X.leftCols(k) = rotated;
  Cluster Q = T.bottomLeftCorner(k, k) * elastic.eigenvectors();
  const double size = Q.norm();
  for (int j = 0; j < k; ++j) {
    if (!(Q.col(j).norm() > kNothing * size)) return false;
  }
  orthonormalize(Q);
  rotated = X.rightCols(k) * Q;
  X.rightCols(k) = rotated;
  return X.allFinite();
}

void turn_columns(const std::array<int, kMaxWidth>& columns, const Cluster& X,
                  BlockEigenbasis& basis) {
  const auto size = static_cast<int>(X.cols());
  for (int row = 0; row < basis.columns(); ++row) {
    std::array<double, kMaxWidth> z{};
    for (int j = 0; j < size; ++j) z[at(j)] = basis.Z(row, columns[at(j)]);
    for (int j = 0; j < size; ++j) {
      double sum = 0;
      for (int k = 0; k < size; ++k) sum += z[at(k)] * X(k, j);
      basis.Z(row, columns[at(j)]) = sum;
    }
  }
}

}  // namespace

bool separate_coinciding(const TrackedResidual& residual, BlockEigenbasis& basis,
                         Work& work) noexcept {
  std::array<bool, kMaxDof> done{};
  bool any = false;
  for (int i = 0; i < basis.modes; ++i) {
    Shared shared;
    std::array<int, kMaxDof> members{};
    for (int j = i; j < basis.modes; ++j) {
      if (done[at(j)] || !coincide(basis, i, j)) continue;
      done[at(j)] = true;
      members[at(shared.modes++)] = j;
    }
    if (shared.modes < 2) continue;
    if (!work.take(cubed(2 * shared.modes, 60) + squared(2 * shared.modes, 300))) return any;
    for (int j = 0; j < shared.modes; ++j) {
      shared.columns[at(j)] = members[at(j)];
      shared.columns[at(shared.modes + j)] = basis.modes + members[at(j)];
    }
    pose(basis, residual, shared);
    Cluster X;
    if (!orthonormal_columns(shared, X) || !pair_columns(shared, X)) continue;
    turn_columns(shared.columns, X, basis);
    any = true;
  }
  return any;
}

bool separate_zero_modes(const TrackedResidual& residual, BlockEigenbasis& basis) noexcept {
  const int first = 2 * basis.modes, count = basis.zeros;
  Cluster T(count, count);
  std::array<int, kMaxWidth> columns{};
  for (int j = 0; j < count; ++j) {
    columns[at(j)] = first + j;
    for (int i = 0; i < count; ++i) {
      const double N = residual.R(first + i, first + j) - (i == j ? 1 : 0);
      T(i, j) = residual.G(first + i, first + j) + N * basis.rate[at(j)];
    }
  }
  const ClusterSolver rates(T);  // reads one triangle: T is symmetric but for rounding errors
  if (!rates.eigenvectors().allFinite()) return false;
  turn_columns(columns, rates.eigenvectors(), basis);
  return true;
}

}  // namespace dashpot::analysis
