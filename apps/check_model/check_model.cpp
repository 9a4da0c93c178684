#include <dashpot/apps/check_model/check_model_report.hpp>
#include <dashpot/apps/check_model/config_change.hpp>
#include <dashpot/apps/check_model/torque_file.hpp>
#include <dashpot/apps/cli/output_file.hpp>
#include <dashpot/apps/cli/subcommands.hpp>
#include <dashpot/apps/cli/terminal.hpp>
#include <dashpot/apps/report/json.hpp>
#include <dashpot/controller/config.hpp>

#include <CLI/CLI.hpp>
#include <algorithm>
#include <cmath>
#include <filesystem>
#include <memory>
#include <nlohmann/json.hpp>

namespace dashpot::apps {
namespace {

using controller::Config;
using controller::Joint;
using controller::JointVector;
using identification::Estimate;
using identification::JointCheck;
using identification::ModelCheck;

struct CheckModelOptions {
  std::vector<std::string> files;
  std::string config, positions, torques, write;
  FileHints hints;
  bool json = false;
};

std::string yaml_list(const Eigen::VectorXd& values) {
  std::string text;
  for (const double value : values) {
    char number[40];
    std::snprintf(number, sizeof number, "%.5g", value);
    text += (text.empty() ? "" : ", ") + std::string(number);
  }
  return "[" + text + "]";
}

/// Friction that the records determine, and the configuration's elsewhere; nothing below zero.
Eigen::VectorXd friction(const ModelCheck& check, Estimate JointCheck::*which,
                         const JointVector& before) {
  Eigen::VectorXd result = before;
  for (std::size_t j = 0; j < check.joints.size(); ++j) {
    const Estimate& one = check.joints[j].*which;
    if (one.determined) result[static_cast<Eigen::Index>(j)] = std::max(0.0, one.value);
  }
  return result;
}

std::vector<ConfigChange> changes_for(const CheckModelOptions& options, const Config& config,
                                      const ModelCheck& check) {
  namespace fs = std::filesystem;
  std::vector<ConfigChange> changes = {
      {{"robot", "viscous_friction"},
       yaml_list(friction(check, &JointCheck::viscous_friction,
                          config.model.joint_values(&Joint::viscous_friction)))},
      {{"robot", "coulomb_friction"},
       yaml_list(friction(check, &JointCheck::coulomb_friction,
                          config.model.joint_values(&Joint::coulomb_friction)))}};
  if (check.gravity) changes.push_back({{"robot", "gravity"}, yaml_list(*check.gravity)});
  const identification::PayloadCheck& payload = check.payload;
  const bool center = std::all_of(payload.center.begin(), payload.center.end(),
                                  [](const Estimate& one) { return one.determined; });
  if (payload.mass.determined && center) {
    const Eigen::Vector3d at(payload.center[0].value, payload.center[1].value,
                             payload.center[2].value);
    const std::string mass = yaml_list(Eigen::VectorXd::Constant(1, payload.mass.value));
    changes.push_back({{"robot", "payload", "mass"}, mass.substr(1, mass.size() - 2)});
    changes.push_back({{"robot", "payload", "center"}, yaml_list(at)});
  }
  const fs::path from = fs::absolute(options.config).parent_path().lexically_normal();
  const fs::path to = fs::absolute(options.write).parent_path().lexically_normal();
  if (from != to) {
    const std::string urdf = fs::relative(config.robot.urdf, to).generic_string();
    changes.push_back({{"robot", "urdf"}, nlohmann::json(urdf).dump()});
  }
  return changes;
}

/// Writes the configuration, and notes what was not kept.
void write_config(const CheckModelOptions& options, const Config& config,
                  CheckModelReport& report) {
  const ModelCheck& check = report.check;
  if (!check.order.empty()) {
    throw InputError("--write", "nothing is written, because " + check.order.front());
  }
  if (check.gravity && !check.gravity_fits) {
    throw InputError("--write",
                     "nothing is written, because of the directions that were tried no "
                     "robot.gravity fits: how is the base inclined?");
  }
  bool kept = true;
  const std::string text = changed_config(text::read_regular_file(options.config),
                                          changes_for(options, config, check), kept);
  OutputFile file("--write", options.write);
  file.write(text);
  file.finish();
  if (!kept) report.notes.push_back("the comments of " + options.config + " were not kept");
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
  show_progress(
      static_cast<double>(report.files.size()) / static_cast<double>(options.files.size() + 1),
      "comparing torques");
  try {
    report.check = identification::check_model(config.robot, records);
  } catch (const controller::InvalidModel&) {
    throw;
  } catch (const std::invalid_argument& error) {
    throw InputError(options.files.front(), error.what());
  }
  return report;
}

}  // namespace

void add_check_model(CLI::App& program) {
  CLI::App* command = program.add_subcommand(
      "check-model", "What measured torques say of the model, of friction and of the payload");
  const auto options = std::make_shared<CheckModelOptions>();
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
                   "The configuration with the friction and the payload that were found")
      ->option_text("CONFIG");
  command->add_flag("--json", options->json, "Print one JSON object");
  command->footer(
      "FILE has positions and torques of all joints of an arm in ordinary motion, fast or slow.\n"
      "Several files are one experiment. Velocities are not needed.\n" +
      std::string(kExitStatusHelp));
  command->callback([options] {
    std::vector<NamedFile> inputs = {{"--config", options->config}};
    add_records(options->files, inputs);
    check_outputs({{"--write", options->write}}, inputs);
    const Config config = controller::load_config(options->config);
    CheckModelReport report = check_files(*options, config);
    if (!options->write.empty()) write_config(*options, config, report);
    print(options->json ? json_text(check_model_json(report)) : check_model_table(report));
  });
}

}  // namespace dashpot::apps
