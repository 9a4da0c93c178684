#include <dashpot/apps/check_model/written_arm.hpp>
#include <dashpot/apps/cli/output_file.hpp>
#include <dashpot/apps/cli/subcommands.hpp>
#include <dashpot/controller/drives.hpp>
#include <dashpot/text/printable.hpp>

#include <yaml-cpp/yaml.h>
#include <algorithm>
#include <chrono>
#include <cmath>
#include <filesystem>
#include <nlohmann/json.hpp>
#include <stdexcept>

namespace dashpot::apps {
namespace {

/// The end of the flow collection or quoted scalar that begins at `at`.
std::size_t end_of_bracket(const std::string& text, std::size_t at) {
  int depth = 0;
  char quote = 0;
  for (; at < text.size(); ++at) {
    const char c = text[at];
    if (quote != 0) {
      if (c == '\\' && quote == '"')
        ++at;
      else if (c == quote)
        quote = 0;
    } else if (c == '"' || c == '\'') {
      quote = c;
    } else if (c == '#' && at > 0 && (text[at - 1] == ' ' || text[at - 1] == '\n')) {
      at = text.find('\n', at);
      if (at == std::string::npos) break;
    } else if (c == '[' || c == '{') {
      ++depth;
    } else if (c == ']' || c == '}') {
      --depth;
    }
    if (depth == 0 && quote == 0) return at + 1;
  }
  throw std::invalid_argument("no end");
}

/// The end of the value that begins at `at`.
std::size_t end_of_value(const std::string& text, std::size_t at, bool in_flow) {
  if (at >= text.size()) throw std::invalid_argument("no value");
  if (std::string_view("[{\"'").find(text[at]) != std::string_view::npos) {
    return end_of_bracket(text, at);
  }
  if (std::string_view("-|>&*!").find(text[at]) != std::string_view::npos &&
      (at + 1 >= text.size() || text[at] != '-' || text[at + 1] == ' ')) {
    throw std::invalid_argument("no plain value");
  }
  std::size_t end = text.find('\n', at);
  end = std::min({end == std::string::npos ? text.size() : end, text.find(" #", at)});
  if (in_flow) end = std::min(end, text.find_first_of(",}]", at));
  while (end > at && (text[end - 1] == ' ' || text[end - 1] == '\r')) --end;
  return end;
}

bool is_flow(const std::string& text, const YAML::Node& map) {
  const int at = map.Mark().pos;
  return at >= 0 && static_cast<std::size_t>(at) < text.size() &&
         text[static_cast<std::size_t>(at)] == '{';
}

/// Changes one key in the text. Throws if it cannot.
void change(std::string& text, const ConfigChange& wanted) {
  YAML::Node node = YAML::Load(text);
  bool in_flow = is_flow(text, node);
  std::size_t depth = 0;
  for (; depth < wanted.path.size(); ++depth) {
    const YAML::Node next = node[wanted.path[depth]];
    if (!next.IsDefined()) break;
    if (depth + 1 < wanted.path.size() && !next.IsMap()) throw std::invalid_argument("no mapping");
    node.reset(next);
    if (node.IsMap()) in_flow = in_flow || is_flow(text, node);
  }
  const auto at = static_cast<std::size_t>(node.Mark().pos);
  if (depth == wanted.path.size()) {
    text.replace(at, end_of_value(text, at, in_flow) - at, wanted.value);
    return;
  }
  std::string entry = wanted.path[depth] + ": ", closing;
  for (++depth; depth < wanted.path.size(); ++depth) {
    entry += "{" + wanted.path[depth] + ": ";
    closing += "}";
  }
  entry += wanted.value + closing;
  if (is_flow(text, node)) {
    text.insert(at + 1, entry + (node.size() > 0 ? ", " : ""));
  } else {
    if (node.size() == 0) throw std::invalid_argument("nothing to stand before");
    text.insert(at, entry + "\n" + std::string(static_cast<std::size_t>(node.Mark().column), ' '));
  }
}

bool equal(const YAML::Node& a, const YAML::Node& b) {
  if (a.Type() != b.Type()) return false;
  if (a.IsScalar()) return a.Scalar() == b.Scalar();
  if (a.IsSequence()) {
    if (a.size() != b.size()) return false;
    for (std::size_t i = 0; i < a.size(); ++i) {
      if (!equal(a[i], b[i])) return false;
    }
  }
  if (a.IsMap()) {
    if (a.size() != b.size()) return false;
    for (const auto& entry : a) {
      const YAML::Node other = b[entry.first.Scalar()];
      if (!other.IsDefined() || !equal(entry.second, other)) return false;
    }
  }
  return true;
}

void set(YAML::Node node, const ConfigChange& wanted, std::size_t depth = 0) {
  if (depth + 1 == wanted.path.size()) {
    node.remove(wanted.path[depth]);  // otherwise the node that an alias names changes as well
    node[wanted.path[depth]] = YAML::Load(wanted.value);
  } else {
    set(node[wanted.path[depth]], wanted, depth + 1);
  }
}

}  // namespace

std::string changed_config(const std::string& text, const std::vector<ConfigChange>& changes,
                           bool& kept) {
  YAML::Node document = YAML::Load(text);
  for (const ConfigChange& one : changes) set(document, one);
  kept = true;
  try {
    std::string result = text;
    for (const ConfigChange& one : changes) change(result, one);
    if (equal(YAML::Load(result), document)) return result;
  } catch (const std::exception&) {  // treated like a wrong result
  }
  kept = false;
  YAML::Emitter emitter;
  emitter << document;
  return std::string(emitter.c_str()) + "\n";
}

std::string yaml_list(const Eigen::VectorXd& values) {
  std::string list;
  for (const double value : values) list += (list.empty() ? "" : ", ") + text::number(value, 5);
  return "[" + list + "]";
}

namespace {

/// The place of a figure in a check, in a model, and in YAML.
struct FigurePlace {
  Estimate JointCheck::*found;
  double Joint::*known;
  const char* key;
  std::string CheckModelReport::*unit;
};

FigurePlace place_of(ArmFigure figure) {
  switch (figure) {
    case ArmFigure::kReflectedInertia:
      return {&JointCheck::reflected_inertia, &Joint::reflected_inertia, "reflected_inertia",
              &CheckModelReport::inertia_unit};
    case ArmFigure::kViscousFriction:
      return {&JointCheck::viscous_friction, &Joint::viscous_friction, "viscous_friction",
              &CheckModelReport::damping_unit};
    case ArmFigure::kCoulombFriction:
      break;
  }
  return {&JointCheck::coulomb_friction, &Joint::coulomb_friction, "coulomb_friction",
          &CheckModelReport::torque_unit};
}

constexpr double kShown = 3;    // deviations: a rotor of less may be noise
constexpr double kRefutes = 4;  // deviations from what the configuration says

/// Whether the records contradict what the configuration says of a figure.
bool refutes(const Estimate& one, double known) {
  return known > 0 && std::isfinite(one.deviation) &&
         std::abs(one.value - known) > kRefutes * one.deviation;
}

/// Whether a figure is taken from the records: it is determined, or nearer than the configuration
/// is. No rotor at all is what torque sensors behind the gear show, and is not taken.
bool is_taken(const Estimate& one, double known, ArmFigure figure) {
  const bool shown = figure != ArmFigure::kReflectedInertia || one.value > kShown * one.deviation;
  return one.determined || (shown && refutes(one, known));
}

std::vector<ConfigChange> changes_for(const std::string& from_file, const std::string& to_file,
                                      const Config& config, const CheckModelReport& report) {
  const ModelCheck& check = report.check;
  std::vector<ConfigChange> changes = path_changes(from_file, to_file, config);
  for (const ArmFigure figure : kArmFigures) {
    if (figure == ArmFigure::kReflectedInertia && !report.calibrates) continue;
    const JointVector values = determined(config, check, figure);
    if (figure == ArmFigure::kReflectedInertia && values.isZero(0)) continue;
    changes.push_back({{"robot", place_of(figure).key}, yaml_list(values)});
    if (figure == ArmFigure::kReflectedInertia &&
        config.robot.options.torque_loop_inertia_ratio.size() >
            0) {  // which the inertias have in them
      changes.push_back(
          {{"robot", "torque_loop_inertia_ratio"}, yaml_list(JointVector::Ones(values.size()))});
    }
  }
  if (check.gravity) changes.push_back({{"robot", "gravity"}, yaml_list(*check.gravity)});
  if (const auto payload = determined_payload(check)) {
    const std::string mass = yaml_list(Eigen::VectorXd::Constant(1, payload->mass));
    changes.push_back({{"robot", "payload", "mass"}, mass.substr(1, mass.size() - 2)});
    changes.push_back({{"robot", "payload", "center"}, yaml_list(payload->center)});
  }
  if (report.loop.delay_found) {
    changes.push_back({{"analysis", "sampled", "delay"}, std::to_string(report.loop.delay)});
  }
  return changes;
}

std::string kept_rotor(std::size_t j, const Joint& joint, const Estimate& found) {
  const std::string unit = joint.type == controller::JointType::kPrismatic ? " kg" : " kg m^2";
  return "joint " + std::to_string(j + 1) + ": its reflected inertia stays " +
         text::number(joint.reflected_inertia, 3) + unit + " though the records show none (" +
         text::number(found.value, 2) + " +- " + text::number(found.deviation, 2) + unit +
         "), as torque sensors behind the gear do; if yours are on the motor's side, write 0";
}

}  // namespace

std::optional<double> found_figure(const Config& config, const ModelCheck& check, ArmFigure figure,
                                   std::size_t j) {
  const FigurePlace place = place_of(figure);
  const Estimate& one = check.joints[j].*place.found;
  if (!is_taken(one, config.model.joints()[j].*place.known, figure)) return std::nullopt;
  return std::max(0.0, one.value);
}

JointVector determined(const Config& config, const ModelCheck& check, ArmFigure figure) {
  JointVector result = config.model.joint_values(place_of(figure).known);
  for (std::size_t j = 0; j < check.joints.size(); ++j) {
    double& value = result[static_cast<Eigen::Index>(j)];
    value = found_figure(config, check, figure, j).value_or(value);
  }
  return result;
}

std::vector<std::string> kept_rotors(const Config& config, const CheckModelReport& report) {
  std::vector<std::string> kept;
  for (std::size_t j = 0; j < report.check.joints.size(); ++j) {
    const Estimate& one = report.check.joints[j].reflected_inertia;
    const Joint& joint = config.model.joints()[j];
    const double known = joint.reflected_inertia;
    if (is_taken(one, known, ArmFigure::kReflectedInertia) || !refutes(one, known)) continue;
    kept.push_back(kept_rotor(j, joint, one));
  }
  return kept;
}

std::vector<ConfigChange> path_changes(const std::string& from_file, const std::string& to_file,
                                       const Config& config) {
  namespace fs = std::filesystem;
  std::vector<ConfigChange> changes;
  const fs::path from = fs::absolute(from_file).parent_path().lexically_normal();
  const fs::path to = fs::absolute(to_file).parent_path().lexically_normal();
  if (from != to) {
    const std::string urdf = fs::relative(config.robot.urdf, to).generic_string();
    changes.push_back({{"robot", "urdf"}, nlohmann::json(urdf).dump()});
    const std::string& drives = config.robot.options.drives;
    if (controller::is_drives_file(drives)) {
      const std::string file = fs::relative(drives, to).generic_string();
      changes.push_back({{"robot", "drives"}, nlohmann::json(file).dump()});
    }
  }
  return changes;
}

std::optional<controller::Payload> determined_payload(const ModelCheck& check) {
  const identification::PayloadCheck& payload = check.payload;
  const bool center = std::all_of(payload.center.begin(), payload.center.end(),
                                  [](const Estimate& one) { return one.determined; });
  if (!payload.mass.determined || !center) return std::nullopt;
  controller::Payload result;
  result.mass = payload.mass.value;
  for (std::size_t i = 0; i < 3; ++i) {
    result.center[static_cast<Eigen::Index>(i)] = payload.center[i].value;
  }
  return result;
}

std::string origin(const Config& config, const CheckModelReport& report) {
  const auto today = std::chrono::floor<std::chrono::days>(std::chrono::system_clock::now());
  const std::chrono::year_month_day date(today);
  char day[40];
  std::snprintf(day, sizeof day, "%d-%02u-%02u", static_cast<int>(date.year()),
                static_cast<unsigned>(date.month()), static_cast<unsigned>(date.day()));
  std::string text = std::string("# dashpot calibrate, ") + day + ", from";
  for (const std::string& file : report.files) {
    text += " " + controller::one_line(std::filesystem::path(file).filename().string());
  }
  text += "\n# One standard deviation; ? was not determined and is as it was before:\n";
  for (const ArmFigure figure : kArmFigures) {
    const FigurePlace place = place_of(figure);
    text += std::string("#   ") + place.key + ":";
    for (std::size_t j = 0; j < report.check.joints.size(); ++j) {
      const Estimate& one = report.check.joints[j].*place.found;
      const bool found = found_figure(config, report.check, figure, j).has_value();
      text += found ? " " + text::number(one.deviation, 2) : " ?";
    }
    text += "\n";
  }
  if (report.loop.delay_found) {
    text += "#   delay: " + text::number(report.check.delay.deviation, 2) + " s\n";
  }
  for (const std::string& kept : kept_rotors(config, report)) text += "# " + kept + "\n";
  return text;
}

void refuse_doubtful(const std::string& option, const ModelCheck& check) {
  if (!check.order.empty()) {
    throw InputError(option, "nothing is written, because " + check.order.front());
  }
  if (check.gravity && !check.gravity_fits) {
    throw InputError(option,
                     "nothing is written, because no direction of robot.gravity fits: how is the "
                     "base inclined?");
  }
}

void write_text(const std::string& option, const std::string& path, const std::string& text) {
  OutputFile file(option, path);
  file.write(text);
  file.finish();
}

void write_config(const std::string& from, const std::string& to, const Config& config,
                  CheckModelReport& report) {
  refuse_doubtful("--write", report.check);
  bool kept = true;
  const std::string text =
      changed_config(text::read_regular_file(from), changes_for(from, to, config, report), kept);
  write_text("--write", to, (report.calibrates ? origin(config, report) : "") + text);
  if (!kept) report.notes.push_back("the comments of " + from + " were not kept");
}

void write_drives(const std::string& to, const Config& config, const CheckModelReport& report) {
  refuse_doubtful("--write-drives", report.check);
  std::string text = origin(config, report), missing;
  for (const ArmFigure figure : kArmFigures) {
    const FigurePlace place = place_of(figure);
    text += std::string(place.key) + ": " + yaml_list(determined(config, report.check, figure)) +
            "  # " + report.*place.unit + "\n";
  }
  for (std::size_t j = 0; j < report.joints.size(); ++j) {
    if (report.check.joints[j].reflected_inertia.determined) continue;
    missing += (missing.empty() ? "" : ", ") + std::to_string(j + 1);
  }
  std::string files = "dashpot calibrate, from";
  for (const std::string& file : report.files) files += " " + file;
  text += "source: " + nlohmann::json(files).dump() + "\n";
  if (!missing.empty()) text += "doubt: the rotors of joints " + missing + " are not determined\n";
  write_text("--write-drives", to, text);
}

}  // namespace dashpot::apps
