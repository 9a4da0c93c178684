#pragma once
#include <dashpot/analysis/spectrum/spectrum_result.hpp>
#include <dashpot/analysis/tracker/block_eigenbasis.hpp>

namespace dashpot::analysis {

/// Builds a tracked basis from the basis of a direct solution: columns (W u, u Lambda), made
/// orthonormal in the indefinite metric block by block; real eigenvalues are paired as the modes of
/// `spectrum` are. Where a mode lost its stiffness (a singular arm), its elastic coordinate is
/// added, with a zero mode's velocity as its partner. Returns false if no such basis is found:
/// blocks of several modes that cannot be parted, eigenvalues of equal sign type in one mode, a
/// stiffness that is not positive definite and came without a factor.
bool start_basis(const SymmetricPencil& pencil, const Spectrum<kMaxDof>& spectrum,
                 BlockEigenbasis& basis) noexcept;

/// Matches the modes of `basis` to the modes of `before` that they resemble: permutes columns
/// so that the sum of overlaps (modal assurance criterion in the energy metric, of the planes that
/// two modes span) is largest. Both bases have the same number of modes.
void match_modes(const SymmetricPencil& pencil, const BlockEigenbasis& before,
                 BlockEigenbasis& basis) noexcept;

/// Moves mode i to index[i].
void permute_modes(const std::array<int, kMaxDof>& index, BlockEigenbasis& basis) noexcept;

/// As match_modes, for modes known by their shapes alone: index[k] of mode k of `spectrum`. False,
/// and indices by falling frequency, if there are not as many modes as in `before`.
bool match_shapes(const SymmetricPencil& pencil, const BlockEigenbasis& before,
                  const Spectrum<kMaxDof>& spectrum, std::array<int, kMaxDof>& index) noexcept;

/// Makes the columns of `basis` the planes of the modes of `spectrum`, mode k in index[k]: to be
/// compared with what is found next, not to be followed.
void set_planes(const SymmetricPencil& pencil, const Spectrum<kMaxDof>& spectrum,
                const std::array<int, kMaxDof>& index, BlockEigenbasis& basis) noexcept;

/// Hyperbolic rotation of each block that makes its two columns orthogonal in the energy metric
/// diag(I, M) as well, so that the basis stays as well conditioned as it can be. Blocks that are
/// orthogonal to `tolerance` already are left alone; returns whether any was rotated. The residual
/// is one of this basis, or nearly.
bool rotate_hyperbolically(const TrackedResidual& residual, double tolerance,
                           BlockEigenbasis& basis) noexcept;

/// Of each mode's hyperbolic rotation.
using HyperbolicAngles = std::array<double, kMaxDof>;

/// Whether each mode's plane is that of one elastic coordinate and one velocity, as it is if the
/// undamped modes decouple the damping; and the rotations that make its columns so. The residual is
/// one of this basis.
bool decouples_damping(const TrackedResidual& residual, const BlockEigenbasis& basis,
                       HyperbolicAngles& angles) noexcept;

/// Rotates, and leaves out what little coupling_norm there is (see BlockEigenbasis::proportional).
/// Returns false, and leaves `basis` as it was, if it is not little.
bool make_proportional(const HyperbolicAngles& angles, BlockEigenbasis& basis) noexcept;

}  // namespace dashpot::analysis
