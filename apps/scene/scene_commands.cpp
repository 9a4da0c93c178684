#include <dashpot/apps/scene/scene_parts.hpp>

#include <cmath>

namespace dashpot::apps {
namespace {

using text::kNotNegative;
using text::kPositive;
using text::YamlMapping;

/// Reads a time into `microseconds`.
void read_microseconds(const YamlMapping& keys, const char* key, std::int64_t& microseconds) {
  constexpr double kLongestTime = 3600;  // s
  double seconds = 1e-6 * static_cast<double>(microseconds);
  read_number(keys, key, "s", kPositive, seconds);
  if (seconds > kLongestTime) throw keys.error(key, "is more than an hour");
  microseconds = std::llround(1e6 * seconds);
}

/// Reads a limit that can only be lowered.
void read_at_most(const YamlMapping& keys, const char* key, const char* unit, double& limit) {
  const text::Range range{0, false, limit};
  read_number(keys, key, unit, range, limit);
}

}  // namespace

void read_commands(const YamlMapping& root, lcmtypes::CommandLimits& limits) {
  static constexpr auto kKeys =
      text::key_list("reach", "force", "torque", "joint_stiffness", "joint_damping",
                     "task_stiffness", "task_damping", "damping_ratio", "payload",
                     "payload_distance", "tool_distance", "linear_velocity", "angular_velocity",
                     "tip_velocity", "oldest", "furthest", "silence", "most_per_second", "burst");
  const YamlMapping keys = root.mapping("commands", kKeys);
  read_number(keys, "reach", "m", kPositive, limits.reach);
  read_number(keys, "force", "N", kNotNegative, limits.force);
  read_number(keys, "torque", "N m", kNotNegative, limits.torque);
  read_number(keys, "joint_stiffness", "N m/rad", kNotNegative, limits.joint_stiffness);
  read_number(keys, "joint_damping", "N m s/rad", kNotNegative, limits.joint_damping);
  read_number(keys, "task_stiffness", "N/m", kNotNegative, limits.task_stiffness);
  read_number(keys, "task_damping", "N s/m", kNotNegative, limits.task_damping);
  read_at_most(keys, "damping_ratio", "", limits.damping_ratio);
  read_number(keys, "payload", "kg", kNotNegative, limits.payload);
  read_number(keys, "payload_distance", "m", kNotNegative, limits.payload_distance);
  read_number(keys, "tool_distance", "m", kNotNegative, limits.tool_distance);
  read_at_most(keys, "linear_velocity", "m/s", limits.linear_velocity);
  read_at_most(keys, "angular_velocity", "rad/s", limits.angular_velocity);
  read_at_most(keys, "tip_velocity", "m/s", limits.tip_velocity);
  read_microseconds(keys, "oldest", limits.oldest);
  read_microseconds(keys, "furthest", limits.furthest);
  read_microseconds(keys, "silence", limits.silence);
  read_number(keys, "most_per_second", "", kPositive, limits.most_per_second);
  int burst = static_cast<int>(limits.burst);
  read_count(keys, "burst", 1, burst);
  limits.burst = burst;
}

}  // namespace dashpot::apps
