#include <dashpot/controller/config.hpp>
#include <dashpot/controller/config/config_gains.hpp>
#include <dashpot/controller/config/config_robot.hpp>
#include <dashpot/controller/default_settings.hpp>
#include <dashpot/controller/settings_check.hpp>
#include <dashpot/controller/yaml/setting_reader.hpp>

#include <algorithm>
#include <cmath>
#include <limits>

namespace dashpot::controller {
namespace {

void read_control(const YamlMapping& root, Settings& settings) {
  static constexpr std::array<std::string_view, 6> kKeys = {
      "period", "rate", "mode", "geometric_stiffness", "jacobian_rate", "subtract_friction"};
  const YamlMapping keys = root.mapping("control", kKeys);
  if (keys.has("period") && keys.has("rate")) {
    throw keys.error("rate", "stands beside period, which says the same");
  }
  read_number(keys, "period", "s", Sign::kPositive, settings.period);
  if (keys.has("rate")) {
    double rate = 0;
    read_number(keys, "rate", "Hz", Sign::kPositive, rate);
    settings.period = 1 / rate;
  }
  static constexpr std::array<std::pair<std::string_view, Mode>, 2> kModes = {
      {{"joint", Mode::kJoint}, {"cartesian", Mode::kCartesian}}};
  read_choice(keys, "mode", kModes, settings.initial.mode);
  read_switch(keys, "geometric_stiffness", settings.task_terms.geometric_stiffness);
  read_switch(keys, "jacobian_rate", settings.task_terms.jacobian_rate);
  read_switch(keys, "subtract_friction", settings.subtract_friction);
}

void read_walls(const YamlMapping& limits, std::vector<Wall>& walls) {
  static constexpr std::array<std::string_view, 2> kKeys = {"point", "normal"};
  const YamlNode* list = limits.find("walls");
  if (list == nullptr) return;
  if (list->kind != YamlNode::Kind::kSequence) {
    throw limits.error("walls", "a list is wanted, not " + describe(*list));
  }
  walls.clear();
  for (std::size_t i = 0; i < list->items.size(); ++i) {
    const YamlMapping keys(list->items[i], "limits.walls[" + std::to_string(i + 1) + "].", kKeys);
    Wall& wall = walls.emplace_back();
    for (const std::string_view key : kKeys) {
      if (!keys.has(key)) throw keys.error(key, "missing", limits.line("walls"));
    }
    read_vector3(keys, "point", "m", wall.point);
    read_vector3(keys, "normal", "", wall.normal);
    const double length = wall.normal.norm();
    if (!(length > 1e-9) || !std::isfinite(length)) throw keys.error("normal", "has no direction");
    wall.normal /= length;
  }
}

void read_limits(const YamlMapping& root, const RobotModel& model, Limits& limits) {
  static constexpr std::array<std::string_view, 17> kKeys = {
      "torque",         "torque_rate",     "velocity",  "tip_velocity",    "position_lower",
      "position_upper", "position_margin", "repulsion", "return_velocity", "linear_error",
      "angular_error",  "damping",         "power",     "external_torque", "external_force",
      "walls",          "gain_margin"};
  constexpr double kInfinity = std::numeric_limits<double>::infinity();
  const YamlMapping keys = root.mapping("limits", kKeys);
  const Units position = joint_units(model, "rad", "m");
  read_numbers(keys, "torque", joint_units(model, "N m", "N"), Sign::kPositive, limits.torque);
  read_numbers(keys, "torque_rate", joint_units(model, "N m/s", "N/s"), Sign::kPositive,
               limits.torque_rate);
  read_numbers(keys, "velocity", joint_units(model, "rad/s", "m/s"), Sign::kPositive,
               limits.velocity);
  read_numbers_or_none(keys, "position_lower", position, -kInfinity, limits.position_lower);
  read_numbers_or_none(keys, "position_upper", position, kInfinity, limits.position_upper);
  read_numbers(keys, "position_margin", position, Sign::kPositive, limits.position_margin);
  read_number(keys, "repulsion", "", Sign::kNotNegative, limits.repulsion);
  read_number(keys, "linear_error", "m", Sign::kPositive, limits.linear_error);
  read_number(keys, "angular_error", "rad", Sign::kPositive, limits.angular_error);
  read_numbers(keys, "damping", joint_units(model, "N m s/rad", "N s/m"), Sign::kPositive,
               limits.damping);
  read_number(keys, "tip_velocity", "m/s", Sign::kPositive, limits.tip_velocity);
  read_numbers(keys, "return_velocity", joint_units(model, "rad/s", "m/s"), Sign::kNotNegative,
               limits.return_velocity);
  read_number(keys, "power", "W", Sign::kPositive, limits.power);
  read_numbers_or_none(keys, "external_torque", joint_units(model, "N m", "N"), kInfinity,
                       limits.external_torque);
  read_number(keys, "external_force", "N", Sign::kPositive, limits.external_force);
  read_walls(keys, limits.walls);
  read_number(keys, "gain_margin", "", Sign::kPositive, limits.gain_margin);
}

void read_motion(const YamlMapping& root, const RobotModel& model, double period, Motion& motion) {
  static constexpr std::array<std::string_view, 8> kKeys = {
      "velocity",         "acceleration",         "linear_velocity", "linear_acceleration",
      "angular_velocity", "angular_acceleration", "smoothing",       "gain_time"};
  const YamlMapping keys = root.mapping("motion", kKeys);
  read_numbers(keys, "velocity", joint_units(model, "rad/s", "m/s"), Sign::kPositive,
               motion.velocity);
  read_numbers(keys, "acceleration", joint_units(model, "rad/s^2", "m/s^2"), Sign::kPositive,
               motion.acceleration);
  read_number(keys, "linear_velocity", "m/s", Sign::kPositive, motion.linear_velocity);
  read_number(keys, "linear_acceleration", "m/s^2", Sign::kPositive, motion.linear_acceleration);
  read_number(keys, "angular_velocity", "rad/s", Sign::kPositive, motion.angular_velocity);
  read_number(keys, "angular_acceleration", "rad/s^2", Sign::kPositive,
              motion.angular_acceleration);
  motion.smoothing = std::min(motion.smoothing, kMostSmoothing * period);  // of fast loops
  read_number(keys, "smoothing", "s", Sign::kPositive, motion.smoothing);
  read_number(keys, "gain_time", "s", Sign::kPositive, motion.gain_time);
}

void read_feed_forward(const YamlMapping& root, FeedForward& feed_forward) {
  static constexpr std::array<std::string_view, 5> kKeys = {"gravity", "coriolis", "friction",
                                                            "acceleration", "wrench"};
  const YamlMapping keys = root.mapping("feed_forward", kKeys);
  read_switch(keys, "gravity", feed_forward.gravity);
  read_switch(keys, "coriolis", feed_forward.coriolis);
  read_switch(keys, "friction", feed_forward.friction);
  read_switch(keys, "acceleration", feed_forward.acceleration);
  read_switch(keys, "wrench", feed_forward.wrench);
}

void read_watchdog(const YamlMapping& root, double period, Watchdog& watchdog) {
  constexpr double kGap = 2.5;  // periods
  static constexpr std::array<std::string_view, 5> kKeys = {
      "setpoint_hold", "setpoint_damp", "longest_gap", "feedback", "release_after"};
  const YamlMapping keys = root.mapping("watchdog", kKeys);
  watchdog.longest_gap = std::max(watchdog.longest_gap, kGap * period);  // of slow loops
  read_number(keys, "setpoint_hold", "s", Sign::kNotNegative, watchdog.setpoint_hold);
  read_number(keys, "setpoint_damp", "s", Sign::kNotNegative, watchdog.setpoint_damp);
  read_number(keys, "longest_gap", "s", Sign::kPositive, watchdog.longest_gap);
  read_number(keys, "feedback", "s", Sign::kNotNegative, watchdog.feedback);
  read_number(keys, "release_after", "s", Sign::kNotNegative, watchdog.release_after);
}

void read_analysis(const YamlMapping& root, Analysis& analysis) {
  static constexpr std::array<std::string_view, 6> kKeys = {"where",          "every",  "share",
                                                            "soft_frequency", "shapes", "sampled"};
  static constexpr std::array<std::pair<std::string_view, Analysis::Where>, 3> kPlaces = {
      {{"off", Analysis::Where::kOff},
       {"inline", Analysis::Where::kInline},
       {"background", Analysis::Where::kBackground}}};
  const YamlMapping keys = root.mapping("analysis", kKeys);
  read_choice(keys, "where", kPlaces, analysis.where);
  read_count(keys, "every", 1, analysis.every);
  read_number(keys, "share", "", Sign::kPositive, analysis.share);
  read_number(keys, "soft_frequency", "rad/s", Sign::kNotNegative, analysis.soft_frequency);
  read_switch(keys, "shapes", analysis.shapes);
  static constexpr std::array<std::string_view, 4> kSampledKeys = {"interval", "delay", "cutoff",
                                                                   "difference_velocity"};
  const YamlMapping sampled = keys.mapping("sampled", kSampledKeys);
  read_number(sampled, "interval", "s", Sign::kNotNegative, analysis.sampled.interval);
  read_count(sampled, "delay", 0, analysis.sampled.delay);
  read_number(sampled, "cutoff", "Hz", Sign::kNotNegative, analysis.sampled.cutoff);
  read_switch(sampled, "difference_velocity", analysis.sampled.difference_velocity);
}

/// "gains.joint.stiffness" for the setting "initial.gains.joint_stiffness", and so on.
std::string key_of_setting(std::string setting) {
  static constexpr std::array<std::pair<std::string_view, std::string_view>, 6> kNames = {
      {{"period", "control.period"},
       {"task_terms.", "control."},
       {"initial.mode", "control.mode"},
       {"initial.gains.joint_", "gains.joint."},
       {"initial.gains.null_", "gains.null_space."},
       {"initial.gains.task_", "gains.task."}}};
  for (const auto& [begin, key] : kNames) {
    if (setting.starts_with(begin)) return setting.replace(0, begin.size(), key);
  }
  if (setting.starts_with("initial.gains.")) return "gains.task." + setting.substr(14);
  return setting;
}

/// The line of the value under a key such as "limits.torque"; if it is not there, of what is
/// nearest above it; 0 if nothing is.
int line_of(const YamlNode& root, const std::string& key) {
  const YamlNode* node = &root;
  int line = 0;
  for (std::size_t begin = 0; begin < key.size();) {
    const std::size_t end = std::min(key.find('.', begin), key.size());
    const auto item = std::find_if(
        node->items.begin(), node->items.end(),
        [&](const YamlNode& one) { return one.text == key.substr(begin, end - begin); });
    if (node->kind != YamlNode::Kind::kMap || item == node->items.end()) break;
    node = &*std::next(item);
    line = node->line;
    begin = end + 1;
  }
  return line;
}

/// Throws an InputError about the first setting that the controller would refuse, in either mode.
void check(const Settings& settings, int n, const YamlNode& document) {
  Settings other = settings;
  other.initial.mode = settings.initial.mode == Mode::kJoint ? Mode::kCartesian : Mode::kJoint;
  try {
    validate(settings, n);
    validate(other, n);
  } catch (const InvalidSettings& error) {
    const std::string key = key_of_setting(error.key());
    std::string reason = error.what();
    if (reason.starts_with(error.key() + ": ")) reason.erase(0, error.key().size() + 2);
    throw InputError(key, reason, line_of(document, key.substr(0, key.find('['))));
  }
}

}  // namespace

Config read_config(const YamlNode& document, const std::filesystem::path& directory) {
  // What stands under the last three is for the program that runs the controller.
  static constexpr std::array<std::string_view, 11> kKeys = {
      "robot",    "control",  "gains",    "limits",     "motion",  "feed_forward",
      "watchdog", "analysis", "commands", "simulation", "scenario"};
  const YamlMapping root(document, "", kKeys);
  const RobotDescription robot = read_robot(root, directory);
  const RobotModel model = robot.model();
  Settings settings = default_settings(model);
  read_control(root, settings);
  read_gains(root, model, GainPairs::kTogether, settings.initial.gains);
  read_limits(root, model, settings.limits);
  read_motion(root, model, settings.period, settings.motion);
  read_feed_forward(root, settings.feed_forward);
  read_watchdog(root, settings.period, settings.watchdog);
  read_analysis(root, settings.analysis);
  check(settings, model.dof(), document);
  return {robot, model, settings};
}

Config load_config(const std::string& path) try {
  return read_config(parse_yaml(read_regular_file(path)),
                     std::filesystem::path(path).parent_path());
} catch (const InputError& error) {
  throw error.in_file(path);
}

}  // namespace dashpot::controller
