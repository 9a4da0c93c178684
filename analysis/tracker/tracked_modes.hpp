#pragma once
#include <dashpot/analysis/tracked_spectrum.hpp>
#include <dashpot/analysis/tracker/tracked_certificate.hpp>

namespace dashpot::analysis {

/// Reads eigenvalues, frequencies, ratios, kinds and bounds off a certified basis, and sorts them.
/// `soft` says of each mode whether it was soft before, and is brought up to date.
void read_numbers(const TrackedBasis& basis, const TrackedCertificate& certificate,
                  double soft_frequency, std::array<bool, kMaxDof>& soft,
                  TrackedSpectrum& out) noexcept;

/// Fills out.by_frequency.
void sort_by_frequency(TrackedSpectrum& out) noexcept;

/// Eigenvectors from the velocity rows V (n) of Z (I + E); M V goes to `momenta`.
void read_shapes(const StateForm& form, const TrackedBasis& basis, const PaddedRows& E,
                 const PaddedRows& velocities, PaddedRows& momenta, TrackedSpectrum& out) noexcept;

}  // namespace dashpot::analysis
