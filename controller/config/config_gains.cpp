#include <dashpot/controller/config.hpp>

#include <utility>

namespace dashpot::controller {
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
