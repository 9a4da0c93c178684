#pragma once
#include <dashpot/analysis/sampled_loop.hpp>
#include <dashpot/sim/plant.hpp>

namespace dashpot::testing {

/// A simulated robot behind the drives that the analysis of a sampled loop supposes, with one step
/// of the integrator in a period.
inline sim::PlantOptions plant_options(const analysis::SampledLoop& loop) {
  sim::PlantOptions options;
  options.period = loop.period;
  options.integrator.max_step = loop.period;
  options.delay = loop.delay;
  options.torque_cutoff = loop.torque_cutoff;
  options.difference_velocity = loop.difference_velocity;
  return options;
}

}  // namespace dashpot::testing
