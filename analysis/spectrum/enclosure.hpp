#pragma once
#include <dashpot/analysis/spectrum/refinement.hpp>

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
};

/// Adds the diagonal blocks of F to Lambda, and bounds the remaining error.
///
/// Stewart (SIAM Review 15(4), 1973): a matrix [A11+E11 E12; E21 A22+E22] with
/// delta = sep(A11, A22) - |E11| - |E22| > 0 and 4 |E12| |E21| < delta^2 has an invariant subspace
/// on which it acts as A11 + E11 + E12 P with |P| <= 2 |E21| / delta. Here A11 is a block, or a
/// group of blocks with close eigenvalues, and the E are |F| + F_error, in columns scaled to unit
/// weight. The condition then holds for every t E, 0 <= t <= 1, too. As t grows, the eigenvalues of
/// a group never meet the other eigenvalues, and so no eigenvalue counts for two groups.
template <int N>
void enclose(const BasisResidual<N>& residual, ModalBasis<N>& basis,
             BlockEnclosure<N>& enclosure) noexcept;

/// Returns the radius (1/s) of a disc around eigenvalue `which` of one block: every eigenvalue of
/// any matrix within `radius` (spectral norm) of the block lies in the union of these discs.
/// `eigenvalues` holds all `count` eigenvalues of the block. `block_norm` is at least its spectral
/// norm.
double disc_radius(const Complex* eigenvalues, int count, int which, double block_norm,
                   double radius) noexcept;

}  // namespace dashpot::analysis
