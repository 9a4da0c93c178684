#include <dashpot/apps/check_model/written_arm.hpp>
#include <dashpot/apps/check_model/written_model.hpp>
#include <dashpot/apps/cli/subcommands.hpp>
#include <dashpot/text/printable.hpp>
#include <dashpot/text/read_file.hpp>
#include <dashpot/text/xml_check.hpp>

#include <algorithm>
#include <map>
#include <vector>

namespace dashpot::apps {
namespace {

using controller::Config;
using text::XmlTag;

/// Attributes of an element, by name.
using Attributes = std::vector<std::pair<std::string, std::string>>;

/// Changes of a text, by where they are: how many bytes are replaced, and by what.
using TextChanges = std::multimap<std::size_t, std::pair<std::size_t, std::string>>;

std::string_view attribute(const XmlTag& tag, std::string_view name) {
  for (const auto& [key, value] : tag.attributes) {
    if (key == name) return value;
  }
  return {};
}

/// Returns the figures found of joint j as attributes; `names` in the order of ArmFigure.
Attributes found_attributes(const Config& config, const CheckModelReport& report, std::size_t j,
                            const std::array<const char*, kArmFigures.size()>& names) {
  Attributes found;
  for (std::size_t i = 0; i < names.size(); ++i) {
    const auto value = found_figure(config, report.check, kArmFigures[i], j);
    if (value) found.emplace_back(names[i], text::number(*value, 5));
  }
  return found;
}

std::string written(const Attributes& attributes) {
  std::string text;
  for (const auto& [name, value] : attributes) {
    text.append(" ").append(name).append("=\"").append(value).append("\"");
  }
  return text;
}

InputError missing_joint(const std::string& mjcf, const std::string& name) {
  return {"--mjcf", mjcf + ": has no joint '" + name + "' in this file"};
}

InputError ambiguous_joint(const std::string& mjcf, const std::string& name, const std::string& one,
                           const std::string& other) {
  return {"--mjcf", mjcf + ": joint '" + name + "' may be '" + one + "' or '" + other + "'"};
}

/// Has the attributes of a tag replaced or added.
void set_attributes(const std::string& text, const XmlTag& tag, const Attributes& attributes,
                    TextChanges& changes) {
  const auto place = [&](std::string_view part) {
    return static_cast<std::size_t>(part.data() - text.data());
  };
  for (const auto& one : attributes) {
    const std::string_view old = attribute(tag, one.first);
    if (old.data() != nullptr) {
      changes.emplace(place(old), std::pair(old.size(), one.second));
    } else {
      changes.emplace(place(tag.name) + tag.name.size(), std::pair(0, written({one})));
    }
  }
}

/// The comment of the file, before its first element.
void add_origin(const std::string& text, const XmlTag& root, std::string origin,
                TextChanges& changes) {
  for (std::size_t at = 0; (at = origin.find("--", at)) != std::string::npos;) {
    origin.replace(at, 2, "- -");  // two hyphens end a comment
  }
  const auto at = static_cast<std::size_t>(root.name.data() - text.data()) - 1;
  changes.emplace(at, std::pair(0, "<!--\n" + origin + "-->\n"));
}

TextChanges urdf_changes(const std::string& text, const Config& config,
                         const CheckModelReport& report) {
  static constexpr std::array kNames = {"reflected_inertia", "damping", "friction"};
  TextChanges changes;
  Attributes open;  // of the joint that is open, and not written yet
  text::check_xml(text, [&](const XmlTag& tag) {
    if (tag.depth == 0 && tag.starts) add_origin(text, tag, origin(config, report), changes);
    const bool joint = tag.depth == 1 && tag.name == "joint";
    if (joint && tag.starts) {
      const auto at = std::find(report.joints.begin(), report.joints.end(), attribute(tag, "name"));
      if (at != report.joints.end()) {
        const auto j = static_cast<std::size_t>(at - report.joints.begin());
        open = found_attributes(config, report, j, kNames);
      }
    } else if (joint && !open.empty()) {
      const auto end = static_cast<std::size_t>(tag.name.data() - text.data()) - 2;  // of "</"
      changes.emplace(end, std::pair(0, "  <dynamics" + written(open) + "/>\n  "));
      open.clear();
    } else if (tag.depth == 2 && tag.name == "dynamics" && tag.starts) {
      set_attributes(text, tag, open, changes);
      open.clear();
    }
  });
  return changes;
}

/// The joint of the arm that an MJCF joint is: of the same name, or else of a name that ends with
/// the other.
bool is_same(const std::string& arm, const std::string& other) {
  return arm.ends_with(other) || other.ends_with(arm);
}

TextChanges mjcf_changes(const std::string& text, const std::string& mjcf, const Config& config,
                         const CheckModelReport& report) {
  static constexpr std::array kNames = {"armature", "damping", "frictionloss"};
  TextChanges changes;
  std::map<std::string, XmlTag> joints;
  bool in_world = false;
  text::check_xml(text, [&](const XmlTag& tag) {
    if (tag.depth == 0 && tag.starts) {
      if (tag.name != "mujoco") throw InputError("--mjcf", mjcf + ": is not a MuJoCo model");
      add_origin(text, tag, origin(config, report), changes);
    }
    if (tag.depth == 1) in_world = tag.name == "worldbody" && tag.starts;
    const std::string name(attribute(tag, "name"));
    if (in_world && tag.starts && tag.name == "joint" && !name.empty()) joints.emplace(name, tag);
  });
  for (std::size_t j = 0; j < report.joints.size(); ++j) {
    const std::string& name = report.joints[j];
    auto found = joints.find(name);
    for (auto at = joints.begin(); at != joints.end() && !joints.contains(name); ++at) {
      if (!is_same(name, at->first)) continue;
      if (found != joints.end()) {
        throw ambiguous_joint(mjcf, name, found->first, at->first);
      }
      found = at;
    }
    if (found == joints.end()) throw missing_joint(mjcf, name);
    set_attributes(text, found->second, found_attributes(config, report, j, kNames), changes);
  }
  return changes;
}

}  // namespace

bool is_model_file(const std::string& name) {
  return name.ends_with(".urdf") || name.ends_with(".xml");
}

void write_model(const std::string& to, const std::string& mjcf, const Config& config,
                 const CheckModelReport& report) {
  refuse_doubtful("--write", report.check);
  const bool urdf = to.ends_with(".urdf");
  const std::string from = urdf ? config.robot.urdf : mjcf;
  std::string text = text::read_file(from, text::kLargestXml);
  const TextChanges changes =
      urdf ? urdf_changes(text, config, report) : mjcf_changes(text, mjcf, config, report);
  for (auto change = changes.rbegin(); change != changes.rend(); ++change) {
    text.replace(change->first, change->second.first, change->second.second);
  }
  write_text("--write", to, text);
}

}  // namespace dashpot::apps
