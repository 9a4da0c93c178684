// Two masses of 1 kg on springs that become stiffer from call to call: the tracker refines the
// modes of the last call, and every mode keeps its index.
#include <cstdio>
#include <dashpot/analysis/mode_tracker.hpp>

using namespace dashpot::analysis;

int main() {
  System<kMaxDof> system(2);
  ModeTracker tracker;
  TrackedSpectrum spectrum;
  for (int tick = 0; tick <= 1000; ++tick) {
    const double k = 100 + 0.1 * tick;  // N/m, of each of the two springs
    system.stiffness << 2 * k, -k, -k, k;
    system.damping = 0.002 * system.stiffness;
    if (tracker.update(system, spectrum) != Status::kOk) return 1;
    if (tick % 500 != 0) continue;
    std::printf("%.0f N/m:", k);
    for (int i = 0; i < spectrum.mode_count; ++i) {
      std::printf("  %.4f rad/s, ratio %.5f", spectrum.modes[i].natural_frequency,
                  spectrum.modes[i].damping_ratio);
    }
    std::printf("\n");
  }
  std::printf("solved directly: %d of 1001\n", static_cast<int>(tracker.counters().direct));
}
