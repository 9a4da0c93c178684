#include <dashpot/apps/cli/number_list.hpp>
#include <dashpot/apps/design/design_report.hpp>

#include <CLI/CLI.hpp>
#include <limits>
#include <map>

namespace dashpot::apps {
namespace {

using analysis::DampingStructure;

constexpr double kLargest = std::numeric_limits<double>::max();

const std::map<std::string, DampingStructure>& structures() {
  static const std::map<std::string, DampingStructure> all = {
      {"full", DampingStructure::kFull},
      {"block", DampingStructure::kBlock},
      {"diagonal", DampingStructure::kDiagonal}};
  return all;
}

void add_arm(CLI::App& command, ArmOptions& arm) {
  const auto add = [&](const char* name, std::string& text, const char* help, const char* words) {
    command.add_option(name, text, help)->option_text(words);
  };
  add("--urdf", arm.urdf, "Instead of FILE: an arm", "FILE");
  add("--base", arm.base, "Its base link; axes of the task", "LINK");
  add("--tip", arm.tip, "Its link with the task's origin", "LINK");
  arm.posture.add(command);
  add("--joint-stiffness", arm.joint_stiffness, "Instead of the task's: of the joints, N m/rad",
      "a,b,...|x");
  add("--task-stiffness,--stiffness", arm.task_stiffness, "Diagonal of it, N/m and N m/rad",
      "x,y,z,rx,ry,rz");
  add("--task-damping,--damping", arm.task_damping, "Diagonal of the one before", "x,y,z,rx,ry,rz");
  add_model_options(command, arm);
  add_null_space_options(command, arm);
}

void add_loop(CLI::App& command, DesignOptions& options) {
  command
      .add_option("--period", options.timing.period,
                  "Of the control loop: the sampled loop must keep its gain margin")
      ->transform(control_period())
      ->option_text("S");
  add_loop_options(command, options.timing);
  command
      .add_option("--margin", options.margin,
                  "Springs and damping may grow by this factor together")
      ->transform(quantity("", 1, kLargest, "a factor of at least 1"))
      ->option_text("G (2)");
}

}  // namespace

DampingStructure DesignOptions::damping_structure() const {
  return structures().at(structure);
}

analysis::DampingTarget DesignOptions::target() const {
  analysis::DampingTarget result = analysis::DampingTarget::constant(ratio);
  result.soft_frequency = soft_frequency;
  return result;
}

void add_design_options(CLI::App& command, DesignOptions& options) {
  constexpr double kLeast = std::numeric_limits<double>::min();
  const CLI::Validator a_ratio = quantity("", kLeast, 1e9, "a positive ratio up to 1e9");
  command.add_option("FILE", options.file, "YAML or JSON file; - reads standard input")
      ->option_text(" ");
  add_arm(command, options.arm);
  options.postures.add(command);
  command.add_option("--damping-ratio", options.ratio, "The ratio wanted of every mode")
      ->required()
      ->transform(damping_ratio())
      ->option_text("Z");
  command
      .add_option("--keep-structure", options.structure,
                  "Entries that may differ from zero; block: translation apart from rotation")
      ->check(CLI::IsMember({"full", "block", "diagonal"}))
      ->option_text("full|block|diagonal (full)");
  command.add_flag("--near", options.near, "Stay near the task_damping of the file");
  add_loop(command, options);
  command.add_flag("--region", options.region,
                   "Configurations of FILE, or postures of the arm: one matrix that raises their\n"
                   "smallest ratio");
  command
      .add_option("--contact", options.contact,
                  "Of an arm: one matrix in the air and against every stiffness up to this, N/m")
      ->transform(quantity("N/m", kLeast, 1e12, "a stiffness up to 1e12, in N/m,"))
      ->option_text("K");
  command.add_option("--direction", options.direction, "Of the contact, in the base's axes")
      ->option_text("x|y|z|a,b,c (any)")
      ->check(not_empty());
  command
      .add_option("--largest-ratio", options.largest_ratio, "With --region: no mode may have more")
      ->transform(a_ratio)
      ->option_text("R (1 or 1.5 Z)");
  command.add_option("--csv", options.csv, "With --region: write the map of the worst mode there")
      ->option_text("FILE");
  command
      .add_option("--threads,--jobs", options.threads, "With --region; 0: one for each processor")
      ->check(CLI::Range(0, 1024))
      ->option_text("N (0)");
  command
      .add_option("--soft-frequency", options.soft_frequency,
                  "Give up the ratio of modes below this many rad/s")
      ->transform(positive("rad/s", "a frequency in rad/s"))
      ->option_text("W (0.001)");
  command.add_flag("--json", options.json, "Print JSON instead of a table");
}

void check(const DesignOptions& options) {
  if (options.file.empty() == options.arm.urdf.empty()) {
    throw InputError("FILE", options.file.empty() ? "give a file, or --urdf with --base and --tip"
                                                  : "does not go with --urdf: give one of them");
  }
  const ArmOptions& arm = options.arm;
  if (!arm.urdf.empty() && (arm.base.empty() || arm.tip.empty())) {
    throw InputError("--urdf", "needs --base and --tip");
  }
  if (arm.urdf.empty() && arm.any())
    throw InputError("--urdf", "missing; options that describe an arm need it");
  options.postures.check();
  if (options.postures.any() && !(options.region && !arm.urdf.empty())) {
    throw InputError("--region", "--samples, --postures and --log need it, and --urdf");
  }
  if (options.region && !arm.urdf.empty() && !options.postures.any()) {
    throw InputError("--region", "an arm needs --samples, --postures or --log with it");
  }
  if (options.contact > 0 && arm.urdf.empty()) throw InputError("--contact", "needs --urdf");
  if (!options.direction.empty() && options.contact == 0) {
    throw InputError("--direction", "needs --contact");
  }
  const bool many = options.region || options.contact > 0;
  const std::string not_with =
      options.region ? "does not go with --region" : "does not go with --contact";
  if (options.near && many) throw InputError("--near", not_with);
  if (options.largest_ratio && !many) {
    throw InputError("--largest-ratio", "needs --region or --contact");
  }
  if (options.largest_ratio && *options.largest_ratio < options.ratio) {
    throw InputError("--largest-ratio", "is below --damping-ratio");
  }
  if (!options.csv.empty() && !many) throw InputError("--csv", "needs --region or --contact");
  if (options.timing.period == 0 && (given(options.timing) || options.margin != 2)) {
    throw InputError("--period",
                     "missing; --delay, --cutoff, --integral-time and --margin need it");
  }
}

}  // namespace dashpot::apps
