#pragma once
// Systems and loops of a controller that samples, drawn by chance.

#include <dashpot/analysis/sampled_loop.hpp>
#include <dashpot/analysis/spectrum.hpp>
#include <dashpot/tests/support/random.hpp>

#include <vector>

namespace dashpot::testing {

inline analysis::System<> random_system(Dice& random, Eigen::Index n) {
  analysis::System<> system(n);
  system.mass = random.spd(n);
  system.stiffness = 1000 * random.spd(n);
  system.damping = random.log_uniform(1, 10) * random.spd(n);
  return system;
}

inline analysis::SampledSpectrum sample(const analysis::System<>& system,
                                        const analysis::SampledLoop& loop) {
  return sample_loop(system, analysis::analyze(system), loop);
}

inline analysis::SampledLoop random_loop(Dice& random) {
  analysis::SampledLoop loop;
  loop.period = random.log_uniform(1e-4, 5e-3);
  loop.delay = random.integer(0, 3);
  loop.torque_cutoff = random.integer(0, 1) * random.log_uniform(50, 500);
  loop.difference_velocity = random.integer(0, 1) == 1;
  return loop;
}

/// Ticks that the torque of a command depends on beside the present one.
inline Eigen::Index memory_of(const analysis::SampledLoop& loop) {
  return loop.delay + (loop.torque_cutoff > 0 ? 1 : 0) + (loop.difference_velocity ? 1 : 0);
}

/// All discrete eigenvalues.
inline std::vector<analysis::Complex> all_multipliers(const analysis::SampledSpectrum& sampled) {
  std::vector<analysis::Complex> all = sampled.others;
  all.insert(all.end(), sampled.zero_modes.begin(), sampled.zero_modes.end());
  all.insert(all.end(), sampled.memory.begin(), sampled.memory.end());
  for (const analysis::SampledMode& mode : sampled.modes) {
    all.insert(all.end(), mode.discrete_eigenvalues.begin(), mode.discrete_eigenvalues.end());
  }
  return all;
}

}  // namespace dashpot::testing
