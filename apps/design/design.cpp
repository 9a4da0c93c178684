#include <dashpot/analysis/damping_sampled.hpp>
#include <dashpot/apps/cli/output_file.hpp>
#include <dashpot/apps/cli/subcommands.hpp>
#include <dashpot/apps/cli/system_file.hpp>
#include <dashpot/apps/cli/terminal.hpp>
#include <dashpot/apps/design/design_report.hpp>
#include <dashpot/apps/report/text_table.hpp>
#include <dashpot/controller/posture.hpp>
#include <dashpot/controller/rotors.hpp>

#include <CLI/CLI.hpp>
#include <cstdio>
#include <limits>
#include <memory>
#include <optional>
#include <stdexcept>
#include <string>
#include <utility>
#include <vector>

namespace dashpot::apps {
namespace {

using controller::JointVector;

std::string key_of(const analysis::TaskImpedance& impedance) {
  return impedance.jacobian ? "task_damping" : "damping";
}

/// The stiffness (n x n) of the task springs, or of the joint springs if there is no task.
Eigen::MatrixXd controlled_stiffness(const SystemEntry& entry) {
  const analysis::TaskImpedance& impedance = entry.impedance;
  if (!impedance.jacobian || !impedance.task_stiffness) {
    if (!impedance.stiffness || entry.loop.passive_stiffness.size() == 0) {
      return impedance.stiffness.value_or(Eigen::MatrixXd());
    }
    return *impedance.stiffness - entry.loop.passive_stiffness;
  }
  return impedance.jacobian->transpose() * *impedance.task_stiffness * *impedance.jacobian;
}

/// Largest ratio allowed with --contact. A damping against stiff touches overdamps the arm in the
/// air, so that the default of a region is too low.
constexpr double kMostAgainstTouches = 1e4;

/// The damping for one system, and its effect in the loop if a loop is given.
struct Found {
  analysis::DampingDesign design;
  std::optional<LoopReport> loop;
};

/// The loop of the options, with the robot's part of it and the integral of one system.
analysis::LoopLimit limit_of(const SystemEntry& entry, const DesignOptions& options) {
  const analysis::TaskImpedance& given = entry.impedance;
  analysis::LoopLimit limit{controller::timed(options.timing, entry.loop), options.margin};
  if (const double time = options.timing.integral_time; time > 0) {
    analysis::to_joint_space(given);  // throws for wrong sizes
    limit.loop.memory =
        controller::integral_memory(controlled_stiffness(entry) / time, limit.loop.period);
  }
  return limit;
}

/// Assumptions of the loop in which the design is judged. Matrices do not include gravity.
std::vector<std::string> assumed(const DesignOptions& options,
                                 const std::optional<controller::RobotModel>& model) {
  controller::LoopTiming timing = options.timing;
  timing.ideal_gravity = timing.ideal_gravity || !model;
  return controller::loop_assumptions(timing, model ? &*model : nullptr);
}

/// Says that a gain margin cannot be kept: "NO ... keeps a gain margin of ..."
std::runtime_error lost_margin(const std::string& none, const DesignOptions& options,
                               double largest, const std::string& with) {
  const std::string reason =
      largest > 0 ? "largest margin is " + format_number(largest, 3) + ", with " + with
                  : "loop is unstable however little of the gains is left";
  return std::runtime_error(none + " keeps a gain margin of " + format_number(options.margin, 3) +
                            " with this period and delay; the " + reason);
}

Found design_one(const SystemEntry& entry, const DesignOptions& options) {
  const analysis::TaskImpedance& given = entry.impedance;
  const analysis::DampingStructure structure = options.damping_structure();
  if (options.near && (!given.jacobian || !given.task_damping)) {
    throw InputError(entry.prefix + "task_damping", "missing; --near stays near it");
  }
  const auto start = options.near ? given.task_damping : std::nullopt;
  const analysis::DampingTarget target = options.target();
  if (options.timing.period == 0)
    return {analysis::design_damping(given, target, structure, start), {}};
  const analysis::LoopLimit limit = limit_of(entry, options);
  analysis::SampledDamping found = analysis::design_damping(given, target, limit, structure, start);
  if (!found.kept) {
    const std::string where =
        entry.prefix.empty() ? "" : entry.prefix.substr(0, entry.prefix.size() - 1) + ": ";
    throw lost_margin(where + "no damping ratio up to " + format_number(options.ratio, 3), options,
                      found.gain_margin,
                      "a ratio of " + format_number(found.level * options.ratio, 3));
  }
  return {std::move(found.design),
          LoopReport{limit, found.level, found.gain_margin, std::move(found.sampled)}};
}

DesignReport report_on(const SystemEntry& entry, const DesignOptions& options) try {
  DesignReport report;
  report.key = key_of(entry.impedance);
  report.ratio = options.ratio;
  Found found = design_one(entry, options);
  report.design = std::move(found.design);
  report.loop = std::move(found.loop);
  report.impedance = analysis::with_damping(entry.impedance, report.design.damping);
  analysis::SpectrumOptions spectrum;
  spectrum.soft_frequency = options.soft_frequency;
  const auto largest = analysis::Pivot::kLargest;
  SystemEntry plain = entry;  // no responses
  plain.times.reset();
  report.before = make_report(plain, entry.system(entry.impedance), spectrum, largest);
  plain.impedance = report.impedance;
  analysis::System<> after = report.design.system;
  if (entry.loop.gears.any()) entry.loop.gears.extend(after);
  report.after = make_report(plain, after, spectrum, largest);
  report.gears = entry.loop.gears.any();
  if (report.gears) {
    report.notes.emplace_back(
        "the damping is designed for rigid gears; the modes include the elastic gears");
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

/// Names the rotors that an arm lacks and, if the ratio was lowered, the inertia that would be
/// enough. Empty if no rotors are missing.
std::string rotors_note(const DesignOptions& options, const controller::RobotModel& model,
                        const controller::JointVector& q, bool lowered) {
  std::string note = controller::missing_rotors_text(model);
  if (note.empty()) return "";
  note += options.timing.period > 0 ? ": fast modes and the possible damping are computed"
                                    : ": fast modes are computed";
  note += " for " + controller::arm_without_rotors(model) + ". ";
  if (lowered) {
    if (const controller::Drives* published = controller::unknown_rotors(model).published) {
      const controller::RobotModel with_rotors =
          controller::with_at_least(model, published->values(published->reflected_inertia));
      const std::string with =
          "With the published drives " + std::string(published->name) + " the loop ";
      try {
        const Found found = design_one(read_arm(options.arm, with_rotors, q), options);
        note += with + "allows a ratio of " + format_number(found.loop->level * options.ratio, 3) +
                ", margin " + format_number(found.loop->gain_margin, 4) + ". ";
      } catch (const std::runtime_error&) {
        note += with + "allows no ratio. ";
      }
    }
    const analysis::DampingDesign wanted = analysis::design_damping(
        read_arm(options.arm, model, q).impedance, options.target(), options.damping_structure());
    const auto enough = controller::enough_reflected_inertia(
        model, wanted.system, options.timing.period,
        [&](const controller::RobotModel& with_rotors) {
          const Found found = design_one(read_arm(options.arm, with_rotors, q), options);
          return found.loop->level == 1;
        });
    note += enough
                ? "With " + controller::inertia_text(model, *enough) +
                      " the loop would allow a ratio of " + format_number(options.ratio, 3) + ". "
                : "No reflected inertia would be enough. ";
  }
  return note + controller::rotors_hint(model, "--reflected-inertia", "--drives");
}

DesignReport report_on_arm(const DesignOptions& options, const SystemEntry& entry,
                           const controller::RobotModel& model, const controller::JointVector& q) {
  try {
    DesignReport report = report_on(entry, options);
    report.q = q;
    report.drives = options.arm.drives;
    if (!report.drives.empty()) {
      report.notes.push_back(controller::drives_text(model, report.drives));
    }
    const std::string note = rotors_note(options, model, q, report.loop && report.loop->level < 1);
    if (!note.empty()) report.notes.push_back(note);
    const std::string friction = friction_note(options.arm, model);
    if (!friction.empty()) report.notes.push_back(friction);
    report.rotors = note.empty() ? "known" : "unknown";
    return report;
  } catch (const InputError&) {
    throw;
  } catch (const std::runtime_error& error) {  // the margin is lost
    const std::string note = rotors_note(options, model, q, options.timing.period > 0);
    throw std::runtime_error(error.what() + (note.empty() ? "" : "; " + note));
  }
}

/// Returns the smallest damping ratio of the modes of all sampled loops with this damping.
double sampled_ratio(const SystemFile& file, const DesignOptions& options,
                     const Eigen::MatrixXd& damping) {
  double smallest = std::numeric_limits<double>::infinity();
  for (const SystemEntry& entry : file.entries) {
    const auto system = entry.system(analysis::with_damping(entry.impedance, damping));
    const analysis::Spectrum<> spectrum = analysis::analyze(system);
    const analysis::SampledSpectrum found =
        analysis::sample_loop(system, spectrum, with_gears(limit_of(entry, options).loop));
    for (const analysis::SampledMode& mode : found.modes) {
      if (mode.natural_frequency > options.soft_frequency) {
        smallest = std::min(smallest, mode.damping_ratio);
      }
    }
  }
  return smallest;
}

/// Returns the matrix for all configurations though it keeps no margin.
RegionReport search_region(const SystemFile& file, const DesignOptions& options) {
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
  region.target = options.target();
  region.structure = options.damping_structure();
  region.ceiling = options.largest_ratio;
  if (options.contact > 0 && !region.ceiling) region.ceiling = kMostAgainstTouches;
  region.threads = options.threads;
  const StopSignal stop;
  region.progress = [](double done) {
    if (StopSignal::given()) {
      throw Interrupted("the search for the region was " + format_number(100 * done, 2) +
                        " % done; it has no damping to show before its end");
    }
    show_progress(done);
  };
  region.gain_margin = options.margin;
  if (options.timing.period > 0) {
    region.loop = [&](std::size_t i) { return limit_of(file.entries[i], options).loop; };
  }
  try {
    RegionReport report{key_of(configurations[0]), options.ratio,
                        analysis::design_region(configurations, region)};
    if (options.timing.period > 0) report.limit = limit_of(file.entries[0], options);
    return report;
  } catch (const analysis::InvalidSystem&) {
    for (const SystemEntry& entry : file.entries) report_on(entry, options);  // names the entry
    throw;
  }
}

RegionReport report_on_region(const SystemFile& file, const DesignOptions& options,
                              const std::optional<controller::RobotModel>& model,
                              const std::vector<JointVector>& postures) {
  const auto search = [&](const SystemFile& all) { return search_region(all, options); };
  const auto ratio = [&](const SystemFile& all, const Eigen::MatrixXd& damping) {
    return options.timing.period > 0 ? sampled_ratio(all, options, damping) : 0;
  };
  RegionReport report = options.contact > 0
                            ? design_for_contact(options, file, *model, postures, search, ratio)
                            : search(file);
  if (report.postures.empty()) report.postures = postures;
  const analysis::RegionDesign& design = report.design;
  if (design.kept) return report;
  throw lost_margin("no share of the damping found for the region", options, design.gain_margin,
                    "a share of " + format_number(design.share, 3) + ", at configuration [" +
                        std::to_string(design.margin_sample) + "]");
}

/// The postures that the options ask for; the one of --q if they list none.
std::vector<JointVector> region_postures(const DesignOptions& options,
                                         const controller::RobotModel& model) {
  const JointVector q = options.arm.posture.read(model);
  if (!options.postures.any()) return {q};
  std::vector<JointVector> postures = options.postures.listed(options.arm.posture, model);
  if (!postures.empty()) return postures;
  JointVector lower, upper;
  options.postures.range(model, q, lower, upper);
  const controller::PostureSequence sequence(lower, upper, options.postures.seed);
  for (std::int64_t i = 0; i < options.postures.samples; ++i) postures.push_back(sequence.at(i));
  return postures;
}

/// If the tip springs lose a direction at q, damping designed there is useless at other postures.
void refuse_singular(const DesignOptions& options, const controller::RobotModel& model,
                     const JointVector& q) {
  if (options.region || options.arm.task_stiffness.empty()) return;
  const std::string lost = controller::lost_directions(model, q);
  if (lost.empty()) return;
  throw InputError("--q", "the posture is singular: no spring acts in direction " + lost +
                              ", and damping that is designed here fits no posture beside it; take "
                              "another --q, or many (--region)");
}

void run_design(const DesignOptions& options, OutputFile& csv) try {
  SystemFile file;
  std::optional<controller::RobotModel> model;
  std::vector<JointVector> postures;
  if (options.arm.urdf.empty()) {
    file = read_systems(options.file);
  } else {
    model = read_model(options.arm);
    postures = region_postures(options, *model);
    refuse_singular(options, *model, postures.front());
    for (const JointVector& q : postures) {
      file.entries.push_back(read_arm(options.arm, *model, q));
      if (postures.size() > 1) {
        file.entries.back().prefix = "posture [" + std::to_string(file.entries.size() - 1) + "].";
      }
    }
    if (const auto& stiffness = file.entries.front().impedance.task_stiffness) {
      controller::Gains gains;
      gains.task_stiffness = *stiffness;
      warn_of(*model, gains);
    }
  }
  if (options.region || options.contact > 0) {
    RegionReport report = report_on_region(file, options, model, postures);
    report.assumes = assumed(options, model);
    if (csv) csv.write(region_csv(report));
    csv.finish();
    print(options.json ? region_json(report) : region_table(report));
    const std::string complaint = region_complaint(report);
    if (!complaint.empty()) throw std::runtime_error(complaint);
    return;
  }
  std::vector<DesignReport> reports;
  const auto each = [&](const SystemEntry& entry) {
    reports.push_back(model ? report_on_arm(options, entry, *model, postures[0])
                            : report_on(entry, options));
    reports.back().assumes = assumed(options, model);
  };
  const std::string interrupted = for_each_shown(file.entries, each, "systems");
  print(options.json ? design_json(reports, file.is_list) : design_table(reports, file.is_list));
  if (!interrupted.empty()) throw Interrupted(interrupted);
} catch (const InputError& error) {
  if (options.file.empty()) throw;
  throw error.in_file(options.file);
}

constexpr const char* kDesignHelp =
    R"(FILE is as for `dashpot analyze`, with mass, jacobian and task_stiffness; its damping is the
existing one (joint friction, null-space damping). `before` shows the modes with task_damping, and
--near keeps the new matrix near it. Without a jacobian the damping is designed in joint space. The
matrix is always positive semidefinite; a mode that cannot have its ratio is named, with the reason.
With --period the sampled loop keeps its margin: the ratio is lowered if necessary, with --region
the whole matrix. The exit status is 1 if no damping keeps the margin, or if the damping of a region
gives less than a tenth of the wanted ratio somewhere, or more than is allowed.
)";

}  // namespace

void add_design(CLI::App& program) {
  CLI::App* command =
      program.add_subcommand("design", "The damping matrix that gives every mode a damping ratio");
  const auto options = std::make_shared<DesignOptions>();
  add_design_options(*command, *options);
  command->footer(std::string(kDesignHelp) + kUnitsHelp + "\n" + kExitStatusHelp);
  command->callback([options] {
    check(*options);
    check_outputs({{"--csv", options->csv}}, {{"FILE", options->file},
                                              {"--urdf", options->arm.urdf},
                                              {"--postures", options->postures.file},
                                              {"--log", options->postures.log}});
    OutputFile csv("--csv", options->csv);
    run_design(*options, csv);
  });
}

}  // namespace dashpot::apps
