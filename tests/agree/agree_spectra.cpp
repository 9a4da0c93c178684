// Prints the numbers of a fixed set of spectra, one a line with its kind and name, in
// full: what builds by different compilers have to agree on (./run agree).
#include <dashpot/analysis/mode_tracker.hpp>
#include <dashpot/analysis/spectrum.hpp>
#include <dashpot/tests/agree/agree_numbers.hpp>
#include <dashpot/tests/support/panda_path.hpp>

#include <memory>
#include <string>

namespace {

using namespace dashpot;  // NOLINT(google-build-using-namespace)
using agree::print;

void print_mode(const std::string& name, const analysis::ModeNumbers& mode) {
  print("tracked_frequency", name + ".frequency", mode.natural_frequency);
  print("tracked_ratio", name + ".ratio", mode.damping_ratio);
}

void spectra() {
  analysis::SpectrumSolver<analysis::kMaxDof> solver;
  analysis::Spectrum<analysis::kMaxDof> spectrum;
  const auto tracker = std::make_unique<analysis::ModeTracker>();
  const auto tracked = std::make_unique<analysis::TrackedSpectrum>();
  for (const double ratio : {0.0, 0.1, 0.7}) {
    for (int step = 0; step < 200; ++step) {
      const auto system = testing::panda_impedance(testing::swing(1e-2 * step), ratio);
      tracker->update(system, *tracked);
      if (step % 20 != 0) continue;
      const std::string at = std::to_string(ratio).substr(0, 3) + "." + std::to_string(step);
      solver.solve(system, spectrum);
      for (int i = 0; i < spectrum.modes.size(); ++i) {
        const std::string name = "direct." + at + "." + std::to_string(i);
        print("frequency", name + ".frequency", spectrum.modes[i].natural_frequency);
        print("ratio", name + ".ratio", spectrum.modes[i].damping_ratio);
      }
      for (int i = 0; i < tracked->mode_count; ++i) {
        print_mode("tracked." + at + "." + std::to_string(i),
                   tracked->modes[static_cast<std::size_t>(i)]);
      }
    }
  }
}

}  // namespace

int main() {
  spectra();
  return 0;
}
