#include <dashpot/apps/design_arm.hpp>
#include <dashpot/apps/design_report.hpp>
#include <dashpot/apps/subcommands.hpp>
#include <dashpot/apps/system_file.hpp>
#include <dashpot/apps/text_table.hpp>

#include <unistd.h>
#include <CLI/CLI.hpp>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <map>
#include <memory>
#include <optional>
#include <string>
#include <vector>

namespace dashpot::apps {
namespace {

using analysis::DampingStructure;

struct Options {
  std::string file;
  ArmOptions arm;  // instead of a file
  double ratio = 0;
  std::string structure = "full";
  double soft_frequency = analysis::DampingTarget().soft_frequency;  // rad/s
  std::optional<double> largest_ratio;
  int threads = 0;
  bool near = false;
  bool region = false;
  bool sensitivity = false;
  bool json = false;
};

const std::map<std::string, DampingStructure>& structures() {
  static const std::map<std::string, DampingStructure> all = {
      {"full", DampingStructure::kFull},
      {"block", DampingStructure::kBlock},
      {"diagonal", DampingStructure::kDiagonal}};
  return all;
}

analysis::DampingTarget target_of(const Options& options) {
  analysis::DampingTarget target = analysis::DampingTarget::constant(options.ratio);
  target.soft_frequency = options.soft_frequency;
  return target;
}

std::string key_of(const analysis::TaskImpedance& impedance) {
  return impedance.jacobian ? "task_damping" : "damping";
}

analysis::DampingDesign design_one(const SystemEntry& entry, const Options& options) {
  const analysis::TaskImpedance& given = entry.impedance;
  const DampingStructure structure = structures().at(options.structure);
  if (!options.near) {
    return analysis::design_damping(given, target_of(options), structure);
  }
  if (!given.jacobian || !given.task_damping) {
    throw InputError(entry.prefix + "task_damping", "missing; --near stays near it");
  }
  return analysis::design_damping(given, target_of(options), structure, given.task_damping);
}

DesignReport report_on(const SystemEntry& entry, const Options& options) try {
  DesignReport report;
  report.key = key_of(entry.impedance);
  report.ratio = options.ratio;
  report.design = design_one(entry, options);
  report.impedance = analysis::with_damping(entry.impedance, report.design.damping);
  analysis::SpectrumOptions spectrum;
  spectrum.soft_frequency = options.soft_frequency;
  const auto largest = analysis::Pivot::kLargest;
  SystemEntry plain = entry;  // no responses
  plain.times.reset();
  report.before = make_report(plain, analysis::to_joint_space(entry.impedance), spectrum, largest);
  plain.impedance = report.impedance;
  report.after = make_report(plain, report.design.system, spectrum, largest);
  if (options.sensitivity) {
    report.sensitivities = analysis::sensitivities(report.design.system, report.after.spectrum);
  }
  if (const auto& given = entry.impedance.task_damping) {
    const Eigen::VectorXd negative = analysis::negative_eigenvalues(*given);
    if (negative.size() > 0) {
      report.notes.push_back("the task_damping given has the eigenvalue " +
                             format_number(negative[0], 4) + ": it feeds energy in");
    }
  }
  return report;
} catch (const analysis::InvalidSystem& error) {
  throw entry.error(error);
}

/// Says on the last line of a terminal how much is done.
void show_progress(double done) {
  std::fprintf(stderr, done < 1 ? "\r%3.0f %%" : "\r     \r", 100 * done);
}

RegionReport report_on_region(const SystemFile& file, const Options& options) {
  if (file.entries.empty()) throw InputError("", "lists no configurations");
  std::vector<analysis::TaskImpedance> configurations;
  for (const SystemEntry& entry : file.entries) {
    const analysis::TaskImpedance& impedance = entry.impedance;
    try {
      analysis::damping_sample(impedance);
    } catch (const analysis::InvalidSystem& error) {
      throw entry.error(error);
    }
    const auto directions = [](const analysis::TaskImpedance& of) {
      return of.jacobian ? of.jacobian->rows() : of.mass.rows();
    };
    if (key_of(impedance) != key_of(file.entries[0].impedance) ||
        directions(impedance) != directions(file.entries[0].impedance)) {
      throw InputError(entry.prefix + (impedance.jacobian ? "jacobian" : "mass"),
                       "has other directions than the first configuration");
    }
    configurations.push_back(impedance);
  }
  analysis::RegionOptions region;
  region.target = target_of(options);
  region.structure = structures().at(options.structure);
  region.ceiling = options.largest_ratio;
  region.threads = options.threads;
  if (isatty(STDERR_FILENO) != 0) region.progress = show_progress;
  try {
    return {key_of(configurations[0]), options.ratio,
            analysis::design_region(configurations, region)};
  } catch (const analysis::InvalidSystem&) {
    for (const SystemEntry& entry : file.entries) report_on(entry, options);  // names the entry
    throw;
  }
}

void check(const Options& options) {
  if (options.file.empty() == options.arm.urdf.empty()) {
    throw InputError("FILE", "give a file, or --urdf with --base and --tip");
  }
  const ArmOptions& arm = options.arm;
  if (!arm.urdf.empty() && (arm.base.empty() || arm.tip.empty())) {
    throw InputError("--urdf", "needs --base and --tip");
  }
  const bool idle = !arm.base.empty() || !arm.tip.empty() || !arm.q.empty() ||
                    !arm.task_stiffness.empty() || !arm.task_damping.empty();
  if (arm.urdf.empty() && idle) throw InputError("--urdf", "missing, but wanted by other options");
  if (options.near && options.region) throw InputError("--near", "does not go with --region");
  if (options.largest_ratio && !options.region) {
    throw InputError("--largest-ratio", "needs --region");
  }
  if (options.largest_ratio && *options.largest_ratio < options.ratio) {
    throw InputError("--largest-ratio", "is below --damping-ratio");
  }
}

void run(const Options& options) try {
  SystemFile file;
  if (options.arm.urdf.empty()) {
    file = read_systems(options.file);
  } else {
    file.entries.push_back(read_arm(options.arm));
  }
  if (options.region) {
    const RegionReport report = report_on_region(file, options);
    print(options.json ? region_json(report) : region_table(report));
    return;
  }
  std::vector<DesignReport> reports;
  for (const SystemEntry& entry : file.entries) reports.push_back(report_on(entry, options));
  print(options.json ? design_json(reports, file.is_list) : design_table(reports, file.is_list));
} catch (const InputError& error) {
  if (options.file.empty()) throw;
  throw error.in_file(options.file);
}

/// Fails for text that is not a positive number; `what` says what is wanted.
CLI::Validator positive(const std::string& what) {
  return CLI::Validator(
      [what](const std::string& text) -> std::string {
        char* end = nullptr;
        const double value = std::strtod(text.c_str(), &end);
        const bool good = end != text.c_str() && *end == '\0' && std::isfinite(value) && value > 0;
        return good ? "" : what + " is wanted, not '" + text + "'";
      },
      "");
}

constexpr const char* kHelp =
    R"(FILE is as for `dashpot analyze`, with mass, jacobian and task_stiffness; damping is what is
there already (joint friction, null-space damping). A task_damping is what `before` shows, and what
--near stays near. Without a jacobian the damping is designed in joint space. The matrix is always
positive semidefinite; a mode that cannot have its ratio is named, with the reason.)";

}  // namespace

