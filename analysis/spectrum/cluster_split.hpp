#pragma once
#include <dashpot/analysis/spectrum/modal_basis.hpp>
#include <dashpot/analysis/work.hpp>

namespace dashpot::analysis {

/// k complex numbers, k <= 2n
template <int N>
using ComplexStateVector = Eigen::Matrix<Complex, Eigen::Dynamic, 1, Eigen::ColMajor, kTwice<N>, 1>;

/// Returns an orthonormal basis (as many columns as `size`) of the invariant subspace of A to the
/// eigenvalues near `mean` and its conjugate, by subspace iteration with a real shift near the real
/// axis and a conjugate pair of shifts elsewhere. It takes `steps` steps, or as many as `work`
/// grants.
template <int N>
State<N> invariant_subspace(const State<N>& A, Complex mean, bool near_axis, Eigen::Index size,
                            int steps, Work& work) noexcept;

/// Columns W that make a small matrix block diagonal: small W = W Lambda. Unlike the blocks of a
/// ModalBasis none is a zero mode.
template <int N>
struct SplitCluster {
  State<N> columns, Lambda;
  BlockList<N> blocks;
};

/// Splits the matrix of a cluster, with the eigenvalues `values` (of complex pairs the upper half)
/// about `mean`, as far as that is well conditioned: into any orthonormal directions where all
/// eigenvalues coincide to rounding without being defective; else into eigenvectors, if they are
/// well apart; else into planes of two eigenvalues, which near critical damping are the modes, also
/// where several coincide; else not at all. With `coinciding` the latter come first.
template <int N>
SplitCluster<N> split_cluster(const State<N>& small, const ComplexStateVector<N>& values,
                              Complex mean, bool coinciding) noexcept;

}  // namespace dashpot::analysis
