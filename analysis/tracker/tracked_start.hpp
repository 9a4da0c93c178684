#pragma once
#include <dashpot/analysis/spectrum/spectrum_result.hpp>
#include <dashpot/analysis/tracker/tracked_basis.hpp>

namespace dashpot::analysis {

/// Builds a tracked basis from the basis of a direct solution: columns (W u, u Lambda), made
/// orthonormal in the indefinite metric block by block; real eigenvalues are paired as the modes of
/// `spectrum` are. Where a mode lost its stiffness (a singular arm), its strain is added, with a
/// zero mode's velocity as its partner. Returns false if no such basis is found: blocks of several
/// modes that cannot be parted, eigenvalues of equal sign type in one mode, a stiffness that is not
/// positive definite and came without a factor.
bool start_basis(const StateForm& form, const Spectrum<kMaxDof>& spectrum,
                 TrackedBasis& basis) noexcept;

/// Gives the modes of `basis` the places of those of `before` that they resemble: permutes columns
/// so that the sum of overlaps (modal assurance criterion in the energy metric, of the planes that
/// two modes span) is largest. Both bases have the same number of modes.
void keep_places(const StateForm& form, const TrackedBasis& before, TrackedBasis& basis) noexcept;

/// Moves mode i to place[i].
void move_modes(const std::array<int, kMaxDof>& place, TrackedBasis& basis) noexcept;

/// As keep_places, for modes known by their shapes alone: place[k] of mode k of `spectrum`. False,
/// and places by falling frequency, if there are not as many modes as in `before`.
bool find_places(const StateForm& form, const TrackedBasis& before,
                 const Spectrum<kMaxDof>& spectrum, std::array<int, kMaxDof>& place) noexcept;

/// Makes the columns of `basis` the planes of the modes of `spectrum`, mode k in place[k]: to be
/// compared with what is found next, not to be followed.
void keep_planes(const StateForm& form, const Spectrum<kMaxDof>& spectrum,
                 const std::array<int, kMaxDof>& place, TrackedBasis& basis) noexcept;

/// Hyperbolic rotation of each block that makes its two columns orthogonal in the energy metric
/// diag(I, M) as well, so that the basis stays as well conditioned as it can be. Blocks that are
/// orthogonal to `tolerance` already are left alone; returns whether any was rotated. The defect is
/// one of this basis, or nearly.
bool balance(const TrackedDefect& defect, double tolerance, TrackedBasis& basis) noexcept;

/// Of each mode's hyperbolic rotation.
using PlaneAngles = std::array<double, kMaxDof>;

/// Whether each mode's plane is that of one strain and one velocity, as it is if the undamped modes
/// decouple the damping; and the rotations that make its columns so. The defect is one of this
/// basis.
bool has_pure_planes(const TrackedDefect& defect, const TrackedBasis& basis,
                     PlaneAngles& angles) noexcept;

/// Rotates, and leaves out what little mixing there is (see TrackedBasis::proportional). Returns
/// false, and leaves `basis` as it was, if it is not little.
bool make_proportional(const PlaneAngles& angles, TrackedBasis& basis) noexcept;

}  // namespace dashpot::analysis