void add_design(CLI::App& program) {
  CLI::App* command =
      program.add_subcommand("design", "The damping matrix that gives every mode a damping ratio");
  const auto options = std::make_shared<Options>();
  command->add_option("FILE", options->file, "YAML or JSON file; - reads standard input")
      ->option_text(" ");
  ArmOptions& arm = options->arm;
  command->add_option("--urdf", arm.urdf, "Instead of FILE: an arm")->option_text("FILE");
  command->add_option("--base", arm.base, "Its base link; axes of the task")->option_text("LINK");
  command->add_option("--tip", arm.tip, "Its link with the task's origin")->option_text("LINK");
  command->add_option("--q", arm.q, "Joint positions, rad or m")->option_text("a,b,... (0)");
  command->add_option("--task-stiffness", arm.task_stiffness, "Diagonal of it, N/m and N m/rad")
      ->option_text("x,y,z,rx,ry,rz");
  command->add_option("--task-damping", arm.task_damping, "Diagonal of the one before")
      ->option_text("x,y,z,rx,ry,rz");
  command->add_option("--damping-ratio", options->ratio, "The ratio wanted of every mode")
      ->required()
      ->check(positive("a positive ratio"))
      ->option_text("Z");
  command
      ->add_option("--keep-structure", options->structure,
                   "Entries that may differ from zero; block: translation apart from rotation")
      ->check(CLI::IsMember({"full", "block", "diagonal"}))
      ->option_text("full|block|diagonal (full)");
  command->add_flag("--near", options->near, "Stay near the task_damping of the file");
  command->add_flag("--region", options->region,
                    "FILE lists configurations: one matrix that raises their smallest ratio");
  command
      ->add_option("--largest-ratio", options->largest_ratio,
                   "With --region: no mode may have more")
      ->check(positive("a positive ratio"))
      ->option_text("R (1 or 1.5 Z)");
  command->add_option("--threads", options->threads, "With --region; 0: one for each processor")
      ->check(CLI::Range(0, 1024))
      ->option_text("N (0)");
  command
      ->add_option("--soft-frequency", options->soft_frequency,
                   "Give up the ratio of modes below this many rad/s")
      ->check(positive("a frequency in rad/s"))
      ->option_text("W (0.001)");
  command->add_flag("--sensitivity", options->sensitivity,
                    "How frequencies and ratios answer to the entries of the matrices");
  command->add_flag("--json", options->json, "Print JSON instead of a table");
  command->footer(kHelp);
  command->callback([options] {
    check(*options);
    run(*options);
  });
}

}  // namespace dashpot::apps
