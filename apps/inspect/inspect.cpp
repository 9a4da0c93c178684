#include <dashpot/apps/cli/arm_option.hpp>
#include <dashpot/apps/cli/number_list.hpp>
#include <dashpot/apps/cli/posture_option.hpp>
#include <dashpot/apps/cli/subcommands.hpp>
#include <dashpot/apps/report/json.hpp>
#include <dashpot/apps/report/text_table.hpp>
#include <dashpot/controller/config.hpp>
#include <dashpot/controller/default_settings.hpp>
#include <dashpot/controller/drives.hpp>
#include <dashpot/controller/dynamics.hpp>
#include <dashpot/controller/rotors.hpp>
#include <dashpot/controller/settings_check.hpp>
#include <dashpot/text/printable.hpp>

#include <CLI/CLI.hpp>
#include <cmath>
#include <memory>
#include <numbers>
#include <string>
#include <vector>

namespace dashpot::apps {
namespace {

using controller::DynamicsResult;
using controller::Joint;
using controller::JointVector;
using controller::RobotModel;
using controller::Stopping;
using Align = TextTable::Align;

struct InspectOptions {
  std::string urdf, base, tip;
  PostureOption posture;
  std::string qd, gravity, reflected_inertia, drives, accept_inertias;
  GearOptions gears;
  ProjectorOption projector;
  bool exclude_off_chain = false;
  bool json = false;
};

/// Returns a number for each joint, in the units of its type; zeros if `text` is empty.
JointVector joint_list(const std::string& option, const std::string& text, const RobotModel& model,
                       const char* revolute, const char* prismatic) {
  if (text.empty()) return JointVector::Zero(model.dof());
  return parse_quantities(option, text, controller::joint_units(model, revolute, prismatic));
}

RobotModel read_model(const InspectOptions& options) {
  controller::ModelOptions model;
  model.include_off_chain = !options.exclude_off_chain;
  take_accepted(options.accept_inertias, model);
  if (!options.gravity.empty()) {
    model.gravity = parse_quantities("--gravity", options.gravity, text::Units(3, "m/s^2"));
  }
  take_drives(options.drives, model);
  try {
    if (!options.reflected_inertia.empty() || options.gears.any()) {
      const RobotModel plain =
          RobotModel::from_urdf_file(options.urdf, options.base, options.tip, model);
      if (!options.reflected_inertia.empty()) {
        model.reflected_inertia =
            quantities_per_joint("--reflected-inertia", options.reflected_inertia,
                                 controller::joint_units(plain, "kg m^2", "kg"));
      }
      take_gears(options.gears, plain, model);
    }
    return RobotModel::from_urdf_file(options.urdf, options.base, options.tip, model);
  } catch (const controller::InvalidModel& error) {
    throw model_error(error);
  }
}

const char* to_text(controller::JointType type) {
  switch (type) {
    case controller::JointType::kRevolute:
      return "revolute";
    case controller::JointType::kContinuous:
      return "continuous";
    case controller::JointType::kPrismatic:
      return "prismatic";
  }
  return "";
}

/// Returns N of the options' projector in all directions of the tip, n x n; 0 x 0 without one.
Eigen::MatrixXd projector_of(const InspectOptions& options, const RobotModel& model,
                             const DynamicsResult& dynamics) {
  controller::NullProjector projector = controller::NullProjector::kDynamic;
  JointVector weights;
  options.projector.take(model, projector, weights);
  if (options.projector.name.empty()) return {};
  return controller::null_projector(dynamics, projector, weights);
}

/// Returns the joints of the file; null for a limit that it does not set.
Json json_joints(const RobotModel& model) {
  Json list = Json::array();
  const auto limit = [](double value) { return std::isfinite(value) ? Json(value) : Json(); };
  for (const Joint& joint : model.joints()) {
    list.push_back({{"name", text::printable(joint.name)},
                    {"type", to_text(joint.type)},
                    {"lower", limit(joint.lower)},
                    {"upper", limit(joint.upper)},
                    {"velocity", limit(joint.velocity)},
                    {"effort", limit(joint.effort)},
                    {"reflected_inertia", joint.reflected_inertia}});
    for (const auto& [key, value] : {std::pair("acceleration", joint.acceleration),
                                     {"deceleration", joint.deceleration},
                                     {"jerk", joint.jerk}}) {
      if (std::isfinite(value)) list.back()[key] = value;
    }
    if (joint.elastic()) {
      list.back()["gear_stiffness"] = joint.gear_stiffness;
      list.back()["gear_damping"] = joint.gear_damping;
    }
  }
  return list;
}

std::string to_json(const InspectOptions& options, const RobotModel& model,
                    const DynamicsResult& dynamics, const JointVector& q) {
  const bool unknown = controller::unknown_rotors(model).any();
  Json result = {{"joints", json_joints(model)},
                 {"rotors", unknown ? "unknown" : "known"},
                 {"q", json_list(q)},
                 {"mass_matrix", json_rows(dynamics.M)},
                 {"coriolis", json_list(dynamics.coriolis)},
                 {"gravity", json_list(dynamics.gravity)},
                 {"jacobian", json_rows(dynamics.J)},
                 {"jacobian_dot_qd", json_list(dynamics.Jdot_qd)},
                 {"tip_position", json_list(dynamics.p_BT_B)},
                 {"tip_rotation", json_rows(dynamics.R_BT)}};
  if (const Eigen::MatrixXd N = projector_of(options, model, dynamics); N.size() > 0) {
    result["null_projector"] = json_rows(N);
  }
  const controller::Settings settings = controller::default_settings(model);
  if (!settings.limits.torque.isZero(0)) {
    const Stopping stops = controller::stopping(model, settings, q);
    result["stop"] = {{"time", json_list(stops.time)}, {"way", json_list(stops.way)}};
  }
  for (const std::string& warning : model.warnings()) result["warnings"].push_back(warning);
  if (!options.drives.empty()) result["drives"] = drives_json(options.drives);
  return result.dump(2, ' ', true) + "\n";
}

std::vector<std::string> numbers(const Eigen::VectorXd& values, int digits = 6) {
  return format_column({values.begin(), values.end()}, digits);
}

/// One row for each joint.
std::string joints_table(const RobotModel& model, const DynamicsResult& dynamics,
                         const JointVector& q, const JointVector& qd) {
  std::vector<std::string> number, name, type;
  for (const Joint& joint : model.joints()) {
    number.push_back(std::to_string(number.size() + 1));
    name.push_back(text::printable(joint.name));
    type.emplace_back(to_text(joint.type));
  }
  TextTable table;
  table.add_column(Align::kRight, {"", "joint"}, number);
  table.add_column(Align::kLeft, {"", "name"}, name);
  table.add_column(Align::kLeft, {"", "type"}, type);
  const auto add = [&](const char* above, const char* below, const Eigen::VectorXd& values) {
    table.add_column(Align::kPoint, {above, below}, numbers(values));
  };
  add("lower", "limit", model.joint_values(&Joint::lower));
  add("upper", "limit", model.joint_values(&Joint::upper));
  add("velocity", "limit", model.joint_values(&Joint::velocity));
  add("effort", "limit", model.joint_values(&Joint::effort));
  for (const auto& [above, limit] : {std::pair("acceler.", &Joint::acceleration),
                                     {"deceler.", &Joint::deceleration},
                                     {"jerk", &Joint::jerk}}) {
    const JointVector values = model.joint_values(limit);
    if (values.array().isFinite().any()) add(above, "limit", values);
  }
  add("reflected", "inertia", model.joint_values(&Joint::reflected_inertia));
  if (model.elastic_joints() > 0) {
    add("gear", "stiffness", model.joint_values(&Joint::gear_stiffness));
    add("gear", "damping", model.joint_values(&Joint::gear_damping));
  }
  add("", "q", q);
  add("", "qd", qd);
  add("Coriolis", "torque", dynamics.coriolis);
  add("gravity", "torque", dynamics.gravity);
  return table.text();
}

/// Rows under joint numbers.
std::string matrix_table(const Eigen::MatrixXd& matrix, const std::vector<std::string>& names,
                         int digits = 6) {
  TextTable table;
  table.add_column(Align::kLeft, {""}, names);
  for (Eigen::Index j = 0; j < matrix.cols(); ++j) {
    table.add_column(Align::kPoint, {std::to_string(j + 1)}, numbers(matrix.col(j), digits));
  }
  return table.text();
}

std::string tip_table(const DynamicsResult& dynamics) {
  TextTable table;
  table.add_column(Align::kLeft, {"", ""}, {"x", "y", "z"});
  const auto add = [&](const char* above, const char* below, const Eigen::VectorXd& values) {
    table.add_column(Align::kPoint, {above, below}, numbers(values));
  };
  add("", "position", dynamics.p_BT_B);
  add("tip's", "x axis", dynamics.R_BT.col(0));
  add("tip's", "y axis", dynamics.R_BT.col(1));
  add("tip's", "z axis", dynamics.R_BT.col(2));
  add("Jdot qd", "linear", dynamics.Jdot_qd.head(3));
  add("Jdot qd", "angular", dynamics.Jdot_qd.tail(3));
  return table.text();
}

/// Returns the source and figures of the rotors, and which are unknown.
std::string rotors_text(const InspectOptions& options, const RobotModel& model) {
  std::string text;
  if (!options.drives.empty()) {
    const controller::Drives& drives = controller::find_drives(options.drives);
    text += "\nDrives of " + std::string(drives.name) +
            "\n  Source: " + std::string(drives.source) +
            ".\n  Doubt: " + std::string(drives.doubt) + ".\n";
    if (!drives.values(drives.viscous_friction).isZero(0)) {
      TextTable table({{Align::kLeft, {""}}});
      for (int i = 1; i <= drives.joints; ++i) {
        table.add_column(Align::kPoint, {std::to_string(i)});
      }
      const auto add = [&](const std::string& name, const auto& figures) {
        std::vector<std::string> row = {name};
        const std::vector<std::string> rest = numbers(drives.values(figures));
        row.insert(row.end(), rest.begin(), rest.end());
        table.add_row(row);
      };
      add("viscous friction, " + controller::unit_text(model, "N m s/rad", "N s/m"),
          drives.viscous_friction);
      add("Coulomb friction, " + controller::unit_text(model, "N m", "N"), drives.coulomb_friction);
      text += table.text();
    }
  }
  const std::string missing = controller::missing_rotors_text(model);
  if (missing.empty()) return text;
  return text + "\nRotors unknown: " + missing +
         ".\nThe mass matrix is computed without them; they matter most at the wrist.\n" +
         controller::rotors_hint(model, "--reflected-inertia", "--drives", "\n") + "\n";
}

std::string stop_table(const RobotModel& model, const JointVector& q) {
  const controller::Settings settings = controller::default_settings(model);
  if (settings.limits.torque.isZero(0)) return "";  // unknown
  const Stopping stops = controller::stopping(model, settings, q);
  Eigen::MatrixXd rows(2, model.dof());
  rows << stops.time.transpose(), stops.way.transpose();
  return "\nStop of a joint alone from 0.9 of its velocity limit, with the default settings\n" +
         matrix_table(rows, {"time, s", "way, rad or m"}, 2);
}

std::string to_table(const InspectOptions& options, const RobotModel& model,
                     const DynamicsResult& dynamics, const JointVector& q, const JointVector& qd) {
  std::vector<std::string> joints;
  for (int i = 1; i <= model.dof(); ++i) joints.push_back(std::to_string(i));
  const std::string n = std::to_string(model.dof());
  const std::string base = text::printable(model.base());
  const Eigen::MatrixXd N = projector_of(options, model, dynamics);
  return text::printable(model.name()) + ": " + n + (model.dof() == 1 ? " joint" : " joints") +
         " from " + base + " to " + text::printable(model.tip()) + ". SI units, axes of " + base +
         ".\n\n" + joints_table(model, dynamics, q, qd) + "\nMass matrix\n" +
         matrix_table(dynamics.M, joints) + "\nJacobian at the tip\n" +
         matrix_table(dynamics.J,
                      {"linear x", "linear y", "linear z", "angular x", "angular y", "angular z"}) +
         (N.size() > 0 ? "\nNull-space projector\n" + matrix_table(N, joints) : "") + "\nTip\n" +
         tip_table(dynamics) + stop_table(model, q);
}

void run_inspect(const InspectOptions& options) {
  const RobotModel model = read_model(options);
  const JointVector q = options.posture.read(model);
  const JointVector qd = joint_list("--qd", options.qd, model, "rad/s", "m/s");
  for (int i = 0; i < model.dof(); ++i) {
    const controller::Joint& joint = model.joints()[static_cast<std::size_t>(i)];
    if (joint.velocity > 0 && std::abs(qd[i]) > joint.velocity) {
      print_error("warning: --qd: joint '" + joint.name + "' is faster than its limit, " +
                  format_number(joint.velocity, 4) +
                  "; degrees a second are written as '30 deg/s'");
    }
  }
  const DynamicsResult dynamics = controller::evaluate(model, q, qd);
  warn_of(model);
  print(options.json ? to_json(options, model, dynamics, q)
                     : to_table(options, model, dynamics, q, qd) + rotors_text(options, model));
}

}  // namespace

void add_inspect(CLI::App& program) {
  CLI::App* command = program.add_subcommand(
      "inspect", "Mass matrix, Jacobian, gravity and Coriolis torques of an arm at one state");
  const auto options = std::make_shared<InspectOptions>();
  const auto add = [&](const char* name, std::string InspectOptions::*member, const char* help,
                       const char* words) {
    return command->add_option(name, (*options).*member, help)->option_text(words);
  };
  add("--urdf", &InspectOptions::urdf, "Robot description", "FILE")->required();
  add("--base", &InspectOptions::base, "Link that stands still; results are in its axes", "LINK")
      ->required();
  add("--tip", &InspectOptions::tip, "Link at the end of the chain", "LINK")->required();
  options->posture.add(*command);
  options->posture.refused = std::numbers::pi;  // the results hold beyond the limits, too
  add("--qd", &InspectOptions::qd, "Joint velocities, rad/s or m/s", "a,b,... (0)");
  add("--gravity", &InspectOptions::gravity, "In axes of the file's root link, m/s^2",
      "x,y,z (0,0,-9.81)");
  add("--reflected-inertia", &InspectOptions::reflected_inertia,
      "Inertia of rotors and gears at the joints, kg m^2 or kg; one number for all, or n",
      "a,b,... (0)");
  add("--drives", &InspectOptions::drives, kDrivesHelp, "NAME")->check(not_empty());
  add_gear_options(*command, options->gears);
  options->projector.add(*command);
  command->add_flag("--exclude-off-chain", options->exclude_off_chain,
                    "Leave out links that hang off the chain");
  add_accept_inertias(*command, options->accept_inertias);
  command->add_flag("--json", options->json, "Print JSON instead of tables");
  command->footer(std::string(kUnitsHelp) + "\n" + kExitStatusHelp);
  command->callback([options] { run_inspect(*options); });
}

}  // namespace dashpot::apps
