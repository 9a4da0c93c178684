#pragma once
#include <dashpot/analysis/spectrum/enclosure.hpp>
#include <dashpot/analysis/spectrum/spectrum_result.hpp>

namespace dashpot::analysis {

/// Reads the modes from a basis with proved bounds: eigenvalues and shapes of every block, pairs of
/// real eigenvalues, frequencies, ratios, kinds, bounds, backward errors. Fills spectrum.modes and
/// zero_mode_rates from spectrum.basis and zero_modes. The modes are sorted by falling sqrt|l1 l2|,
/// which is the natural frequency of a mode that has one. `soft_frequency` in rad/s.
template <int N>
void read_modes(const System<N>& system, const BasisResidual<N>& residual,
                const BlockEnclosure<N>& enclosure, double soft_frequency,
                Spectrum<N>& spectrum) noexcept;

}  // namespace dashpot::analysis
