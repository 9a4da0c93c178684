#pragma once
#include <dashpot/analysis/linalg/invariant_subspaces.hpp>
#include <dashpot/analysis/spectrum/modal_basis.hpp>

namespace dashpot::analysis {

/// Columns that make a small matrix block diagonal. Unlike the blocks of a ModalBasis none is a
/// zero mode.
template <int N>
struct SplitCluster : Separation<N> {
  BlockList<N> blocks;
};

/// Splits the matrix of a cluster, with the eigenvalues `values` (of complex pairs the upper half)
/// about `mean`, as far as that is well conditioned: into any orthonormal directions where all
/// eigenvalues coincide to rounding without being defective; else into eigenvectors and planes of
/// conjugate eigenvalues, if they are well apart; else into planes of two eigenvalues, which near
/// critical damping are the modes, also where several coincide; else not at all. With `coinciding`
/// the latter come first.
template <int N>
SplitCluster<N> split_cluster(const State<N>& small, const ComplexStateVector<N>& values,
                              Complex mean, bool coinciding) noexcept;

}  // namespace dashpot::analysis
