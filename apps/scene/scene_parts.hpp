#pragma once
// The parts of a scene file, each under its key.

#include <dashpot/apps/scene/scene.hpp>
#include <dashpot/text/setting_reader.hpp>

#include <filesystem>

namespace dashpot::apps {

/// The parameters and options of a simulated arm.
struct ArmSimulation {
  sim::RobotParameters parameters;
  sim::ArmOptions options;
  std::filesystem::path directory;  ///< of the scene
};

/// Reads `simulation` of a scene into `plant` and `arm`; `positions` has the unit of each joint
/// ("rad" or "m"). Throws InputError.
void read_simulation(const text::YamlMapping& root, const text::Units& positions,
                     sim::PlantOptions& plant, ArmSimulation& arm);

/// Reads mass, center and inertia of a body at the tip. Throws InputError.
template <class Vector3, class Matrix3>
void read_body(const text::YamlMapping& keys, double& mass, Vector3& center, Matrix3& inertia) {
  read_number(keys, "mass", "kg", text::kNotNegative, mass);
  read_vector3(keys, "center", "m", center);
  read_matrix(keys, "inertia", text::Units(3, "kg m^2"), inertia);
}

/// Reads stiffness and damping, in these units. Throws InputError.
void read_contact(const text::YamlMapping& keys, const char* stiffness, const char* damping,
                  sim::Contact& contact);

/// Reads `commands`. Throws InputError.
void read_commands(const text::YamlMapping& root, lcmtypes::CommandLimits& limits);

/// Reads `scenario` into the scene, which has its arm already. Throws InputError.
void read_scenario(const text::YamlMapping& root, const text::Units& positions, Scene& scene);

/// Reads `scenario.faults` into the plant's options and the scene. Throws InputError.
void read_faults(const text::YamlMapping& scenario, const text::Units& positions, Scene& scene);

/// The entries of a list of mappings under `scenario`, each with the prefix of its keys in
/// messages.
std::vector<text::YamlMapping> mappings(const text::YamlMapping& keys, std::string_view key,
                                        std::span<const std::string_view> known_keys);
/// Reads `begin` and `end` of an event in a scenario; a missing end stays as it is.
/// Throws InputError for an end that is not after the begin, and a begin after the scenario.
void read_when(const text::YamlMapping& keys, const Scene& scene, double& begin, double& end);
/// Throws unless `keys` has `key`; `parent` has `keys` under `name`.
void require(const text::YamlMapping& keys, std::string_view key, const text::YamlMapping& parent,
             std::string_view name);

/// The joint position next to `q` where the tip is displaced from its pose at `q` by `displacement`
/// (m, and a rotation vector in rad; base axes): the one that is reached with the least kinetic
/// energy, step by step. Nothing if it cannot be reached.
std::optional<JointVector> displaced(const controller::RobotModel& model, const JointVector& q,
                                     const controller::Vector6& displacement);

}  // namespace dashpot::apps
