#pragma once
#include <dashpot/analysis/tracked_spectrum.hpp>
#include <dashpot/analysis/tracker/tracked_enclosure.hpp>

namespace dashpot::analysis {

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
