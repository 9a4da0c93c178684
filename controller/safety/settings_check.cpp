#include <dashpot/controller/base/settings_table.hpp>
#include <dashpot/controller/safety/brake.hpp>
#include <dashpot/controller/setpoint_check.hpp>
#include <dashpot/controller/settings_check.hpp>

#include <algorithm>
#include <cmath>
#include <sstream>

namespace dashpot::controller {
namespace {

constexpr double kLongStop = 0.5;  // s, ten times as long as by default

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

/// Checks the sizes and ranges of the settings that the table has.
class RangeCheck {
 public:
  explicit RangeCheck(Eigen::Index n) : n_(n) {}

  void operator()(const Setting& setting, double value) const {
    check(setting, setting.key, value);
  }
  void operator()(const Setting& setting, int value) const { check(setting, setting.key, value); }
  void operator()(const Setting& setting, const JointVector& values) const {
    if (values.size() != n_) {
      throw InvalidSettings(setting.key, "has " + std::to_string(values.size()) +
                                             " entries, the robot has " + std::to_string(n_) +
                                             " joints");
    }
    for (Eigen::Index i = 0; i < n_; ++i) {
      check(setting, std::string(setting.key) + "[" + std::to_string(i) + "]", values[i]);
    }
  }
  void operator()(const Setting& setting, const Vector6& values) const {
    for (Eigen::Index i = 0; i < 6; ++i) {
      check(setting, std::string(setting.key) + "[" + std::to_string(i) + "]", values[i]);
    }
  }
  template <class Choice>
  void operator()(const Setting& /*setting*/, Choice /*value*/) const {}

 private:
  static void check(const Setting& setting, const std::string& key, double value) {
    if (value == setting.none || setting.range.has(value)) return;
    throw InvalidSettings(key, complaint(setting.range, value, setting.unit));
  }

  Eigen::Index n_;
};

void need_at_most(const char* key, double value, double periods, double period) {
  if (value <= periods * period) return;
  fail(key, value, "s",
       "must be at most " + number(periods) + " periods, " + number(periods * period) + " s");
}

void check_walls(const std::vector<Wall>& walls) {
  if (walls.size() > kMaxWalls) {
    fail("limits.walls", static_cast<double>(walls.size()), "walls", "must be at most 8");
  }
  for (const Wall& wall : walls) {
    if (!wall.point.allFinite() || !(std::abs(wall.normal.norm() - 1) < 1e-6)) {
      throw InvalidSettings("limits.walls", "a point is not finite, or a normal not of length 1");
    }
  }
}

void check_initial(const Setpoint& initial, int n) {
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

}  // namespace

void validate(const Settings& settings, int n) {
  for_each_setting(settings, RangeCheck(n));
  need_at_most("motion.smoothing", settings.motion.smoothing, kMostSmoothing, settings.period);
  need_at_most("motion.gain_time", settings.motion.gain_time, 1e6, settings.period);
  const Limits& limits = settings.limits;
  for (int i = 0; i < n; ++i) {
    if (!(limits.position_lower[i] < limits.position_upper[i])) {
      fail("limits.position_lower[" + std::to_string(i) + "]", limits.position_lower[i], "rad",
           "has to be below the upper limit");
    }
  }
  check_walls(limits.walls);
  if (!(settings.watchdog.longest_gap > settings.period)) {
    fail("watchdog.longest_gap", settings.watchdog.longest_gap, "s", "has to exceed the period");
  }
  const double stopping = Brake(settings).stopping_time();
  const bool late = loop_lag(settings) > 2 * settings.period;  // and not merely a slow loop
  if (late && stopping > std::max(kLongStop, 1.01 * limits.stopping_time)) {
    fail("limits.stopping_time", limits.stopping_time, "s",
         "but a loop whose torque is " + number(loop_lag(settings)) +
             " s late (analysis.sampled) needs " + number(stopping) +
             " s: ask for that, or for less delay and a higher cutoff");
  }
  check_initial(settings.initial, n);
}

}  // namespace dashpot::controller
