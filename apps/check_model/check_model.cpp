#include <dashpot/apps/check_model/calibrated_modes.hpp>
#include <dashpot/apps/check_model/check_model_report.hpp>
#include <dashpot/apps/check_model/suggested_motion.hpp>
#include <dashpot/apps/check_model/torque_file.hpp>
#include <dashpot/apps/check_model/written_arm.hpp>
#include <dashpot/apps/cli/output_file.hpp>
#include <dashpot/apps/cli/subcommands.hpp>
#include <dashpot/apps/cli/terminal.hpp>
#include <dashpot/apps/report/json.hpp>
#include <dashpot/controller/config.hpp>
#include <dashpot/controller/drives.hpp>
#include <dashpot/controller/rotors.hpp>
#include <dashpot/text/printable.hpp>
#include <dashpot/text/read_file.hpp>
#include <dashpot/text/xml_check.hpp>

#include <CLI/CLI.hpp>
#include <algorithm>
#include <cmath>
#include <map>
#include <memory>
#include <nlohmann/json.hpp>
#include <string>
#include <vector>

namespace dashpot::apps {

using text::XmlTag;

namespace {

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

/// True if the name is one of a URDF or MJCF file: ends with .urdf or .xml.
bool is_model_file(const std::string& name) {
  return name.ends_with(".urdf") || name.ends_with(".xml");
}

/// Writes a robot description with the rotors and friction of joints that were found, and a comment
/// with date, records and deviations; all else stays as it was. To a .urdf goes the URDF of the
/// configuration, with the attributes damping, friction and reflected_inertia of dynamics; to a
/// .xml the MuJoCo model `mjcf`, with armature, damping and frictionloss of joints of the same
/// names, or of names that are the end of the other. Throws InputError.
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

struct CheckModelOptions {
  std::vector<std::string> files;
  std::string config, positions, torques, write, write_drives, mjcf, suggest, payload = "fitted";
  FileHints hints;
  double validation = 0;
  bool calibrates = false, json = false;
};

/// Finds mean and range of the positions of records.
void find_postures(const std::vector<identification::TorqueRecord>& records,
                   CheckModelReport& report) {
  JointVector sum = JointVector::Zero(records.front().position.rows());
  double count = 0;
  for (const identification::TorqueRecord& record : records) {
    for (const auto& position : record.position.colwise()) {
      if (!position.allFinite()) continue;
      report.lowest = count == 0 ? JointVector(position) : report.lowest.cwiseMin(position);
      report.highest = count == 0 ? JointVector(position) : report.highest.cwiseMax(position);
      sum += position, ++count;
    }
  }
  report.rest = sum / std::max(1.0, count);
}

/// Notes rotors that are kept against the records, and why records may show none.
void note_rotors(const Config& config, CheckModelReport& report) {
  for (std::string& kept : kept_rotors(config, report)) report.notes.push_back(std::move(kept));
  int seen = 0, unknown = 0;
  for (const identification::JointCheck& joint : report.check.joints) {
    if (!joint.moves || !std::isfinite(joint.reflected_inertia.deviation)) continue;
    ++seen;
    unknown += joint.reflected_inertia.determined ? 0 : 1;
  }
  const controller::Drives* like = controller::drives_like(config.model);
  const bool behind =
      like != nullptr && (like->name.starts_with("panda") || like->name.starts_with("fr3") ||
                          like->name.starts_with("iiwa"));
  if (unknown == 0 || (unknown < seen && !behind)) return;
  report.notes.emplace_back(
      "torque sensors behind the gears, as in Panda, FR3 and iiwa, hardly see rotors: ask the "
      "maker "
      "for undetermined ones, or take public values (robot.drives)");
}

CheckModelReport check_files(const CheckModelOptions& options, const Config& config) {
  const EndOnSignal at_once("check-model");
  CheckModelReport report;
  std::vector<identification::TorqueRecord> records;
  for (const std::string& path : options.files) {
    show_progress(
        static_cast<double>(report.files.size()) / static_cast<double>(options.files.size() + 1),
        "reading " + path);
    TorqueFile file =
        read_torque_file(path, config.model, options.positions, options.torques, options.hints);
    for (const std::string& note : file.notes) {
      report.notes.push_back(path);
      report.notes.back().append(": ").append(note);
    }
    records.push_back(std::move(file.record));
    report.files.push_back(path);
  }
  for (const Joint& joint : config.model.joints()) report.joints.push_back(joint.name);
  report.torque_unit = controller::unit_text(config.model, "N m", "N");
  report.damping_unit = controller::unit_text(config.model, "N m s/rad", "N s/m");
  report.inertia_unit = controller::unit_text(config.model, "kg m^2", "kg");
  report.calibrates = options.calibrates;
  show_progress(
      static_cast<double>(report.files.size()) / static_cast<double>(options.files.size() + 1),
      "comparing torques");
  try {
    report.payload_known = options.payload == "known";
    report.check = identification::check_model(config.robot, records,
                                               {options.validation, report.payload_known});
    if (options.calibrates && report.check.order.empty()) {
      find_postures(records, report);
      try {
        report.loop = calibrated_loop(config, report.check, report.rest);
      } catch (const std::invalid_argument& error) {
        report.notes.push_back(std::string("no modes of the calibrated loop: ") + error.what());
      }
      note_rotors(config, report);
    }
  } catch (const controller::InvalidModel&) {
    throw;
  } catch (const std::invalid_argument& error) {
    throw InputError(options.files.front(), error.what());
  }
  return report;
}

void add_command(CLI::App* command, bool calibrates) {
  const auto options = std::make_shared<CheckModelOptions>();
  options->calibrates = calibrates;
  command->add_option("FILE", options->files, "Records: LCM logs or CSV files")->required();
  command->add_option("--config", options->config, "Configuration with the model of the arm")
      ->option_text("CONFIG")
      ->required();
  command
      ->add_option("--positions", options->positions,
                   "Columns of the joints' positions, in the model's order")
      ->option_text("NAME,...");
  command
      ->add_option("--torques", options->torques,
                   "Columns of the joints' torques, in the model's order")
      ->option_text("NAME,...");
  command
      ->add_option("--rate", options->hints.rate,
                   "Samples in a second, of files without a column of time")
      ->option_text("HZ")
      ->check(CLI::Range(1e-9, 1e9));
  command
      ->add_option("--columns", options->hints.columns,
                   "Names and units of all columns, of files without a line of them")
      ->option_text("NAME,...");
  command
      ->add_option(
          "--write", options->write,
          calibrates
              ? "The configuration with all that was determined; or, by its ending, the "
                "robot's URDF (.urdf) or MuJoCo model (.xml, --mjcf) with rotors and friction"
              : "The configuration with the friction and the payload that were found")
      ->option_text("CONFIG");
  if (calibrates) {
    options->validation = 0.2;
    command
        ->add_option("--write-drives", options->write_drives,
                     "Rotors and friction as a file for --drives and robot.drives")
        ->option_text("FILE.yaml");
    command
        ->add_option("--suggest-motion", options->suggest,
                     "The configuration with goals that determine what the records do not, for "
                     "dashpot run, or dashpot drive --scenario")
        ->option_text("SCENE.yaml");
    command
        ->add_option("--mjcf", options->mjcf,
                     "MuJoCo model of the arm, of which --write FILE.xml makes a copy")
        ->option_text("FROM.xml");
    command
        ->add_option("--validate", options->validation,
                     "Share of each record, its end, on which the fit is judged (0.2)")
        ->option_text("SHARE")
        ->check(CLI::Range(0.0, 0.5));
    command
        ->add_option("--payload", options->payload,
                     "Whether the configuration's payload is exact: then wrist rotors can be found")
        ->check(CLI::IsMember({"fitted", "known"}))
        ->option_text("fitted|known (fitted)");
  }
  command->add_flag("--json", options->json, "Print one JSON object");
  command->footer(
      "FILE has positions and torques of all joints of an arm in ordinary motion, fast or slow.\n"
      "Several files are one experiment. Velocities are not needed.\n" +
      std::string(kExitStatusHelp));
  command->callback([options] {
    std::vector<NamedFile> inputs = {{"--config", options->config}, {"--mjcf", options->mjcf}};
    add_records(options->files, inputs);
    check_outputs({{"--write", options->write},
                   {"--write-drives", options->write_drives},
                   {"--suggest-motion", options->suggest}},
                  inputs);
    if (!options->write_drives.empty() && !controller::is_drives_file(options->write_drives)) {
      throw InputError("--write-drives", "the name has to end with .yaml");
    }
    const bool to_mjcf = options->calibrates && options->write.ends_with(".xml");
    if (!to_mjcf && !options->mjcf.empty()) {
      throw InputError("--mjcf", "is for --write FILE.xml");
    }
    const Config config = controller::load_config(options->config);
    if (to_mjcf && options->mjcf.empty()) {
      throw InputError("--write", "the robot comes from a URDF, " + config.robot.urdf +
                                      ": end the name with .urdf, or name the MuJoCo model of the "
                                      "arm with --mjcf");
    }
    if (!options->calibrates && is_model_file(options->write)) {
      throw InputError("--write", "robot descriptions are written by dashpot calibrate");
    }
    const bool to_model = options->calibrates && is_model_file(options->write);
    check_outputs({{"--write", options->write}}, {{"the robot description", config.robot.urdf}});
    CheckModelReport report = check_files(*options, config);
    if (!options->suggest.empty()) {
      suggest_motion(options->config, options->suggest, config, report);
    }
    if (to_model) {
      write_model(options->write, options->mjcf, config, report);
    } else if (!options->write.empty()) {
      write_config(options->config, options->write, config, report);
    }
    if (!options->write_drives.empty()) write_drives(options->write_drives, config, report);
    print(options->json ? json_text(check_model_json(report)) : check_model_table(report));
  });
}

}  // namespace

void add_check_model(CLI::App& program) {
  add_command(
      program.add_subcommand(
          "check-model", "What measured torques say of the model, of friction and of the payload"),
      false);
}

void add_calibrate(CLI::App& program) {
  add_command(
      program.add_subcommand("calibrate",
                             "Rotors, friction, payload and delay of an arm from ordinary motion"),
      true);
}

}  // namespace dashpot::apps
