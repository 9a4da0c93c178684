#include <dashpot/apps/scene/scene_parts.hpp>
#include <dashpot/controller/drives.hpp>

#include <algorithm>
#include <limits>

namespace dashpot::apps {

using text::kNotNegative;
using text::kPositive;
using text::Range;
using text::Units;
using text::YamlMapping;

namespace {

constexpr double kMostSteps = 1000;  // of the integrator in a control period
constexpr double kRigid = std::numeric_limits<double>::infinity();

/// The unit for each joint: `revolute`, or `prismatic` where a position is in m.
Units joint_units(const Units& positions, const char* revolute, const char* prismatic) {
  Units units;
  for (const std::string& position : positions) {
    units.emplace_back(position == "m" ? prismatic : revolute);
  }
  return units;
}

/// Sets `value` to n numbers if the key is there; otherwise it stays empty: off.
void read_joint_option(const YamlMapping& keys, std::string_view key, const Units& units,
                       const Range& range, JointVector& value, double none = text::kNoNone) {
  if (!keys.has(key)) return;
  value.resize(static_cast<Eigen::Index>(units.size()));
  read_numbers(keys, key, units, range, value, none);
}

void read_integrator(const YamlMapping& simulation, double period,
                     sim::IntegratorOptions& options) {
  static constexpr auto kKeys =
      text::key_list("method", "step", "adaptive", "absolute_tolerance", "relative_tolerance");
  static constexpr std::array<std::pair<std::string_view, sim::Method>, 5> kMethods = {
      {{"semi_implicit_euler", sim::Method::kSemiImplicitEuler},
       {"rk4", sim::Method::kRungeKutta4},
       {"dormand_prince_8", sim::Method::kDormandPrince8},
       {"implicit_midpoint", sim::Method::kImplicitMidpoint},
       {"rosenbrock", sim::Method::kRosenbrock}}};
  const YamlMapping keys = simulation.mapping("integrator", kKeys);
  options.method = sim::IntegratorOptions().method;
  options.adaptive = false;
  read_choice(keys, "method", kMethods, options.method);
  read_number(keys, "step", "s", kPositive, options.max_step);
  read_switch(keys, "adaptive", options.adaptive);
  if (options.max_step < period / kMostSteps) {
    throw keys.error("step", "is less than a thousandth of the control period");
  }
  if (options.adaptive && !sim::estimates_error(options.method)) {
    throw keys.error("adaptive", "goes with method dormand_prince_8 or rosenbrock only");
  }
  read_number(keys, "absolute_tolerance", "", kPositive, options.absolute_tolerance);
  read_number(keys, "relative_tolerance", "", kPositive, options.relative_tolerance);
}

void read_drives(const YamlMapping& simulation, const Units& positions, sim::PlantOptions& plant) {
  static constexpr auto kKeys = text::key_list("torque_limit", "delay", "cutoff");
  const YamlMapping keys = simulation.mapping("drives", kKeys);
  read_joint_option(keys, "torque_limit", joint_units(positions, "N m", "N"), kPositive,
                    plant.torque_limit);
  read_count(keys, "delay", 0, plant.delay);
  if (plant.delay > 1000) throw keys.error("delay", "is more than 1000 ticks");
  read_number(keys, "cutoff", "Hz", kNotNegative, plant.torque_cutoff);
}

void read_sensors(const YamlMapping& simulation, const Units& positions, sim::PlantOptions& plant) {
  static constexpr auto kKeys = text::key_list("position_noise", "velocity_noise",
                                               "position_resolution", "difference_velocity");
  const YamlMapping keys = simulation.mapping("sensors", kKeys);
  read_joint_option(keys, "position_noise", positions, kNotNegative, plant.position_noise);
  read_joint_option(keys, "velocity_noise", joint_units(positions, "rad/s", "m/s"), kNotNegative,
                    plant.velocity_noise);
  read_joint_option(keys, "position_resolution", positions, kNotNegative,
                    plant.position_resolution);
  read_switch(keys, "difference_velocity", plant.difference_velocity);
}

void read_robot(const YamlMapping& simulation, const Units& positions, ArmSimulation& arm) {
  static constexpr auto kKeys = text::key_list("drives", "reflected_inertia", "viscous_friction",
                                               "coulomb_friction", "gear_stiffness", "gear_damping",
                                               "position_sensor", "friction_velocity", "payload");
  static constexpr std::array<std::pair<std::string_view, sim::PositionSensor>, 2> kSensors = {
      {{"motor", sim::PositionSensor::kMotor}, {"link", sim::PositionSensor::kLink}}};
  const YamlMapping keys = simulation.mapping("robot", kKeys);
  sim::RobotParameters& parameters = arm.parameters;
  if (keys.has("drives")) try {
      std::string name;
      read_text(keys, "drives", name);
      name = controller::drives_name(name, arm.directory);
      const controller::Drives& drives =
          controller::find_drives(name, static_cast<int>(positions.size()));
      parameters.reflected_inertia = drives.values(drives.reflected_inertia);
      if (controller::has_own_friction(name)) {
        parameters.viscous_friction = drives.values(drives.viscous_friction);
        parameters.coulomb_friction = drives.values(drives.coulomb_friction);
      }
    } catch (const controller::InvalidModel& error) {
      throw keys.error("drives", error.what());
    }
  read_joint_option(keys, "reflected_inertia", joint_units(positions, "kg m^2", "kg"), kNotNegative,
                    parameters.reflected_inertia);
  read_joint_option(keys, "viscous_friction", joint_units(positions, "N m s/rad", "N s/m"),
                    kNotNegative, parameters.viscous_friction);
  read_joint_option(keys, "coulomb_friction", joint_units(positions, "N m", "N"), kNotNegative,
                    parameters.coulomb_friction);
  read_joint_option(keys, "gear_stiffness", joint_units(positions, "N m/rad", "N/m"), kPositive,
                    parameters.gear_stiffness, kRigid);
  read_joint_option(keys, "gear_damping", joint_units(positions, "N m s/rad", "N s/m"),
                    kNotNegative, parameters.gear_damping);
  read_choice(keys, "position_sensor", kSensors, arm.options.position_sensor);
  read_number(keys, "friction_velocity", "rad/s", kPositive, arm.options.friction_velocity);
  static constexpr auto kPayload = text::key_list("mass", "center", "inertia");
  const YamlMapping payload = keys.mapping("payload", kPayload);
  read_body(payload, parameters.payload.mass, parameters.payload.center,
            parameters.payload.about_center);
}

void read_surroundings(const YamlMapping& simulation, sim::ArmOptions& options) {
  static constexpr auto kStopKeys = text::key_list("stiffness", "damping");
  static constexpr auto kWallKeys = text::key_list("point", "normal", "stiffness", "damping");
  if (simulation.has("stops")) {
    options.stops = sim::Contact{2000, 20};
    read_contact(simulation.mapping("stops", kStopKeys), "N m/rad", "N m s/rad", *options.stops);
  }
  if (simulation.has("wall")) {
    const YamlMapping keys = simulation.mapping("wall", kWallKeys);
    sim::Wall& wall = options.wall.emplace();
    read_vector3(keys, "point", "m", wall.point);
    read_vector3(keys, "normal", "", wall.normal);
    if (wall.normal.isZero(0)) throw keys.error("normal", "has no direction");
    read_contact(keys, "N/m", "N s/m", wall.contact);
  }
}

}  // namespace

void read_contact(const YamlMapping& keys, const char* stiffness, const char* damping,
                  sim::Contact& contact) {
  read_number(keys, "stiffness", stiffness, kPositive, contact.stiffness);
  read_number(keys, "damping", damping, kNotNegative, contact.damping);
}

void read_simulation(const YamlMapping& root, const Units& positions, sim::PlantOptions& plant,
                     ArmSimulation& arm) {
  static constexpr auto kKeys =
      text::key_list("integrator", "drives", "sensors", "seed", "robot", "stops", "wall");
  const YamlMapping keys = root.mapping("simulation", kKeys);
  plant.integrator.max_step = plant.period;
  read_robot(keys, positions, arm);
  // Gears ring much faster than the arm, and how fast depends on the posture.
  if ((arm.parameters.gear_stiffness.array() < kRigid).any()) {
    plant.integrator.method = sim::Method::kDormandPrince8;
    plant.integrator.adaptive = true;
  }
  if (keys.has("integrator")) read_integrator(keys, plant.period, plant.integrator);
  read_drives(keys, positions, plant);
  read_sensors(keys, positions, plant);
  int seed = 1;
  read_count(keys, "seed", 0, seed);
  plant.seed = static_cast<std::uint64_t>(seed);
  read_surroundings(keys, arm.options);
}

}  // namespace dashpot::apps
