#include <dashpot/controller/base/settings_table.hpp>
#include <dashpot/controller/config.hpp>
#include <dashpot/controller/default_settings.hpp>
#include <dashpot/controller/settings_check.hpp>

#include <algorithm>
#include <cmath>
#include <map>
#include <utility>

namespace dashpot::controller {
namespace {

/// Returns the parts of a key before and after its last dot.
std::pair<std::string, std::string_view> split(std::string_view key) {
  const std::size_t dot = key.rfind('.');
  return {std::string(key.substr(0, dot)), key.substr(dot + 1)};
}

/// The keys in a section such as "limits" or "analysis.sampled", from the table and `rate`,
/// `walls`.
std::vector<std::string_view> keys_of(std::string_view section) {
  std::vector<std::string_view> keys;
  if (section == "control") keys.emplace_back("rate");
  if (section == "limits") keys.emplace_back("walls");
  const Settings none;
  for_each_setting(none, [&](const Setting& setting, const auto& /*value*/) {
    const std::string_view key = setting.key;
    if (!key.starts_with(section) || key[section.size()] != '.') return;
    const std::string_view rest = key.substr(section.size() + 1);
    const std::string_view next = rest.substr(0, rest.find('.'));
    if (std::find(keys.begin(), keys.end(), next) == keys.end()) keys.push_back(next);
  });
  return keys;
}

/// Reads settings from their sections of a document.
class SettingsReader {
 public:
  SettingsReader(const text::YamlMapping& root, const RobotModel& model)
      : root_(root), model_(model) {}

  /// The mapping of a section, empty if it is not there.
  const text::YamlMapping& section(const std::string& name) {
    const auto found = sections_.find(name);
    if (found != sections_.end()) return found->second;
    const auto [parent, last] = split(name);
    const text::YamlMapping& above = name.find('.') == std::string::npos ? root_ : section(parent);
    return sections_.emplace(name, above.mapping(last, keys_of(name))).first->second;
  }

  template <class Value>
  void operator()(const Setting& setting, Value& value) {
    const auto [name, key] = split(setting.key);
    read(section(name), key, setting, value);
  }

 private:
  static void read(const text::YamlMapping& keys, std::string_view key, const Setting& setting,
                   double& value) {
    read_number(keys, key, setting.unit, setting.range, value, setting.none);
  }
  static void read(const text::YamlMapping& keys, std::string_view key, const Setting& setting,
                   int& value) {
    read_count(keys, key, static_cast<int>(setting.range.least), value);
  }
  static void read(const text::YamlMapping& keys, std::string_view key, const Setting& /*setting*/,
                   bool& value) {
    read_switch(keys, key, value);
  }
  static void read(const text::YamlMapping& keys, std::string_view key, const Setting& /*setting*/,
                   Mode& value) {
    static constexpr std::array<std::pair<std::string_view, Mode>, 2> kModes = {
        {{"joint", Mode::kJoint}, {"cartesian", Mode::kCartesian}}};
    read_choice(keys, key, kModes, value);
  }
  static void read(const text::YamlMapping& keys, std::string_view key, const Setting& /*setting*/,
                   Analysis::Where& value) {
    static constexpr std::array<std::pair<std::string_view, Analysis::Where>, 3> kPlaces = {
        {{"off", Analysis::Where::kOff},
         {"inline", Analysis::Where::kInline},
         {"background", Analysis::Where::kBackground}}};
    read_choice(keys, key, kPlaces, value);
  }
  static void read(const text::YamlMapping& keys, std::string_view key, const Setting& /*setting*/,
                   FeedForward::FrictionAt& value) {
    static constexpr std::array<std::pair<std::string_view, FeedForward::FrictionAt>, 2> kAt = {
        {{"reference", FeedForward::FrictionAt::kReference},
         {"measured", FeedForward::FrictionAt::kMeasured}}};
    read_choice(keys, key, kAt, value);
  }
  static void read(const text::YamlMapping& keys, std::string_view key, const Setting& /*setting*/,
                   Load& value) {
    static constexpr std::array<std::pair<std::string_view, Load>, 4> kLoads = {
        {{"ignored", Load::kIgnored},
         {"base_wrench", Load::kBaseWrench},
         {"tool_wrench", Load::kToolWrench},
         {"joint_torques", Load::kJointTorques}}};
    read_choice(keys, key, kLoads, value);
  }
  static void read(const text::YamlMapping& keys, std::string_view key, const Setting& /*setting*/,
                   NullProjector& value) {
    read_choice(keys, key, kNullProjectors, value);
  }
  static void read(const text::YamlMapping& keys, std::string_view key, const Setting& /*setting*/,
                   Energy::From& value) {
    static constexpr std::array<std::pair<std::string_view, Energy::From>, 2> kSources = {
        {{"free", Energy::From::kFree}, {"tank", Energy::From::kTank}}};
    read_choice(keys, key, kSources, value);
  }
  static void read(const text::YamlMapping& keys, std::string_view key, const Setting& setting,
                   Vector6& value) {
    const std::string& linear = setting.unit;
    const std::string& angular = setting.prismatic;
    read_numbers(keys, key, {linear, linear, linear, angular, angular, angular}, setting.range,
                 value, setting.none);
  }
  void read(const text::YamlMapping& keys, std::string_view key, const Setting& setting,
            JointVector& value) const {
    const text::Units units = joint_units(model_, setting.unit, setting.prismatic);
    read_numbers(keys, key, units, setting.range, value, setting.none);
  }

