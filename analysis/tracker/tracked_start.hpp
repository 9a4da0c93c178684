#pragma once
#include <dashpot/analysis/spectrum/spectrum_result.hpp>
#include <dashpot/analysis/tracked_spectrum.hpp>
#include <dashpot/analysis/tracker/block_eigenbasis.hpp>
#include <dashpot/analysis/tracker/tracked_enclosure.hpp>

namespace dashpot::analysis {

/// Sets K = W'W of the factor with about 32 digits, as stiffness and its low word, and adds what
/// these lack at most to stiffness_error.
void form_stiffness(System<kMaxDof>& system) noexcept;

/// Builds a basis from the basis of a direct solution, in the order of the modes of `spectrum`,
/// with its residual before the last rotation of its blocks. It has one side if the system is
/// symmetric and its K has a factor or is positive definite: columns (W u, u Lambda), made
/// orthonormal in the indefinite metric mode by mode. Where a mode lost its stiffness (a singular
/// arm), its elastic coordinate is added, with a zero mode's velocity as its partner. Returns false
/// if no such basis is found, because of blocks of several modes that cannot be separated,
/// eigenvalues of equal sign characteristic in one mode, or zero modes that are not real.
bool start_basis(const SymmetricPencil& pencil, const Spectrum<kMaxDof>& spectrum, bool symmetric,
                 TrackedResidual& residual, BlockEigenbasis& basis) noexcept;

/// Reads eigenvalues, frequencies, ratios, kinds and bounds from a basis with proved bounds, and
/// sorts them. `soft` says for each mode whether it was soft before, and is updated. The still
/// blocks of a two-sided basis become zero modes. Returns false if one of them has a frequency well
/// above the floor, or without a factor another mode has one below it.
bool read_numbers(const BlockEigenbasis& basis, const TrackedEnclosure& enclosure,
                  double soft_frequency, std::array<bool, kMaxDof>& soft,
                  TrackedSpectrum& out) noexcept;

/// Fills out.order.
void sort_by_frequency(TrackedSpectrum& out) noexcept;

/// Computes eigenvectors from a basis whose last step was E. Its blocks belong to the basis before
/// that step. Writes M V to `momenta`, with the velocity rows V (n) of the basis.
void read_shapes(const SymmetricPencil& pencil, bool symmetric, const BlockEigenbasis& basis,
                 const PackedMatrix& E, PackedMatrix& momenta, TrackedSpectrum& out) noexcept;

/// Computes the slopes of the shapes from their definition; without symmetry they are zero.
void read_slopes(const SymmetricPencil& pencil, bool symmetric, TrackedSpectrum& out) noexcept;

}  // namespace dashpot::analysis
