#pragma once
#include <dashpot/analysis/sampled_loop.hpp>
#include <dashpot/analysis/spectrum.hpp>
#include <dashpot/python/src/convert.hpp>

namespace dashpot::python {

/// Returns the entries of dashpot.Modes.
nb::dict modes_of(const analysis::Spectrum<>& spectrum);
/// Returns the entries of dashpot.SampledModes but for the gain margin and the continuous modes.
nb::dict sampled_modes_of(const analysis::SampledSpectrum& sampled);

}  // namespace dashpot::python
