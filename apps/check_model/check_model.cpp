#include <dashpot/apps/check_model/calibrated_modes.hpp>
#include <dashpot/apps/check_model/check_model_report.hpp>
#include <dashpot/apps/check_model/torque_file.hpp>
#include <dashpot/apps/check_model/written_arm.hpp>
#include <dashpot/apps/cli/output_file.hpp>
#include <dashpot/apps/cli/subcommands.hpp>
#include <dashpot/apps/cli/terminal.hpp>
#include <dashpot/apps/report/json.hpp>
#include <dashpot/controller/config.hpp>
#include <dashpot/controller/drives.hpp>

#include <CLI/CLI.hpp>
#include <algorithm>
#include <memory>
#include <nlohmann/json.hpp>

namespace dashpot::apps {
namespace {

using controller::Config;
using controller::Joint;
using controller::JointVector;

struct CheckModelOptions {
  std::vector<std::string> files;
  std::string config, positions, torques, write, write_drives, payload = "fitted";
  FileHints hints;
  double validation = 0;
  bool calibrates = false, json = false;
};

/// Returns the mean posture of records.
JointVector rest_of(const std::vector<identification::TorqueRecord>& records) {
  JointVector sum = JointVector::Zero(records.front().position.rows());
  double count = 0;
  for (const identification::TorqueRecord& record : records) {
    for (const auto& position : record.position.colwise()) {
      if (position.allFinite()) sum += position, ++count;
    }
  }
  return sum / std::max(1.0, count);
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
  for (const Joint& joint : config.model.joints()) {
    report.joints.push_back(joint.name);
    report.slides.push_back(joint.type == controller::JointType::kPrismatic);
  }
  report.calibrates = options.calibrates;
  show_progress(
      static_cast<double>(report.files.size()) / static_cast<double>(options.files.size() + 1),
      "comparing torques");
  try {
    report.check = identification::check_model(config.robot, records,
                                               {options.validation, options.payload == "known"});
    if (options.calibrates && report.check.order.empty()) {
      report.rest = rest_of(records);
      report.loop = calibrated_loop(config, report.check, report.rest);
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
      ->add_option("--write", options->write,
                   calibrates
                       ? "The configuration with all that was determined"
                       : "The configuration with the friction and the payload that were found")
      ->option_text("CONFIG");
  if (calibrates) {
    options->validation = 0.2;
    command
        ->add_option("--write-drives", options->write_drives,
                     "Rotors and friction as a file for --drives and robot.drives")
        ->option_text("FILE.yaml");
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
    std::vector<NamedFile> inputs = {{"--config", options->config}};
    add_records(options->files, inputs);
    check_outputs({{"--write", options->write}, {"--write-drives", options->write_drives}}, inputs);
    if (!options->write_drives.empty() && !controller::is_drives_file(options->write_drives)) {
      throw InputError("--write-drives", "the name has to end with .yaml");
    }
    const Config config = controller::load_config(options->config);
    CheckModelReport report = check_files(*options, config);
    if (!options->write.empty()) write_config(options->config, options->write, config, report);
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
