#pragma once
#include <dashpot/analysis/spectrum/spectrum_result.hpp>
#include <dashpot/analysis/tracker/block_eigenbasis.hpp>

namespace dashpot::analysis {

/// Builds a tracked basis from the basis of a direct solution: columns (W u, u Lambda), made
/// orthonormal in the indefinite metric block by block. Real eigenvalues are paired as in the modes
/// of `spectrum`. Where a mode lost its stiffness (a singular arm), its elastic coordinate is
/// added, with a zero mode's velocity as its partner. Returns false if no such basis is found,
/// because of blocks of several modes that cannot be separated, eigenvalues of equal sign
/// characteristic in one mode, or a stiffness that is not positive definite and has no factor.
bool start_basis(const SymmetricPencil& pencil, const Spectrum<kMaxDof>& spectrum,
                 BlockEigenbasis& basis) noexcept;

/// Matches the modes of `basis` to the modes of `before` that they resemble: permutes columns
/// so that the sum of overlaps (modal assurance criterion in the energy metric, of the planes that
/// two modes span) is largest. Both bases have the same number of modes.
void match_modes(const SymmetricPencil& pencil, const BlockEigenbasis& before,
                 BlockEigenbasis& basis) noexcept;

/// Moves mode i to index[i].
void permute_modes(const std::array<int, kMaxDof>& index, BlockEigenbasis& basis) noexcept;

/// Does the same as match_modes for modes known by their shapes alone: index[k] is the index of
/// mode k of `spectrum`. Returns false, and indices by falling frequency, if there are not as many
/// modes as in `before`.
bool match_shapes(const SymmetricPencil& pencil, const BlockEigenbasis& before,
                  const Spectrum<kMaxDof>& spectrum, std::array<int, kMaxDof>& index) noexcept;

/// Makes the columns of `basis` the planes of the modes of `spectrum`, mode k at index[k]. Such a
/// basis serves only for matching later modes, not as a start for Newton's method.
void set_planes(const SymmetricPencil& pencil, const Spectrum<kMaxDof>& spectrum,
                const std::array<int, kMaxDof>& index, BlockEigenbasis& basis) noexcept;

/// Rotates each block hyperbolically so that its two columns become orthogonal in the energy metric
/// diag(I, M) as well, which keeps the basis as well conditioned as it can be. Blocks that are
/// orthogonal to `tolerance` already are left alone. Returns true if any block was rotated. The
/// residual belongs to this basis, at least nearly.
bool rotate_hyperbolically(const TrackedResidual& residual, double tolerance,
                           BlockEigenbasis& basis) noexcept;

/// Angle of each mode's hyperbolic rotation.
using HyperbolicAngles = std::array<double, kMaxDof>;

/// True if each mode's plane is the plane of one elastic coordinate and one velocity, as it is if
/// the undamped modes decouple the damping. `angles` then holds the rotations that give the columns
/// this form. The residual belongs to this basis.
bool decouples_damping(const TrackedResidual& residual, const BlockEigenbasis& basis,
                       HyperbolicAngles& angles) noexcept;

/// Rotates by `angles`, and leaves out the small remaining coupling_norm (see
/// BlockEigenbasis::proportional). Returns false, and does not change `basis`, if the coupling_norm
/// is not small.
bool make_proportional(const HyperbolicAngles& angles, BlockEigenbasis& basis) noexcept;

}  // namespace dashpot::analysis
