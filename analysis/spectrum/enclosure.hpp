#pragma once
#include <dashpot/analysis/base/arithmetic.hpp>
#include <dashpot/analysis/spectrum/mode_numbers.hpp>
#include <dashpot/analysis/spectrum/refinement.hpp>

#include <algorithm>
#include <cmath>

namespace dashpot::analysis {

/// Proved distance of each block of Lambda (its diagonal part of F added) from an exact invariant
/// block of the system.
template <int N = kDynamic>
struct BlockEnclosure {
  /// For each block, 1/s: the exact system is similar to one whose block (of the group that the
  /// block belongs to) differs from Lambda's block by at most this. The norm is the Frobenius norm
  /// for a block that is a group by itself, and the spectral norm for a group of several. Infinite
  /// if nothing can be proved.
  StateVector<N> radius;
  /// For each block: its group, named by the index of one of its blocks. Blocks that cannot be
  /// separated from each other form a group and share a radius.
  Eigen::Matrix<int, Eigen::Dynamic, 1, Eigen::ColMajor, kTwice<N>, 1> group;

  /// Makes each of `count` blocks a group of which nothing is proved.
  void reset(int count) {
    radius.setConstant(count, kInfinity);
    group.resize(count);
    for (int i = 0; i < count; ++i) group[i] = i;
  }
  /// True if the block is a group by itself.
  bool alone(int block) const { return (group.array() == group[block]).count() == 1; }
};

/// What is known of the perturbation F of a block-diagonal matrix Lambda. Matrices have a row and a
/// column for each block. Frobenius norms belong to columns scaled as the caller likes, 1/s.
template <class Matrix, class Vector>
struct PerturbationBounds {
  const Matrix& coupling2;   ///< off the diagonal: bounds of the squared norms of blocks of F
  const Matrix& separation;  ///< off the diagonal: lower bounds of sep(Lambda_i, Lambda_j)
  const Vector& own;         ///< bounds of the norms of the diagonal blocks of F
};

/// The radius of the group `i` of `groups`, whose own perturbation is at most `inner`, where F has
/// entries of many sizes, each of which counts only where it acts; infinite if nothing is proved.
///
/// The invariant subspace [1; X] solves, for each block j that is not of the group,
///     (A_j + F_jj) X_j - X_j (A_i + F_ii) = -F_ji - sum F_jk X_k + X_j sum F_ik X_k.
/// If numbers x_j have
///     (sep(A_i, A_j) - |F_ii| - |F_jj|) x_j >= |F_ji| + sum |F_jk| x_k + 2 x_j sum |F_ik| x_k,
/// then the matrices with |X_j| <= x_j are mapped into themselves, and hold a solution (Brouwer).
/// Because of the 2 the eigenvalues of the group do not meet the others, for every t F.
template <int N, class Matrix, class Vector, class Groups>
double graded_radius(const PerturbationBounds<Matrix, Vector>& bounds, const Groups& groups, int i,
                     double inner) noexcept {
  constexpr int kTries = 4;
  constexpr double kLeast = 1e-290;  // of |F_ji|: all x_j are positive
  const auto count = static_cast<int>(groups.size());
  const auto inside = [&](int k) { return groups[k] == i; };
  // For each block j outside: |F_ji|, |F_ij|, and the factor of x_j on the left.
  StateVector<N> F_ji = StateVector<N>::Zero(count), F_ij = F_ji, gap = F_ji, x = F_ji;
  for (int j = 0; j < count; ++j) {
    if (inside(j)) continue;
    double to2 = 0, from2 = 0, separation = kInfinity;
    for (int k = 0; k < count; ++k) {
      if (!inside(k)) continue;
      to2 += bounds.coupling2(j, k);
      from2 += bounds.coupling2(k, j);
      const double apart = bounds.separation(k, j);
      separation = apart < separation ? apart : apart >= separation ? separation : 0;  // 0 for NaN
    }
    F_ji[j] = std::sqrt(to2) + kLeast;
    F_ij[j] = std::sqrt(from2);
    gap[j] = (2 - kSlack) * separation - kSlack * (inner + bounds.own.data()[j]);
    if (!(gap[j] > 0)) return kInfinity;
    x[j] = 2 * F_ji[j] / gap[j];
  }
  for (int tries = 0; tries < kTries; ++tries) {
    const double back = F_ij.dot(x);
    bool fits = true;
    StateVector<N> wider = x;
    for (int j = 0; j < count; ++j) {
      if (inside(j)) continue;
      double need = F_ji[j] + 2 * x[j] * back;
      for (int k = 0; k < count; ++k) {
        if (k != j && !inside(k)) need += std::sqrt(bounds.coupling2(j, k)) * x[k];
      }
      fits &= kSlack * need <= gap[j] * x[j];
      wider[j] = std::max(x[j], 2 * need / gap[j]);
    }
    if (fits) return kSlack * (inner + back);
    x = wider;
  }
  return kInfinity;
}

/// Finds the radius of each block, in an enclosure that was reset.
///
/// Stewart (SIAM Review 15(4), 1973): a matrix [A11+E11 E12; E21 A22+E22] with
/// delta = sep(A11, A22) - |E11| - |E22| > 0 and 4 |E12| |E21| < delta^2 has an invariant subspace
/// on which it acts as A11 + E11 + E12 P with |P| <= 2 |E21| / delta. Here A11 is a block, or a
/// group of blocks with close eigenvalues, and the E are parts of F. The condition then holds for
/// every t E, 0 <= t <= 1, too. As t grows, the eigenvalues of a group never meet the other
/// eigenvalues, and so no eigenvalue counts for two groups.
///
/// Rounding errors: the slack of the radius covers what is small beside it or beside delta. The
/// slack of |E22| covers the rest of delta, because |E22| >= |E11|, and where |E22| is below 1e-6
/// of the separation, delta has no cancellation. At the border of the condition |E22| > delta / 2,
/// whose slack is more than the rounding errors of the condition.
template <int N, class Matrix, class Vector>
void prove(const PerturbationBounds<Matrix, Vector>& bounds,
           BlockEnclosure<N>& enclosure) noexcept {
  const auto own_of = [&bounds](int i) { return bounds.own.data()[i]; };
  const auto count = static_cast<int>(enclosure.group.size());
  double everything2 = 0, largest = 0;  // F as a whole stands for E22
  for (int i = 0; i < count; ++i) {
    largest = std::max(largest, own_of(i));
    for (int j = 0; j < count; ++j) everything2 += i == j ? 0 : bounds.coupling2(i, j);
  }
  const double everything = kSlack * (std::sqrt(everything2) + largest);
  for (int i = 0; i < count; ++i) {
    for (bool proved = enclosure.group[i] != i; !proved;) {
      double own = 0, inner2 = 0, right2 = 0, left2 = 0;
      double separation = kInfinity;
      int nearest = -1;
      for (int j = 0; j < count; ++j) {
        if (enclosure.group[j] != i) continue;
        own = std::max(own, own_of(j));
        for (int k = 0; k < count; ++k) {
          if (k == j) continue;
          if (enclosure.group[k] == i) {
            inner2 += bounds.coupling2(j, k);
            continue;
          }
          right2 += bounds.coupling2(j, k);
          left2 += bounds.coupling2(k, j);
          const double apart = std::max(0.0, bounds.separation(j, k));  // 0 if not a number
          if (apart < separation || nearest < 0) separation = apart, nearest = k;
        }
      }
      const double inner = own + std::sqrt(inner2);
      const double product = std::sqrt(right2) * std::sqrt(left2);
      const double delta = separation - inner - everything;
      const bool simple = nearest < 0 || (delta > 0 && 4 * product < delta * delta);
      double radius = kInfinity;
      if (simple) {
        radius = kSlack * (nearest < 0 ? inner : inner + 2 * product / delta);
      } else if (everything > 0.5 * separation) {  // F as a whole is too much for it
        radius = graded_radius<N>(bounds, enclosure.group, i, inner);
      }
      if (simple || std::isfinite(radius)) {
        for (int j = 0; j < count; ++j) {
          if (enclosure.group[j] == i && radius >= 0) enclosure.radius[j] = radius;
        }
        proved = true;
        continue;
      }
      const int absorbed = enclosure.group[nearest];
      for (int j = 0; j < count; ++j) {
        if (enclosure.group[j] == absorbed) enclosure.group[j] = i;
      }
    }
  }
}

/// Adds the diagonal blocks of F to Lambda, and bounds the remaining error.
template <int N>
void enclose(const BasisResidual<N>& residual, ModalBasis<N>& basis,
             BlockEnclosure<N>& enclosure) noexcept;

/// Returns the radius (1/s) of a disc around eigenvalue `which` of one block: every eigenvalue of
/// any matrix within `radius` (spectral norm) of the block lies in the union of these discs.
/// `eigenvalues` holds all `count` eigenvalues of the block. `block_norm` is at least its spectral
/// norm.
double disc_radius(const Complex* eigenvalues, int count, int which, double block_norm,
                   double radius) noexcept;

/// An eigenvalue of a block.
struct BlockRoot : Root {
  int block = 0;
  double radius = 0;  ///< of its disc, 1/s
  int united = 0;     ///< a root whose disc is in the same union
};

/// Sets the bound of each of `count` roots. Where discs of one group meet, all that is known is how
/// many eigenvalues their union holds: the bound is then the distance of the farthest point of the
/// union. `groups` holds the group of each block. (Radii have slack for the comparison.)
template <class BlockRoots, class Groups>
void bound_roots(BlockRoots* roots, int count, const Groups& groups) noexcept {
  bool any = false;
  for (int i = 0; i < count; ++i) {
    BlockRoot& root = roots[i];
    root.united = i;
    root.bound = root.radius;
    for (int j = 0; j < i; ++j) {
      const BlockRoot& other = roots[j];
      if (groups.data()[root.block] != groups.data()[other.block] || root.united == other.united)
        continue;
      if (modulus(root.value - other.value) > root.radius + other.radius) continue;
      any = true;
      const int from = root.united, to = other.united;
      for (int k = 0; k <= i; ++k) {
        if (roots[k].united == from) roots[k].united = to;
      }
    }
  }
  for (int i = 0; i < count; ++i) {
    for (int j = 0; any && j < count; ++j) {
      if (roots[i].united != roots[j].united) continue;
      const double farthest = modulus(roots[i].value - roots[j].value) + roots[j].radius;
      roots[i].bound = std::max(roots[i].bound, kSlack * farthest);
    }
  }
}

}  // namespace dashpot::analysis
