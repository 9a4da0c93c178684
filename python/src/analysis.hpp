#pragma once
#include <dashpot/analysis/damping_target.hpp>
#include <dashpot/analysis/sampled_loop.hpp>
#include <dashpot/analysis/spectrum.hpp>
#include <dashpot/python/src/convert.hpp>

namespace dashpot::python {

/// Returns the entries of dashpot.Modes.
nb::dict modes_of(const analysis::Spectrum<>& spectrum);
/// Returns the entries of dashpot.SampledModes without gain margin and continuous modes.
nb::dict sampled_modes_of(const analysis::SampledSpectrum& sampled);

/// Returns the structure of a name; throws std::invalid_argument for another name.
analysis::DampingStructure structure_of(const std::string& name);

}  // namespace dashpot::python
