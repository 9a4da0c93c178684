// Three masses joined by springs and dampers, free to drift together: modes, each with a proved
// bound of its error. The system comes from Fig. 2 of Kao and Saldarriaga (2021).
#include <cmath>
#include <cstdio>
#include <dashpot/analysis/spectrum.hpp>

using namespace dashpot::analysis;

int main() {
  System<> system(3);                                          // M q'' + C q' + K q = 0
  system.mass << 8, 0, 0, 0, 2, 0, 0, 0, 5;                    // kg
  system.damping << 25, -15, -10, -15, 35, -20, -10, -20, 30;  // N s/m
  system.stiffness << 3600, -1200, -2400, -1200, 2700, -1500, -2400, -1500, 3900;  // N/m
  const Spectrum<> spectrum = analyze(system);  // throws if the matrices are invalid
  for (const Mode<>& mode : spectrum.modes) {
    std::printf("%.2f rad/s, damping ratio %.4f, %s\n", mode.natural_frequency, mode.damping_ratio,
                to_text(mode.kind));
    if (!(mode.error_bound < 1e-10)) return 1;  // 1/s, of its eigenvalues
  }
  std::printf("%d zero mode: ", spectrum.zero_modes.count);
  for (const double entry : spectrum.zero_modes.basis.col(0)) std::printf(" %.4f", std::abs(entry));
  std::printf("\n");
}
