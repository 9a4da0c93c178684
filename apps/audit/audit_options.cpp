#include <dashpot/analysis/damping_design.hpp>
#include <dashpot/apps/audit/audit_options.hpp>
#include <dashpot/apps/cli/number_list.hpp>
#include <dashpot/apps/cli/output_file.hpp>
#include <dashpot/apps/cli/subcommands.hpp>
#include <dashpot/apps/report/text_table.hpp>
#include <dashpot/apps/scene/scene.hpp>
#include <dashpot/controller/config.hpp>
#include <dashpot/controller/rotors.hpp>
#include <dashpot/text/yaml_document.hpp>

#include <CLI/CLI.hpp>
#include <algorithm>
#include <cmath>
#include <limits>

namespace dashpot::apps {
namespace {

using controller::AuditOptions;
using controller::Mode;
using controller::RobotModel;
using text::Units;

const Units kStiffness = {"N/m", "N/m", "N/m", "N m/rad", "N m/rad", "N m/rad"};
const Units kDamping = {"N s/m", "N s/m", "N s/m", "N m s/rad", "N m s/rad", "N m s/rad"};

std::vector<std::string> preset_names() {
  std::vector<std::string> names;
  names.reserve(kPresets.size());
  for (const GainPreset& preset : kPresets) names.emplace_back(preset.name);
  return names;
}

/// Sets the gains of a preset for n joints, or the factor from which the task's damping follows.
void take_preset(const std::string& name, int n, AuditOptions& audit,
                 std::optional<double>& factor) {
  const GainPreset& preset = *std::find_if(kPresets.begin(), kPresets.end(),
                                           [&](const auto& one) { return one.name == name; });
  controller::Vector6 diagonal;
  diagonal << preset.translation, preset.translation, preset.translation, preset.rotation,
      preset.rotation, preset.rotation;
  audit.gains.task_stiffness = diagonal.asDiagonal();
  audit.half_quaternion = preset.half_quaternion;
  audit.inertia_blocks = preset.inertia_blocks;
  audit.gains.null_stiffness.setConstant(n, preset.null_space);
  audit.gains.null_damping.setConstant(n, kPresetFactor * std::sqrt(preset.null_space));
  audit.gains.null_projector = controller::NullProjector::kKinematic;
  if (preset.joints == nullptr) {
    if (!factor) factor = kPresetFactor;
    return;
  }
  const JointGains& joints = *preset.joints;
  if (n != static_cast<int>(joints.stiffness.size())) {
    throw InputError("--preset",
                     name + " has gains for seven joints, the arm has " + std::to_string(n));
  }
  const double t = joints.translation, r = joints.rotation;
  audit.gains.task_damping = controller::Vector6{t, t, t, r, r, r}.asDiagonal();
  audit.gains.null_stiffness = Eigen::Map<const Eigen::VectorXd>(joints.stiffness.data(), n);
  audit.gains.null_damping = Eigen::Map<const Eigen::VectorXd>(joints.damping.data(), n);
  audit.gains.null_projector = controller::NullProjector::kNone;
}

/// Sets the gains of a configuration file.
void read_gains_file(const std::string& path, const RobotModel& model, AuditOptions& audit) try {
  const text::YamlNode document = text::parse_yaml(text::read_regular_file(path));
  const text::YamlMapping root(document, "", controller::kConfigSections);
  if (!root.has("gains")) throw InputError("gains", "missing");
  audit.gains = controller::read_gains(root, model);
  read_null_projector(root, model, audit.gains.null_projector, audit.null_weights);
} catch (const InputError& error) {
  throw error.in_file(path);
}

/// Returns F sqrt(K), entry by entry.
template <class Matrix>
Matrix factor_damping(const std::string& option, double factor, const Matrix& K) {
  if (K.size() > 0 && K.minCoeff() < 0) {
    throw InputError(option, "needs a stiffness without negative entries");
  }
  return factor * K.cwiseSqrt();
}

/// A diagonal of the task's gains. Throws InputError for a negative entry: such a damper feeds
/// energy in, and such a spring pushes away.
Eigen::VectorXd gain_diagonal(const std::string& option, const std::string& text,
                              const text::Units& units) {
  Eigen::VectorXd values = parse_quantities(option, text, units);
  if (values.minCoeff() < 0) throw InputError(option, "a number is negative");
  return values;
}

void read_options_gains(const AuditCommand& command, const RobotModel& model, AuditOptions& audit) {
  controller::Gains& gains = audit.gains;
  const auto joints = [&](const char* option, const std::string& text, const char* revolute,
                          const char* prismatic) -> JointVector {
    return quantities_per_joint(option, text, controller::joint_units(model, revolute, prismatic));
  };
  if (!command.stiffness.empty()) {
    gains.task_stiffness = gain_diagonal("--stiffness", command.stiffness, kStiffness).asDiagonal();
  }
  if (!command.damping.empty()) {
    gains.task_damping = gain_diagonal("--damping", command.damping, kDamping).asDiagonal();
  }
  if (!command.joint_stiffness.empty()) {
    audit.mode = Mode::kJoint;
    gains.joint_stiffness =
        joints("--joint-stiffness", command.joint_stiffness, "N m/rad", "N/m").asDiagonal();
  }
  if (!command.joint_damping.empty()) {
    gains.joint_damping =
        joints("--joint-damping", command.joint_damping, "N m s/rad", "N s/m").asDiagonal();
  }
  take_null_space(command.arm, model, audit);
}

void read_gains(const AuditCommand& command, const RobotModel& model, AuditOptions& audit,
                double& intended_ratio) {
  std::optional<double> factor = command.damping_factor;
  if (!command.preset.empty()) {
    take_preset(command.preset, model.dof(), audit, factor);
  }
  if (!command.gains.empty()) read_gains_file(command.gains, model, audit);
  read_options_gains(command, model, audit);
  if (command.mode == "joint") audit.mode = Mode::kJoint;
  if (!command.rotation.empty()) audit.half_quaternion = command.rotation == "half-quaternion";
  if (command.frame == "tool") audit.gains.frame = controller::Frame::kTool;
  controller::Gains& gains = audit.gains;
  const double ratio =
      audit.mode == Mode::kJoint ? gains.joint_damping_ratio : gains.task_damping_ratio;
  if (ratio > 0) intended_ratio = ratio;
  if (!factor) return;
  gains.task_damping_ratio = gains.joint_damping_ratio = 0;
  intended_ratio = *factor / 2;
  gains.task_damping = factor_damping("--damping-factor", *factor, gains.task_stiffness);
  gains.joint_damping = factor_damping("--damping-factor", *factor, gains.joint_stiffness);
}

/// Refuses gains that are missing, or said twice.
void check_gains(const AuditCommand& command) {
  if (command.arm.urdf.empty() || command.arm.base.empty() || command.arm.tip.empty()) {
    throw InputError("--urdf", "give a CONFIG, or --urdf with --base and --tip");
  }
  const bool joint = !command.joint_stiffness.empty();
  const int sources = (command.preset.empty() ? 0 : 1) + (command.gains.empty() ? 0 : 1) +
                      (command.stiffness.empty() ? 0 : 1) + (joint ? 1 : 0);
  if (sources != 1) {
    throw InputError("--stiffness",
                     "give one of --stiffness, --joint-stiffness, --gains and "
                     "--preset");
  }
  const auto need_damping = [&](const std::string& option, const std::string& damping) {
    if (damping.empty() && !command.damping_factor) {
      throw InputError(option, std::string("missing; give it, or --damping-factor") +
                                   (command.damping_ratio
                                        ? "; dashpot design finds the damping for a --damping-ratio"
                                        : ""));
    }
    if (!damping.empty() && command.damping_factor) {
      throw InputError(option, "does not go with --damping-factor, which says the same");
    }
  };
  if (!command.stiffness.empty()) need_damping("--damping", command.damping);
  if (joint) need_damping("--joint-damping", command.joint_damping);
  if (!command.damping.empty() && command.stiffness.empty()) {
    throw InputError("--damping", "goes with --stiffness");
  }
  if (!command.joint_damping.empty() && !joint) {
    throw InputError("--joint-damping", "goes with --joint-stiffness");
  }
  if (!command.mode.empty() && command.gains.empty()) {
    throw InputError("--mode", "goes with --gains");
  }
}

void check(const AuditCommand& command) {
  if (command.config.empty()) check_gains(command);
  command.postures.check();
  if (command.timing.period == 0 && given(command.timing)) {
    throw InputError(
        "--period",
        "missing; --delay, --cutoff, --difference-velocity and --integral-time need it");
  }
  for (const auto& [option, path] : {std::pair("--csv", &command.csv), {"--plot", &command.plot}}) {
    if (!path->empty() && !command.postures.any()) {
      throw InputError(option, "needs --samples, --postures or --log");
    }
  }
  if (!command.plot.empty()) check_plot_name(command.plot);
}

constexpr double kUnknown = std::numeric_limits<double>::quiet_NaN();

AuditTask configured_task(const AuditCommand& command) {
  controller::Config config = controller::load_config(command.config);
  warn_of(config);
  AuditTask task{std::move(config.model), controller::audit_options(config.settings), kUnknown, 0};
  task.friction = controller::friction_text(task.model);
  task.drives = config.robot.options.drives;
  const controller::Gains& gains = task.options.gains;
  const double ratio =
      task.options.mode == Mode::kJoint ? gains.joint_damping_ratio : gains.task_damping_ratio;
  if (ratio > 0) task.intended_ratio = ratio;
  task.q = posture_of(command.config, command.arm.posture, task.model);
  return task;
}

AuditTask stated_task(const AuditCommand& command) {
  const ArmOptions& arm = command.arm;
  AuditTask task{read_model(arm), {}, kUnknown, 0};
  task.friction = friction_note(arm, task.model);
  task.drives = arm.drives;
  AuditOptions& audit = task.options;
  read_gains(command, task.model, audit, task.intended_ratio);
  if (!audit.inertia_blocks) warn_of(task.model, audit.gains);
  if (const auto negative = analysis::negative_eigenvalues(audit.gains.task_damping);
      negative.size() > 0) {
    print_error("warning: the task's damping has the eigenvalue " + format_number(negative[0], 4) +
                ": it feeds energy in");
  }
  static_cast<controller::LoopTiming&>(audit) = command.timing;
  audit.margin = command.margin;
  task.q = arm.posture.read(task.model);
  return task;
}

}  // namespace

std::string AuditTask::rotors_hint() const {
  return options.settings
             ? controller::rotors_hint(model, "robot.reflected_inertia", "robot.drives:", "\n  ")
             : controller::rotors_hint(model, "--reflected-inertia", "--drives", "\n  ");
}

AuditTask read_task(const AuditCommand& command) {
  check(command);
  AuditTask task = command.config.empty() ? stated_task(command) : configured_task(command);
  if (command.no_margin) task.options.period = 0;
  const double intended = std::isnan(task.intended_ratio) ? 0.7 : task.intended_ratio;
  task.wanted_ratio = command.damping_ratio.value_or(intended);
  task.postures = command.postures.listed(command.arm.posture, task.model);
  if (command.postures.spread) {
    command.postures.range(task.model, task.q, task.options.lower, task.options.upper);
  }
  return task;
}

CLI::Option* add_stated_options(CLI::App& command, AuditCommand& options) {
  CLI::Option* config =
      command.add_option("config", options.config, "Configuration of the controller, or a scene")
          ->option_text("[CONFIG]");
  const auto add = [&](const char* name, std::string& text, const char* help, const char* words) {
    return command.add_option(name, text, help)->option_text(words);
  };
  ArmOptions& arm = options.arm;
  add("--urdf", arm.urdf, "Robot description instead", "FILE");
  add("--base", arm.base, "Link that stands still", "LINK");
  add("--tip", arm.tip, "Link at the end of the chain", "LINK");
  add("--preset", options.preset, "Default gains of a public controller", "NAME")
      ->check(CLI::IsMember(preset_names()));
  add("--stiffness,--task-stiffness", options.stiffness, "Diagonal, N/m and N m/rad",
      "x,y,z,rx,ry,rz");
  add("--damping,--task-damping", options.damping, "Diagonal, N s/m and N m s/rad",
      "x,y,z,rx,ry,rz");
  command.add_option("--damping-factor", options.damping_factor, "Damping is F sqrt(stiffness)")
      ->transform(positive("", "a positive factor"))
      ->option_text("F");
  add("--joint-stiffness", options.joint_stiffness, "Instead: of the joints, N m/rad", "a,b,...|x");
  add("--joint-damping", options.joint_damping, "Of the joints, N m s/rad", "a,b,...|x");
  add("--gains", options.gains, "YAML file with the key gains, as of the controller", "FILE");
  add("--mode", options.mode, "Of --gains", "cartesian|joint (cartesian)")
      ->check(CLI::IsMember({"cartesian", "joint"}));
  add("--rotation", options.rotation, "What the rotational stiffness acts on",
      "vector|half-quaternion (vector)")
      ->check(CLI::IsMember({"vector", "half-quaternion"}));
  add("--frame", options.frame, "Axes of the gains", "base|tool (base)")
      ->check(CLI::IsMember({"base", "tool"}));
  add_null_space_options(command, arm);
  add_model_options(command, arm);
  add_loop_options(command, options.timing);
  for (CLI::Option* option : command.get_options([&](const CLI::Option* one) {
         return one != config && one != command.get_help_ptr();
       })) {
    option->excludes(config);
  }
  arm.posture.add(command);
  options.postures.add(command);
  command.add_option("--jobs,--threads", options.jobs, "Threads; 0: one for each processor")
      ->check(CLI::Range(0, 1024))
      ->option_text("N (0)");
  command.add_flag("--json", options.json, "Print JSON instead of tables");
  return config;
}

void add_audit_options(CLI::App& command, AuditCommand& options) {
  CLI::Option* config = add_stated_options(command, options);
  command
      .add_option("--period", options.timing.period,
                  "Of the control loop: computes the gain margin")
      ->excludes(config)
      ->transform(control_period())
      ->option_text("S");
  command.add_option("--margin", options.margin, "Gain margin that is asked for")
      ->excludes(config)
      ->transform(quantity("", 1, 1e6, "a factor of at least 1"))
      ->option_text("G (2)");
  command.add_flag("--no-margin", options.no_margin, "Leave the gain margin out");
  command.add_option("--damping-ratio", options.damping_ratio, "Wanted of the suggested damping")
      ->transform(damping_ratio())
      ->option_text("Z (F/2, or 0.7)");
  command.add_option("--csv", options.csv, "Write a line for each posture there")
      ->option_text("FILE");
  command.add_option("--plot", options.plot, "Draw the ratios there, with gnuplot")
      ->option_text("FILE.svg|FILE.png");
}

}  // namespace dashpot::apps
