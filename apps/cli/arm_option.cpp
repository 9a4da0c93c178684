#include <dashpot/apps/cli/arm_option.hpp>
#include <dashpot/apps/cli/number_list.hpp>
#include <dashpot/apps/cli/subcommands.hpp>
#include <dashpot/controller/attachment.hpp>
#include <dashpot/controller/drives.hpp>
#include <dashpot/controller/dynamics.hpp>
#include <dashpot/controller/rotors.hpp>
#include <dashpot/controller/settings_check.hpp>

#include <Eigen/Core>
#include <algorithm>
#include <filesystem>
#include <limits>
#include <optional>
#include <sstream>

namespace dashpot::apps {

using controller::RobotModel;
using text::Units;

void take_drives(const std::string& name, controller::ModelOptions& model) try {
  model.drives = controller::drives_name(name, std::filesystem::current_path());
  if (!name.empty()) controller::find_drives(model.drives);
  model.drives_friction = controller::has_own_friction(model.drives);
} catch (const controller::InvalidModel& error) {
  throw controller::InputError("--drives", error.what());
}

void add_accept_inertias(CLI::App& command, std::string& accepted) {
  command
      .add_flag("--accept-inertias", accepted,
                "Take impossible inertias as they are: of all links, or of these links only")
      ->option_text("[=LINK,...]");
}

void take_accepted(const std::string& accepted, controller::ModelOptions& model) {
  model.accept_inertias = accepted == "true";
  if (accepted.empty() || accepted == "true" || accepted == "false") return;
  std::istringstream names(accepted);
  for (std::string name; std::getline(names, name, ',');) {
    model.accept_inertias_of.push_back(name);
  }
}

void warn_of(const controller::RobotModel& model) {
  for (const std::string& warning : model.warnings()) {
    print_error("warning: " + warning);
  }
}

void warn_of(const controller::RobotModel& model, const controller::Gains& gains) {
  for (const std::string& doubt : controller::doubtful_gains(model, gains)) {
    print_error("warning: " + doubt);
  }
}

void warn_of(const controller::Config& config) {
  warn_of(config.model);
  for (const std::string& note : config.notes) print_error("note: " + note);
  warn_of(config.model, config.settings.initial.gains);
}

void add_gear_options(CLI::App& command, GearOptions& options) {
  command
      .add_option("--gear-stiffness", options.stiffness,
                  "Of elastic joints, N m/rad; none: rigid. Needs reflected inertia")
      ->option_text("a,b,...|x (none)");
  command.add_option("--gear-damping", options.damping, "Of elastic joints, N m s/rad")
      ->option_text("a,b,...|x (0)");
  command
      .add_option("--position-sensor", options.position_sensor,
                  "Side of the gears where joint positions are measured")
      ->check(CLI::IsMember({"motor", "link"}))
      ->option_text("motor|link (motor)");
}

void take_gears(const GearOptions& options, const controller::RobotModel& plain,
                controller::ModelOptions& model) {
  if (options.stiffness.empty()) {
    if (!options.damping.empty()) {
      throw controller::InputError("--gear-damping", "needs --gear-stiffness, N m/rad");
    }
    if (!options.position_sensor.empty()) {
      throw controller::InputError("--position-sensor", "needs --gear-stiffness, N m/rad");
    }
    return;
  }
  model.gear_stiffness = quantities_per_joint("--gear-stiffness", options.stiffness,
                                              controller::joint_units(plain, "N m/rad", "N/m"),
                                              std::numeric_limits<double>::infinity());
  if (!options.damping.empty()) {
    model.gear_damping = quantities_per_joint("--gear-damping", options.damping,
                                              controller::joint_units(plain, "N m s/rad", "N s/m"));
  }
  if (options.position_sensor == "link") {
    model.position_sensor = controller::PositionSensor::kLink;
  }
}

CLI::Validator not_empty() {
  return {[](const std::string& text) { return std::string(text.empty() ? "is empty" : ""); }, ""};
}

controller::InputError model_error(const controller::InvalidModel& error) {
  const std::string what = error.what();
  return {"", (what.starts_with("drives:") ? "--" : "") + what};
}

namespace {

/// One quantity for each unit; nothing if there is no text.
std::optional<Eigen::VectorXd> quantities(const std::string& option, const std::string& text,
                                          const Units& units) {
  if (text.empty()) return std::nullopt;
  return parse_quantities(option, text, units);
}

/// Like quantities_per_joint, in the units of revolute and prismatic joints; nothing if there is
/// no text.
std::optional<Eigen::VectorXd> per_joint(const std::string& option, const std::string& text,
                                         const RobotModel& model, const char* revolute,
                                         const char* prismatic) {
  if (text.empty()) return std::nullopt;
  return quantities_per_joint(option, text, controller::joint_units(model, revolute, prismatic));
}

}  // namespace

controller::Payload read_payload(const std::string& text) try {
  controller::Payload payload;
  if (text.empty()) return payload;
  const auto count = std::count(text.begin(), text.end(), ',') + 1;
  if (count != 1 && count != 4 && count != 7 && count != 10) {
    throw InputError("--payload", std::to_string(count) +
                                      " numbers, expected 1 (mass), 4 (and center), 7 (and moments "
                                      "of inertia) or 10 (and products)");
  }
  Units units{"kg", "m", "m", "m"};
  units.insert(units.end(), 6, "kg m^2");
  units.resize(static_cast<std::size_t>(count));
  const Eigen::VectorXd values = parse_quantities("--payload", text, units);
  if (values[0] < 0) throw InputError("--payload", "the mass is negative");
  if (values[0] == 0 && !values.tail(count - 1).isZero(0)) {
    throw InputError("--payload", "center or inertia of a body without mass");
  }
  payload.mass = values[0];
  if (count >= 4) payload.center = values.segment<3>(1);
  if (count >= 7) payload.inertia = values.segment<3>(4).asDiagonal();
  if (count == 10) {
    Eigen::Matrix3d& I = payload.inertia;
    I(0, 1) = I(1, 0) = values[7];
    I(0, 2) = I(2, 0) = values[8];
    I(1, 2) = I(2, 1) = values[9];
  }
  controller::Attachment(payload, {});
  return payload;
} catch (const controller::InvalidModel& error) {
  throw InputError("--payload", error.what());
}

void add_payload(CLI::App& command, std::string& payload) {
  command
      .add_option(
          "--payload", payload,
          "Mass at the tip, its center in the tip's axes, its inertia about that; kg, m, kg m^2")
      ->option_text("m[,x,y,z[,xx,yy,zz[,xy,xz,yz]]] (0)");
}

RobotModel read_model(const ArmOptions& options) try {
  controller::ModelOptions model;
  take_accepted(options.accept_inertias, model);
  take_drives(options.drives, model);
  if (const auto gravity = quantities("--gravity", options.gravity, Units(3, "m/s^2"))) {
    model.gravity = *gravity;
  }
  const RobotModel plain =
      RobotModel::from_urdf_file(options.urdf, options.base, options.tip, model);
  const auto inertia =
      per_joint("--reflected-inertia", options.reflected_inertia, plain, "kg m^2", "kg");
  if (inertia) model.reflected_inertia = *inertia;
  take_gears(options.gears, plain, model);
  if (!options.viscous_friction.empty()) {
    model.drives_friction = options.viscous_friction == "drives";
  }
  if (model.drives_friction && options.drives.empty()) {
    throw InputError("--viscous-friction", "drives: there are none; name them with --drives");
  }
  if (options.viscous_friction != "urdf" && !model.drives_friction) {
    model.viscous_friction =
        per_joint("--viscous-friction", options.viscous_friction, plain, "N m s/rad", "N s/m")
            .value_or(Eigen::VectorXd::Zero(plain.dof()));
  }
  model.payload = read_payload(options.payload);
  RobotModel result = RobotModel::from_urdf_file(options.urdf, options.base, options.tip, model);
  warn_of(result);
  return result;
} catch (const controller::InvalidModel& error) {
  throw model_error(error);
}

std::string friction_note(const ArmOptions& options, const RobotModel& model) {
  if (!options.viscous_friction.empty() || controller::has_own_friction(options.drives)) {
    return controller::friction_text(model);
  }
  controller::ModelOptions plain;
  take_accepted(options.accept_inertias, plain);
  const std::string left_out = controller::friction_text(
      RobotModel::from_urdf_file(options.urdf, options.base, options.tip, plain));
  return left_out.empty() ? ""
                          : left_out.substr(0, left_out.rfind(',')) +
                                ", as the URDF has it, is left out; --viscous-friction urdf "
                                "counts it.";
}

bool ArmOptions::any() const {
  for (const auto* text :
       {&base, &tip, &posture.q, &joint_stiffness, &task_stiffness, &task_damping,
        &viscous_friction, &null_stiffness, &null_damping, &projector.name, &projector.weights,
        &gravity, &reflected_inertia, &drives, &payload, &accept_inertias}) {
    if (!text->empty()) return true;
  }
  return posture.outside_limits || gears.any();
}

SystemEntry read_arm(const ArmOptions& options, const RobotModel& model,
                     const controller::JointVector& q) {
  const Eigen::Index n = model.dof();
  const auto joint_springs =
      per_joint("--joint-stiffness", options.joint_stiffness, model, "N m/rad", "N/m");
  const auto stiffness = quantities("--task-stiffness", options.task_stiffness,
                                    {"N/m", "N/m", "N/m", "N m/rad", "N m/rad", "N m/rad"});
  if (stiffness.has_value() == joint_springs.has_value()) {
    throw InputError("--task-stiffness", stiffness ? "does not go with --joint-stiffness"
                                                   : "or --joint-stiffness is needed with --urdf");
  }
  const auto damping =
      quantities("--task-damping", options.task_damping,
                 {"N s/m", "N s/m", "N s/m", "N m s/rad", "N m s/rad", "N m s/rad"});
  if (damping && joint_springs) {
    throw InputError("--task-damping", "does not go with --joint-stiffness");
  }
  const controller::DynamicsResult dynamics =
      controller::evaluate(model, q, controller::JointVector::Zero(n));
  SystemEntry entry;
  entry.impedance.mass = dynamics.M;
  if (joint_springs) {
    entry.impedance.stiffness = Eigen::MatrixXd(joint_springs->asDiagonal());
  } else {
    entry.impedance.jacobian = dynamics.J;
    entry.impedance.task_stiffness = Eigen::MatrixXd(stiffness->asDiagonal());
  }
  entry.loop = controller::SampledArm(model, {}).at(q);
  if (entry.loop.friction.size() > 0) entry.impedance.damping = entry.loop.friction;
  controller::AuditOptions stated;
  take_null_space(options, model, stated);
  const controller::Gains& gains = stated.gains;
  const bool null_space = gains.null_stiffness.size() + gains.null_damping.size() > 0;
  if (null_space && joint_springs) {
    throw InputError("--joint-stiffness", "does not go with --null-stiffness and --null-damping");
  }
  if (null_space) {
    stated.gains.task_stiffness = stiffness->asDiagonal();
    const analysis::TaskImpedance all = controller::Audit(model, stated).impedance(q);
    entry.impedance.stiffness = all.stiffness;
    entry.impedance.damping = all.damping;
    entry.impedance.damping_error = all.damping_error;
  }
  if (damping) entry.impedance.task_damping = Eigen::MatrixXd(damping->asDiagonal());
  return entry;
}

void ProjectorOption::add(CLI::App& command) {
  std::vector<std::string> names;
  names.reserve(controller::kNullProjectors.size());
  for (const auto& [of, projector] : controller::kNullProjectors) names.emplace_back(of);
  command.add_option("--null-projector", name, "Through which null-space gains act")
      ->option_text("dynamic|kinematic|weighted|none (dynamic)")
      ->check(CLI::IsMember(names));
  command.add_option("--null-weights", weights, "Of the joints in the weighted projector")
      ->option_text("a,b,...|x (1)");
}

void ProjectorOption::take(const RobotModel& model, controller::NullProjector& projector,
                           controller::JointVector& W) const {
  if (!name.empty()) projector = controller::null_projector_of(name);
  if (weights.empty()) return;
  if (projector != controller::NullProjector::kWeighted) {
    throw InputError("--null-weights", "goes with --null-projector weighted");
  }
  const Units units(static_cast<std::size_t>(model.dof()), "");
  W = quantities_per_joint("--null-weights", weights, units);
  if (!(W.minCoeff() > 0)) throw InputError("--null-weights", "a weight is not positive");
}

void add_model_options(CLI::App& command, ArmOptions& arm) {
  const auto add = [&](const char* name, std::string& text, const char* help, const char* words) {
    command.add_option(name, text, help)->option_text(words);
  };
  add("--viscous-friction", arm.viscous_friction, "In the joints, N m s/rad; urdf: the file's",
      "a,b,...|x|urdf|drives (0)");
  add("--gravity", arm.gravity, "In axes of the file's root link, m/s^2", "x,y,z (0,0,-9.81)");
  add("--reflected-inertia", arm.reflected_inertia, "Of rotors and gears at the joints, kg m^2",
      "a,b,...|x (0)");
  command.add_option("--drives", arm.drives, kDrivesHelp)->option_text("NAME")->check(not_empty());
  add_gear_options(command, arm.gears);
  add_payload(command, arm.payload);
  add_accept_inertias(command, arm.accept_inertias);
}

void add_null_space_options(CLI::App& command, ArmOptions& arm) {
  const auto add = [&](const char* name, std::string& text, const char* help) {
    command.add_option(name, text, help)->option_text("a,b,...|x (0)");
  };
  add("--null-stiffness", arm.null_stiffness, "Of the motions that the task leaves free, N m/rad");
  add("--null-damping", arm.null_damping, "Of the same, N m s/rad");
  arm.projector.add(command);
}

void take_null_space(const ArmOptions& options, const RobotModel& model,
                     controller::AuditOptions& stated) {
  controller::Gains& gains = stated.gains;
  const auto take = [&](const char* option, const std::string& text, const char* revolute,
                        const char* prismatic, controller::JointVector& values) {
    const auto given = per_joint(option, text, model, revolute, prismatic);
    if (given) values = *given;
  };
  take("--null-stiffness", options.null_stiffness, "N m/rad", "N/m", gains.null_stiffness);
  take("--null-damping", options.null_damping, "N m s/rad", "N s/m", gains.null_damping);
  options.projector.take(model, gains.null_projector, stated.null_weights);
}

void add_loop_options(CLI::App& command, controller::LoopTiming& timing) {
  command
      .add_option("--delay", timing.delay, "Ticks from a command to its effect, beyond the hold")
      ->check([](const std::string& text) -> std::string {
        const bool whole = text.find_first_not_of("0123456789") == std::string::npos;
        return whole && !text.empty() && text.size() < 4 && std::stoi(text) <= 100
                   ? ""
                   : "a whole number of ticks from 0 to 100 is wanted, not '" + text + "'";
      })
      ->option_text("N (0)");
  command.add_option("--cutoff", timing.cutoff, "Cutoff of a low-pass on the torque; 0: none")
      ->transform(quantity("Hz", 0, std::numeric_limits<double>::max(), "a frequency in Hz"))
      ->option_text("HZ (0)");
  command.add_flag("--difference-velocity", timing.difference_velocity,
                   "The controller takes velocities from positions");
  command
      .add_option("--integral-time", timing.integral_time,
                  "Time of the integral of the springs; 0: none")
      ->transform(quantity("s", 0, std::numeric_limits<double>::max(), "a time in s"))
      ->option_text("S (0)");
  command.add_flag("--ideal-gravity", timing.ideal_gravity,
                   "Gravity is compensated without delay, such as by the robot itself");
}

bool given(const controller::LoopTiming& timing) {
  return timing.delay > 0 || timing.cutoff > 0 || timing.difference_velocity ||
         timing.integral_time > 0 || timing.ideal_gravity;
}

}  // namespace dashpot::apps
