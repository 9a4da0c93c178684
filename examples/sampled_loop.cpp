// The effect of a zero-order hold on a mode: a mass of 1 kg on a spring and a damper that a
// computer imitates every 10 ms.
#include <cstdio>
#include <dashpot/analysis/sampled_loop.hpp>
#include <dashpot/analysis/spectrum.hpp>

using namespace dashpot::analysis;

int main() {
  System<> system(1);
  system.mass << 1;         // kg
  system.damping << 20;     // N s/m
  system.stiffness << 400;  // N/m
  const Spectrum<> spectrum = analyze(system);
  SampledLoop loop;
  loop.period = 0.01;  // s
  const SampledSpectrum sampled = sample_loop(system, spectrum, loop);
  std::printf("continuous: %.3f rad/s, damping ratio %.4f\n", spectrum.modes[0].natural_frequency,
              spectrum.modes[0].damping_ratio);
  std::printf("sampled:    %.3f rad/s, damping ratio %.4f\n", sampled.modes[0].natural_frequency,
              sampled.modes[0].damping_ratio);
  std::printf("gains may grow %.3f times\n", gain_margin(system, spectrum, loop));
}
