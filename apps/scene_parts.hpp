#pragma once
// The parts of a scene file, each under its key.

#include <dashpot/apps/scene.hpp>
#include <dashpot/controller/setting_reader.hpp>

namespace dashpot::apps {

/// What the simulation of an arm needs besides its options.
struct ArmSimulation {
  sim::RobotParameters parameters;
  sim::ArmOptions options;
};

/// Reads `simulation` of a scene of n joints into `plant`, and for an arm into `arm`; units are
/// those of `positions` ("rad" or "m" each). Throws InputError.
void read_simulation(const controller::YamlMapping& root, const controller::Units& positions,
                     sim::PlantOptions& plant, ArmSimulation* arm);

/// Reads `scenario` into the scene, whose arm or matrices are there already. Throws InputError.
void read_scenario(const controller::YamlMapping& root, const controller::Units& positions,
                   Scene& scene);

}  // namespace dashpot::apps
