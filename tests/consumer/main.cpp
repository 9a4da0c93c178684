// Compiled against the installation, for the plainest processor: what the library was compiled for
// must not show in the layout of its types.
#include <dashpot/analysis/spectrum.hpp>

#include <cmath>
#include <cstdio>

using dashpot::analysis::analyze;
using dashpot::analysis::kMaxDof;
using dashpot::analysis::Mode;
using dashpot::analysis::Spectrum;
using dashpot::analysis::SpectrumSolver;
using dashpot::analysis::Square;
using dashpot::analysis::Status;
using dashpot::analysis::System;

static_assert(EIGEN_DEFAULT_ALIGN_BYTES == 64, "alignment of what Eigen allocates");
static_assert(EIGEN_MAX_STATIC_ALIGN_BYTES == 64, "alignment of Eigen members");
static_assert(alignof(Square<8>) == 64);

int main() {
  // Two masses of 1 kg on springs of 100 N/m and 50 N/m, lightly damped.
  System<> system(2);
  system.stiffness << 150, -50, -50, 50;
  system.damping << 1.5, -0.5, -0.5, 0.5;
  const Spectrum<> spectrum = analyze(system);
  for (const Mode<>& mode : spectrum.modes) {
    std::printf("consumer: %.4f rad/s, damping ratio %.4f\n", mode.natural_frequency,
                mode.damping_ratio);
  }
  // The same in fixed storage, across the library's boundary.
  System<kMaxDof> fixed(2);
  fixed.stiffness = system.stiffness;
  fixed.damping = system.damping;
  static SpectrumSolver<kMaxDof> solver;
  static Spectrum<kMaxDof> same;
  if (solver.solve(fixed, same) != Status::kOk || same.modes.size() != 2) return 1;
  const double difference = same.modes[1].natural_frequency - spectrum.modes[1].natural_frequency;
  return std::abs(difference) < 1e-12 ? 0 : 1;
}
