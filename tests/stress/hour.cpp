// An hour of simulated time: how far the energy of a swinging Panda drifts with each method, and
// whether the modes of one that moves periodically are where they were after each of 1800 rounds.
#include <dashpot/analysis/mode_tracker.hpp>
#include <dashpot/sim/arm.hpp>
#include <dashpot/sim/plant.hpp>
#include <dashpot/tests/stress/part.hpp>
#include <dashpot/tests/support/panda_path.hpp>
#include <dashpot/tests/support/places.hpp>

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <memory>
#include <vector>

namespace {

using namespace dashpot;  // NOLINT(google-build-using-namespace)

constexpr int kStepsOfAPeriod = 4;

/// Without friction, torque or limits the energy stays; `most` is what may be missing at the end,
/// relative to the largest kinetic energy.
bool keeps_energy(const char* name, sim::Method method, double step, double seconds, double most) {
  sim::RobotParameters parameters;
  parameters.viscous_friction = parameters.coulomb_friction = sim::JointVector::Zero(7);
  sim::Arm arm(sim::Robot::from_file(DASHPOT_SOURCE_DIR "/sim/models/panda.urdf", "panda_link0",
                                     "panda_hand_tcp", parameters));
  sim::PlantOptions options;
  options.period = kStepsOfAPeriod * step;  // a step may keep something for the next
  options.integrator.method = method;
  options.integrator.max_step = step;
  const sim::JointVector hanging = (sim::JointVector(7) << 0, 3.1, 0, -0.1, 0, 0.1, 0).finished();
  sim::Plant plant(arm, options, hanging);
  const sim::JointVector torque = sim::JointVector::Zero(7);
  double largest = 0;
  const long ticks = std::lround(seconds / options.period);
  for (long tick = 0; tick < ticks; ++tick) {
    if (plant.step(torque) != sim::Status::kOk) return false;
    if (tick % 16 == 0) largest = std::max(largest, plant.audit().stored.kinetic);
  }
  const double drift = plant.audit().imbalance() / largest;
  const bool good = std::abs(drift) <= most;
  std::printf("energy, %-18s step %g s, %g s: %+.1e of the largest kinetic energy%s\n", name, step,
              seconds, drift, good ? "" : ", TOO MUCH");
  return good;
}

/// Round and round in 2 s, each joint by half a radian.
bool keeps_modes(double seconds) {
  constexpr int kRound = 2000;  // ms
  std::vector<analysis::System<analysis::kMaxDof>> path;
  for (int i = 0; i < kRound; ++i) {
    Eigen::VectorXd q = testing::swing(0);
    for (Eigen::Index j = 0; j < 7; ++j) {
      q[j] += 0.5 * std::sin(2 * std::numbers::pi * i / kRound + static_cast<double>(j));
    }
    path.push_back(testing::panda_impedance(q, 0.1));
  }
  const auto tracker = std::make_unique<analysis::ModeTracker>();
  const auto spectrum = std::make_unique<analysis::TrackedSpectrum>();
  const long rounds = std::max(2L, std::lround(seconds * 1e3 / kRound));
  std::vector<analysis::ModeNumbers> first;
  double farthest = 0;
  int exchanged = 0;
  for (long round = 0; round < rounds; ++round) {
    for (const auto& system : path) {
      if (tracker->update(system, *spectrum) != analysis::Status::kOk) return false;
    }
    if (round == 0)
      first.assign(spectrum->modes.begin(), spectrum->modes.begin() + spectrum->mode_count);
    for (std::size_t i = 0; i < first.size(); ++i) {
      const analysis::ModeNumbers& now = spectrum->modes[i];
      const double apart = std::abs(now.eigenvalues[0] - first[i].eigenvalues[0]);
      if (apart > now.error_bound + first[i].error_bound) ++exchanged;
      farthest = std::max(farthest, apart / std::abs(now.eigenvalues[0]));
    }
  }
  const analysis::TrackerCounters& counters = tracker->counters();
  std::printf(
      "modes, %ld rounds of 2 s, %ld updates, %ld solved directly: %d out of place or out of "
      "their bounds, farthest %.1e relative\n",
      rounds, counters.updates(), counters.direct, exchanged, farthest);
  return exchanged == 0;
}

bool simulate(const stress::Request& request) {
  const double seconds = request.count;
  bool good = keeps_energy("rk4", sim::Method::kRungeKutta4, 1e-3, seconds, 1e-6);
  good &= keeps_energy("dormand_prince_8", sim::Method::kDormandPrince8, 5e-3, seconds, 1e-8);
  good &= keeps_modes(seconds);
  return good;
}

const stress::AddPart part({"hour",
                            6,
                            "Simulate an arm, and follow its modes round and round",
                            "SECONDS",
                            {{3600, 10}},
                            simulate});

}  // namespace
