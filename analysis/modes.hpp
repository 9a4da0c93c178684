#pragma once
#include <dashpot/analysis/certificate.hpp>
#include <dashpot/analysis/spectrum.hpp>

namespace dashpot::analysis {

/// Reads the modes off a certified basis: eigenvalues and shapes of every block, pairs of real
/// eigenvalues, frequencies, ratios, kinds, bounds, backward errors; sorted by falling frequency.
/// Fills spectrum.modes, mode_count and zero_mode_rates from spectrum.basis and zero_modes.
template <int N>
void read_modes(const System<N>& system, const Defect<N>& defect, const Certificate<N>& certificate,
                double soft_frequency, Spectrum<N>& spectrum) noexcept;

/// How good a spectrum is, at its worst mode.
struct Quality {
  double bound = 0;  ///< error bound relative to the size of the mode's eigenvalues
  double backward_error = 0;
};
template <int N>
Quality worst_quality(const Spectrum<N>& spectrum) noexcept;

}  // namespace dashpot::analysis
