#include <dashpot/controller/setpoint_check.hpp>
#include <dashpot/controller/settings_check.hpp>

#include <cmath>
#include <sstream>

namespace dashpot::controller {
namespace {

std::string number(double value) {
  std::ostringstream text;
  text << value;
  return text.str();
}

[[noreturn]] void fail(const std::string& key, double value, const std::string& unit,
                       const std::string& reason) {
  throw InvalidSettings(key,
                        "is " + number(value) + (unit.empty() ? "" : " ") + unit + ", " + reason);
}

void need_positive(const std::string& key, double value, const std::string& unit) {
  if (!std::isfinite(value) || value <= 0) fail(key, value, unit, "has to be positive");
}

void need_not_negative(const std::string& key, double value, const std::string& unit) {
  if (!std::isfinite(value) || value < 0) fail(key, value, unit, "must not be negative");
}

/// Positive, or infinite.
void need_above_zero(const std::string& key, double value, const std::string& unit) {
  if (!(value > 0)) fail(key, value, unit, "has to be positive");
}

std::string entry(const std::string& key, Eigen::Index i) {
  return key + "[" + std::to_string(i) + "]";
}

void need_size(const std::string& key, const JointVector& v, int n) {
  if (v.size() != n) {
    throw InvalidSettings(key, "has " + std::to_string(v.size()) + " entries, the robot has " +
                                   std::to_string(n) + " joints");
  }
}

void need_positive(const std::string& key, const JointVector& v, const std::string& unit, int n) {
  need_size(key, v, n);
  for (int i = 0; i < n; ++i) need_positive(entry(key, i), v[i], unit);
}

void validate(const Motion& motion, double period, int n) {
  need_positive("motion.velocity", motion.velocity, "rad/s", n);
  need_positive("motion.acceleration", motion.acceleration, "rad/s^2", n);
  need_positive("motion.linear_velocity", motion.linear_velocity, "m/s");
  need_positive("motion.linear_acceleration", motion.linear_acceleration, "m/s^2");
  need_positive("motion.angular_velocity", motion.angular_velocity, "rad/s");
  need_positive("motion.angular_acceleration", motion.angular_acceleration, "rad/s^2");
  need_not_negative("motion.smoothing", motion.smoothing, "s");
  if (motion.smoothing > kMostSmoothing * period) {
    fail("motion.smoothing", motion.smoothing, "s",
         "must be at most 256 periods, " + number(kMostSmoothing * period) + " s");
  }
  need_positive("motion.gain_time", motion.gain_time, "s");
  if (motion.gain_time > 1e6 * period) {
    fail("motion.gain_time", motion.gain_time, "s",
         "must be at most 1e6 periods, " + number(1e6 * period) + " s");
  }
}

void validate(const Limits& limits, int n) {
  need_positive("limits.torque", limits.torque, "N m", n);
  need_positive("limits.torque_rate", limits.torque_rate, "N m/s", n);
  need_positive("limits.velocity", limits.velocity, "rad/s", n);
  need_positive("limits.damping", limits.damping, "N m s/rad", n);
  need_size("limits.position_lower", limits.position_lower, n);
  need_size("limits.position_upper", limits.position_upper, n);
  for (int i = 0; i < n; ++i) {
    if (!(limits.position_lower[i] < limits.position_upper[i])) {
      fail(entry("limits.position_lower", i), limits.position_lower[i], "rad",
           "has to be below the upper limit");
    }
  }
  need_positive("limits.position_margin", limits.position_margin, "rad", n);
  need_size("limits.return_velocity", limits.return_velocity, n);
  need_size("limits.external_torque", limits.external_torque, n);
  for (int i = 0; i < n; ++i) {
    need_not_negative(entry("limits.return_velocity", i), limits.return_velocity[i], "rad/s");
    need_above_zero(entry("limits.external_torque", i), limits.external_torque[i], "N m");
  }
  need_positive("limits.tip_velocity", limits.tip_velocity, "m/s");
  need_above_zero("limits.power", limits.power, "W");
  need_above_zero("limits.external_force", limits.external_force, "N");
  if (!(limits.gain_margin >= 1 && limits.gain_margin <= 1000)) {
    fail("limits.gain_margin", limits.gain_margin, "", "must be between 1 and 1000");
  }
  if (limits.walls.size() > kMaxWalls) {
    fail("limits.walls", static_cast<double>(limits.walls.size()), "walls", "must be at most 8");
  }
  for (const Wall& wall : limits.walls) {
    if (!wall.point.allFinite() || !(std::abs(wall.normal.norm() - 1) < 1e-6)) {
      throw InvalidSettings("limits.walls", "a point is not finite, or a normal not of length 1");
    }
  }
  need_not_negative("limits.repulsion", limits.repulsion, "");
  if (limits.repulsion > 1) fail("limits.repulsion", limits.repulsion, "", "must be at most 1");
  need_positive("limits.linear_error", limits.linear_error, "m");
  need_positive("limits.angular_error", limits.angular_error, "rad");
}

constexpr int kLongestDelay = 20;  // ticks, that the analysis of the sampled loop takes

}  // namespace

void validate(const Settings& settings, int n) {
  need_positive("period", settings.period, "s");
  validate(settings.motion, settings.period, n);
  validate(settings.limits, n);
  need_not_negative("watchdog.setpoint_hold", settings.watchdog.setpoint_hold, "s");
  need_not_negative("watchdog.setpoint_damp", settings.watchdog.setpoint_damp, "s");
  if (!(settings.watchdog.longest_gap > settings.period)) {
    fail("watchdog.longest_gap", settings.watchdog.longest_gap, "s", "has to exceed the period");
  }
  need_not_negative("watchdog.feedback", settings.watchdog.feedback, "s");
  need_not_negative("watchdog.release_after", settings.watchdog.release_after, "s");
  if (settings.analysis.every < 1) {
    fail("analysis.every", settings.analysis.every, "ticks", "has to be at least 1");
  }
  need_positive("analysis.share", settings.analysis.share, "");
  if (settings.analysis.share > 1) {
    fail("analysis.share", settings.analysis.share, "", "must be at most 1");
  }
  need_not_negative("analysis.soft_frequency", settings.analysis.soft_frequency, "rad/s");
  const Analysis::Sampled& sampled = settings.analysis.sampled;
  need_not_negative("analysis.sampled.interval", sampled.interval, "s");
  need_not_negative("analysis.sampled.cutoff", sampled.cutoff, "Hz");
  if (sampled.delay < 0 || sampled.delay > kLongestDelay) {
    fail("analysis.sampled.delay", sampled.delay, "ticks", "has to be between 0 and 20");
  }
  const Setpoint& initial = settings.initial;
  for (const auto& [key, ratio] :
       {std::pair("task_damping_ratio", initial.gains.task_damping_ratio),
        {"joint_damping_ratio", initial.gains.joint_damping_ratio}}) {
    if (!(ratio >= 0 && ratio <= kLargestDampingRatio)) {
      fail(std::string("initial.gains.") + key, ratio, "", "must be between 0 and 2");
    }
  }
  if (const SetpointFault fault = check_gains(initial.gains, initial.mode, n)) {
    throw InvalidSettings(std::string("initial.gains.") + fault.key, fault.reason);
  }
  if (!initial.wrench.allFinite()) throw InvalidSettings("initial.wrench", "is not finite");
}

}  // namespace dashpot::controller
