#include <dashpot/apps/check_model/calibrated_modes.hpp>
#include <dashpot/apps/check_model/check_model_report.hpp>
#include <dashpot/apps/check_model/suggested_motion.hpp>
#include <dashpot/apps/check_model/torque_file.hpp>
#include <dashpot/apps/check_model/written_arm.hpp>
#include <dashpot/apps/check_model/written_model.hpp>
#include <dashpot/apps/cli/output_file.hpp>
#include <dashpot/apps/cli/subcommands.hpp>
#include <dashpot/apps/cli/terminal.hpp>
#include <dashpot/apps/report/json.hpp>
#include <dashpot/controller/config.hpp>
#include <dashpot/controller/drives.hpp>
#include <dashpot/controller/rotors.hpp>

#include <CLI/CLI.hpp>
#include <algorithm>
#include <cmath>
#include <memory>
#include <nlohmann/json.hpp>

namespace dashpot::apps {
namespace {

using controller::Config;
using controller::Joint;
using controller::JointVector;

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
