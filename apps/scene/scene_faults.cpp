#include <dashpot/apps/scene/scene_parts.hpp>

#include <cmath>

namespace dashpot::apps {
namespace {

using text::kAnyNumber;
using text::kNotNegative;
using text::kPositive;
using text::Units;
using text::YamlMapping;

/// Reads the errors of the sensors. Returns whether there are any.
bool read_sensor_fault(const YamlMapping& keys, const Units& positions, sim::SensorFault& fault) {
  const auto n = static_cast<Eigen::Index>(positions.size());
  if (keys.has("position_offset")) {
    fault.position_offset = JointVector::Zero(n);
    read_numbers(keys, "position_offset", positions, kAnyNumber, fault.position_offset);
  }
  if (keys.has("velocity_factor")) {
    fault.velocity_factor = JointVector::Ones(n);
    read_numbers(keys, "velocity_factor", Units(positions.size()), kAnyNumber,
                 fault.velocity_factor);
  }
  read_switch(keys, "frozen", fault.frozen);
  read_switch(keys, "not_a_number", fault.not_a_number);
  double clock_offset = 0;
  read_number(keys, "clock_offset", "s", kAnyNumber, clock_offset);
  if (std::abs(clock_offset) > 1e6) throw keys.error("clock_offset", "is more than 1e6 s");
  fault.clock_offset = std::llround(1e9 * clock_offset);
  return fault.position_offset.size() > 0 || fault.velocity_factor.size() > 0 || fault.frozen ||
         fault.not_a_number || fault.clock_offset != 0;
}

/// Reads when the controller is not called. Returns whether there is such a time.
bool read_loop_fault(const YamlMapping& keys, const Units& positions, LoopFault& fault) {
  bool pause = false;
  read_switch(keys, "pause", pause);
  read_count(keys, "call_every", 1, fault.every);
  if (pause && keys.has("call_every")) {
    throw keys.error("call_every", "stands beside pause, in which there are no calls");
  }
  if (keys.has("moved_by")) {
    if (!pause || !keys.has("end")) {
      throw keys.error("moved_by", "goes with a pause that has an end");
    }
    fault.moved_by = JointVector::Zero(static_cast<Eigen::Index>(positions.size()));
    read_numbers(keys, "moved_by", positions, kAnyNumber, fault.moved_by);
  }
  if (pause) fault.every = 0;
  return fault.every != 1;
}

}  // namespace

void read_faults(const YamlMapping& scenario, const Units& positions, Scene& scene) {
  static constexpr auto kKeys =
      text::key_list("begin", "end", "position_offset", "velocity_factor", "frozen", "not_a_number",
                     "clock_offset", "call_every", "pause", "moved_by");
  for (const YamlMapping& keys : mappings(scenario, "faults", kKeys)) {
    require(keys, "begin", scenario, "faults");
    sim::SensorFault sensors;
    read_when(keys, scene, sensors.begin, sensors.end);
    LoopFault loop{sensors.begin, sensors.end, 1, {}};
    const bool wrong_sensors = read_sensor_fault(keys, positions, sensors);
    const bool wrong_loop = read_loop_fault(keys, positions, loop);
    if (!wrong_sensors && !wrong_loop) throw keys.error("begin", "is of a fault that does nothing");
    if (wrong_sensors) scene.plant.faults.push_back(sensors);
    if (wrong_loop) scene.loop_faults.push_back(loop);
  }
}

}  // namespace dashpot::apps
