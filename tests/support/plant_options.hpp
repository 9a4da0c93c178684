#pragma once
#include <dashpot/analysis/sampled_loop.hpp>
#include <dashpot/sim/plant.hpp>

#include <algorithm>

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

/// Growth of a size from the first to the last tenth of the ticks.
template <class Step>
double growth(int ticks, const Step& step) {
  double first = 0, last = 0;
  for (int k = 0; k < ticks; ++k) {
    const double size = step();
    if (k < ticks / 10) first = std::max(first, size);
    if (k >= ticks - ticks / 10) last = std::max(last, size);
  }
  return last / first;
}

}  // namespace dashpot::testing