  const text::YamlMapping& root_;
  const RobotModel& model_;
  std::map<std::string, text::YamlMapping> sections_;
};

/// The line of the value under a key such as "limits.torque". If the key is missing, the line of
/// the nearest key above it, or 0 if it has to be `exactly` there.
int line_of(const text::YamlNode& root, const std::string& key, bool exactly = false) {
  const text::YamlNode* node = &root;
  int line = 0;
  for (std::size_t begin = 0; begin < key.size();) {
    const std::size_t end = std::min(key.find('.', begin), key.size());
    const auto item = std::find_if(
        node->items.begin(), node->items.end(),
        [&](const text::YamlNode& one) { return one.text == key.substr(begin, end - begin); });
    if (node->kind != text::YamlNode::Kind::kMap || item == node->items.end()) {
      return exactly ? 0 : line;
    }
    node = &*std::next(item);
    line = node->line;
    begin = end + 1;
  }
  return line;
}

/// Refuses keys that limits.stopping_time replaces.
void refuse_replaced(const text::YamlNode& document) {
  for (const char* key : {"damping", "position_margin", "repulsion", "return_velocity"}) {
    const std::string name = std::string("limits.") + key;
    const int line = line_of(document, name, true);
    if (line > 0) throw InputError(name, "is gone: limits.stopping_time replaces it", line);
  }
}

/// The period, and the defaults that depend on it.
void read_period(const text::YamlMapping& control, Settings& settings) {
  constexpr double kGap = 2.5;  // periods
  if (control.has("period") && control.has("rate")) {
    throw control.error("rate", "stands beside period, which says the same");
  }
  read_number(control, "period", "s", text::kPositive, settings.period);
  if (control.has("rate")) {
    double rate = 0;
    read_number(control, "rate", "Hz", text::kPositive, rate);
    settings.period = 1 / rate;
  }
  Motion& motion = settings.motion;
  motion.smoothing = std::min(motion.smoothing, kMostSmoothing * settings.period);  // of fast loops
  Watchdog& watchdog = settings.watchdog;
  watchdog.longest_gap = std::max(watchdog.longest_gap, kGap * settings.period);  // of slow loops
}

void read_walls(const text::YamlMapping& limits, std::vector<Wall>& walls) {
  static constexpr auto kKeys = text::key_list("point", "normal");
  const text::YamlNode* list = limits.find("walls");
  if (list == nullptr) return;
  if (list->kind != text::YamlNode::Kind::kSequence) {
    throw limits.error("walls", "a list is wanted, not " + describe(*list));
  }
  walls.clear();
  for (std::size_t i = 0; i < list->items.size(); ++i) {
    const text::YamlMapping keys(list->items[i], "limits.walls[" + std::to_string(i + 1) + "].",
                                 kKeys);
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

/// "gains.joint.stiffness" for the setting "initial.gains.joint_stiffness", and so on.
std::string key_of_setting(std::string setting) {
  static constexpr std::array<std::pair<std::string_view, std::string_view>, 3> kNames = {
      {{"initial.gains.joint_", "gains.joint."},
       {"initial.gains.null_", "gains.null_space."},
       {"initial.gains.task_", "gains.task."}}};
  for (const auto& [begin, key] : kNames) {
    if (setting.starts_with(begin)) return setting.replace(0, begin.size(), key);
  }
  if (setting.starts_with("initial.gains.")) return "gains.task." + setting.substr(14);
  return setting;
}

/// Throws an InputError about the first setting that the controller would refuse, in either mode.
void check(const Settings& settings, const RobotModel& model, const text::YamlNode& document) {
  Settings other = settings;
  other.initial.mode = settings.initial.mode == Mode::kJoint ? Mode::kCartesian : Mode::kJoint;
  try {
    validate(settings, model);
    validate(other, model);
  } catch (const InvalidSettings& error) {
    const std::string key = key_of_setting(error.key());
    std::string reason = error.what();
    if (reason.starts_with(error.key() + ": ")) reason.erase(0, error.key().size() + 2);
    throw InputError(key, reason, line_of(document, key.substr(0, key.find('['))));
  }
}

/// Names gains that do nothing in the initial mode, and may have been meant for it.
std::vector<std::string> unused(const text::YamlNode& document, Mode mode) {
  const bool joint = mode == Mode::kJoint;
  const std::string used = joint ? "gains.joint" : "gains.task";
  const std::string other = joint ? "gains.task" : "gains.joint";
  const int line = line_of(document, other, true);
  if (line == 0 || line_of(document, used, true) > 0) return {};
  return {other + " (line " + std::to_string(line) + ") does nothing in control.mode: " +
          (joint ? "joint" : "cartesian") + ", in which the default " + used + " acts: is " +
          "control.mode: " + (joint ? "cartesian" : "joint") + " meant?"};
}

}  // namespace

Config read_config(const text::YamlNode& document, const std::filesystem::path& directory) {
  refuse_replaced(document);
  const text::YamlMapping root(document, "", kConfigSections);
  const RobotDescription robot = read_robot(root, directory);
  const RobotModel model = robot.model();
  Settings settings = default_settings(model);
  SettingsReader reader(root, model);
  read_period(reader.section("control"), settings);
  read_gains(root, model, GainPairs::kTogether, settings.initial.gains);
  for_each_setting(settings, reader);
  read_walls(reader.section("limits"), settings.limits.walls);
  check(settings, model, document);
  return {robot, model, settings, unused(document, settings.initial.mode)};
}

void read_null_projector(const text::YamlMapping& root, const RobotModel& model,
                         NullProjector& projector, JointVector& weights) {
  Settings settings;
  settings.null_weights.setOnes(model.dof());
  SettingsReader reader(root, model);
  for_each_setting(settings, [&](const Setting& setting, auto& value) {
    if (std::string_view(setting.key).starts_with("control.null_")) reader(setting, value);
  });
  projector = settings.initial.gains.null_projector;
  weights = settings.null_weights;
}

Config load_config(const std::string& path) try {
  return read_config(text::parse_yaml(text::read_regular_file(path)),
                     std::filesystem::path(path).parent_path());
} catch (const InputError& error) {
  throw error.in_file(path);
}

namespace {

text::Units task_units(const char* linear, const char* angular) {
  return {linear, linear, linear, angular, angular, angular};
}

/// Damping suits only its own stiffness, so that both are required together; a damping ratio suits
/// any.
void require_pair(const text::YamlMapping& keys) {
  for (const auto& [key, other] : {std::pair("stiffness", "damping"), {"damping", "stiffness"}}) {
    if (keys.has(key) && !keys.has(other) && !keys.has("damping_ratio")) {
      throw keys.error(other, std::string("missing; it goes with ") + key, keys.line(key));
    }
  }
}

/// Reads `damping_ratio`, which excludes `damping`, read before.
void read_ratio(const text::YamlMapping& keys, double& ratio) {
  if (keys.has("damping")) ratio = 0;
  if (!keys.has("damping_ratio")) return;
  if (keys.has("damping")) {
    throw keys.error("damping_ratio", "stands beside damping; give only one of them");
  }
  read_number(keys, "damping_ratio", "", {0, false, kLargestDampingRatio}, ratio);
}

void read_directions(const text::YamlMapping& task, std::array<bool, 6>& directions) {
  static constexpr auto kWords = text::key_list("x", "y", "z", "rx", "ry", "rz");
  const text::YamlNode* node = task.find("directions");
  if (node == nullptr) return;
  if (node->kind != text::YamlNode::Kind::kSequence) {
    throw task.error("directions", "a list is wanted, not " + describe(*node));
  }
  directions = {};
  for (std::size_t i = 0; i < node->items.size(); ++i) {
    const std::string place = "entry " + std::to_string(i + 1);
    bool& held = directions[find_word(task, "directions", node->items[i], kWords, place)];
    if (held) throw task.error("directions", place + " is given twice", node->items[i].line);
    held = true;
  }
}

}  // namespace

void read_gains(const text::YamlMapping& parent, const RobotModel& model, GainPairs pairs,
                Gains& gains) {
  static constexpr auto kKeys = text::key_list("joint", "task", "null_space");
  static constexpr auto kJointKeys = text::key_list("stiffness", "damping", "damping_ratio");
  static constexpr auto kTaskKeys =
      text::key_list("stiffness", "damping", "damping_ratio", "frame", "directions");
  const text::YamlMapping keys = parent.mapping("gains", kKeys);
  const auto require = [pairs](const text::YamlMapping& part) {
    if (pairs == GainPairs::kTogether) require_pair(part);
  };
  const text::Units stiffness = joint_units(model, "N m/rad", "N/m");
  const text::Units damping = joint_units(model, "N m s/rad", "N s/m");

  const text::YamlMapping joint = keys.mapping("joint", kJointKeys);
  require(joint);
  read_matrix(joint, "stiffness", stiffness, gains.joint_stiffness);
  read_matrix(joint, "damping", damping, gains.joint_damping);
  read_ratio(joint, gains.joint_damping_ratio);

  const text::YamlMapping task = keys.mapping("task", kTaskKeys);
  require(task);
  read_matrix(task, "stiffness", task_units("N/m", "N m/rad"), gains.task_stiffness);
  read_matrix(task, "damping", task_units("N s/m", "N m s/rad"), gains.task_damping);
  read_ratio(task, gains.task_damping_ratio);
  static constexpr std::array<std::pair<std::string_view, Frame>, 2> kFrames = {
      {{"base", Frame::kBase}, {"tool", Frame::kTool}}};
  read_choice(task, "frame", kFrames, gains.frame);
  read_directions(task, gains.directions);

  const text::YamlMapping null_space = keys.mapping("null_space", kJointKeys);
  require(null_space);
  read_numbers(null_space, "stiffness", stiffness, text::kNotNegative, gains.null_stiffness);
  read_numbers(null_space, "damping", damping, text::kNotNegative, gains.null_damping);
  read_ratio(null_space, gains.null_damping_ratio);
}

Gains read_gains(const text::YamlMapping& parent, const RobotModel& model) {
  const int n = model.dof();
  Gains gains;
  gains.joint_stiffness = gains.joint_damping = JointMatrix::Zero(n, n);
  gains.null_stiffness = gains.null_damping = JointVector::Zero(n);
  read_gains(parent, model, GainPairs::kEither, gains);
  return gains;
}

}  // namespace dashpot::controller
