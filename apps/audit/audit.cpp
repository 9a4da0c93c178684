#include <dashpot/analysis/system.hpp>
#include <dashpot/apps/audit/audit_report.hpp>
#include <dashpot/apps/cli/output_file.hpp>
#include <dashpot/apps/cli/subcommands.hpp>
#include <dashpot/apps/cli/terminal.hpp>
#include <dashpot/apps/report/text_table.hpp>
#include <dashpot/controller/posture.hpp>
#include <dashpot/controller/rotors.hpp>
#include <dashpot/text/printable.hpp>

#include <CLI/CLI.hpp>
#include <algorithm>
#include <cmath>
#include <memory>
#include <sstream>
#include <stdexcept>
#include <string>
#include <vector>

namespace dashpot::apps {

using controller::Audit;
using controller::JointVector;
using controller::PostureNumbers;

namespace {

using Numbers = std::vector<controller::PostureNumbers>;

/// The share of the postures, in %, in each of equal classes of the smallest ratio, as lines for
/// gnuplot: middle of the class, share.
std::string histogram(const Numbers& numbers, double most, int classes) {
  std::vector<std::int64_t> counts(static_cast<std::size_t>(classes));
  std::int64_t all = 0;
  for (const controller::PostureNumbers& one : numbers) {
    if (std::isnan(one.smallest_ratio)) continue;
    const double place = classes * std::max(0.0, one.smallest_ratio) / most;
    ++counts[static_cast<std::size_t>(std::min(place, classes - 0.5))];
    ++all;
  }
  std::ostringstream lines;
  for (int i = 0; i < classes; ++i) {
    const auto count = static_cast<double>(counts[static_cast<std::size_t>(i)]);
    lines << (i + 0.5) * most / classes << ' '
          << 100 * count / static_cast<double>(std::max<std::int64_t>(all, 1)) << '\n';
  }
  return lines.str();
}

/// At most some thousand postures with a finite margin: ratio, margin.
std::string margins(const Numbers& numbers) {
  constexpr std::size_t kMost = 4000;
  const std::size_t step = std::max<std::size_t>(1, numbers.size() / kMost);
  std::ostringstream lines;
  for (std::size_t i = 0; i < numbers.size(); i += step) {
    if (!std::isfinite(numbers[i].smallest_ratio + numbers[i].gain_margin)) continue;
    lines << numbers[i].smallest_ratio << ' ' << numbers[i].gain_margin << '\n';
  }
  return lines.str();
}

/// The diagonal of a matrix of gains; says so if other entries are not zero.
std::string gains_text(const std::string& name, const Eigen::MatrixXd& gains) {
  const Eigen::VectorXd diagonal = gains.diagonal();
  return name + " = diag(" + format_list(diagonal, 3) + ")" +
         (gains.isDiagonal(0) ? "" : " and more");
}

/// The arm and its gains as a title of two lines, in gnuplot's words.
std::string title(const AuditTask& task) {
  const controller::Gains& gains = task.options.gains;
  const bool joint = task.options.mode == controller::Mode::kJoint;
  const std::string stiffness =
      joint ? gains_text("K", gains.joint_stiffness) : gains_text("K_C", gains.task_stiffness);
  const std::string damping =
      joint ? gains_text("C", gains.joint_damping) : gains_text("C_C", gains.task_damping);
  return quoted_for_gnuplot(text::printable(task.model.name()) + ", " + stiffness) + ".\"\\n\"." +
         quoted_for_gnuplot(damping) + "\n";
}

std::string script(const std::string& path, const AuditTask& task, const Numbers& numbers) {
  constexpr int kClasses = 60;
  double most = std::isnan(task.intended_ratio) ? 0.1 : 1.1 * task.intended_ratio;
  for (const controller::PostureNumbers& one : numbers) {
    if (one.smallest_ratio <= 2) most = std::max(most, 1.05 * one.smallest_ratio);
  }
  const std::string points = margins(numbers);
  std::ostringstream out;
  out << plot_heading(path, 900, points.empty() ? 420 : 760) << "$ratios << EOD\n"
      << histogram(numbers, most, kClasses) << "EOD\nset xrange [0:" << most
      << "]\nset style fill solid 0.7\nset boxwidth " << most / kClasses
      << "\nset key top right\nset xlabel 'smallest damping ratio of a posture'\n"
      << "set ylabel '% of " << numbers.size() << " postures'\n";
  out << "set termoption noenhanced\n"
      << (points.empty() ? "set title " : "set multiplot layout 2,1 title ") << title(task);
  if (!std::isnan(task.intended_ratio)) {
    out << "set arrow 1 from " << task.intended_ratio << ", graph 0 to " << task.intended_ratio
        << ", graph 1 nohead lw 2 lc rgb '#d62728'\nset label 1 ' meant: "
        << format_number(task.intended_ratio, 3) << "' at " << task.intended_ratio
        << ", graph 0.9 right tc rgb '#d62728'\n";
  }
  out << "plot $ratios using 1:2 with boxes lc rgb '#1f77b4' notitle\n";
  if (!points.empty()) {
    out << "$margins << EOD\n"
        << points << "EOD\nset ylabel 'gain margin'\nset yrange [0:*]\nunset label 1\n"
        << "plot $margins using 1:2 with points pt 7 ps 0.3 lc rgb '#1f77b4' notitle, "
        << "1 with lines lw 2 lc rgb '#d62728' title '"
        << (controller::unknown_rotors(task.model).any() ? "too little below 1; rotors unknown"
                                                         : "unstable below 1")
        << "'\nunset multiplot\n";
  }
  return out.str();
}

/// Draws the smallest ratios of many postures, and their gain margins if they have any, to a file
/// whose name ends with .svg or .png. Throws std::runtime_error if gnuplot fails.
void draw_audit(const std::string& path, const AuditTask& task, const Numbers& numbers) {
  run_gnuplot(path, script(path, task, numbers));
}

/// The postures of a task, by number.
struct Postures {
  const AuditTask& task;
  const Audit& audit;
  std::uint64_t seed;
  std::int64_t count;

  JointVector at(std::int64_t i) const {
    if (task.postures.empty()) return audit.posture(seed, i);
    return task.postures[static_cast<std::size_t>(i)];
  }
  std::vector<PostureNumbers> numbers(std::int64_t first, std::int64_t size) const {
    if (task.postures.empty()) return audit.sample(seed, first, size);
    std::vector<PostureNumbers> result;
    for (std::int64_t i = first; i < first + size; ++i) result.push_back(audit.numbers(at(i)));
    return result;
  }
};

void write_csv(OutputFile& file, const Postures& postures,
               const std::vector<PostureNumbers>& numbers) {
  file.write(csv_heading(postures.task.model));
  for (std::size_t i = 0; i < numbers.size(); ++i) {
    const auto index = static_cast<std::int64_t>(i);
    file.write(csv_line(index, postures.at(index), numbers[i]));
  }
  file.finish();
}

void suggest(const Audit& audit, const AuditTask& task, AuditReport& report) {
  if (report.posture.numbers.singular) {
    const std::string directions = task.options.mode == controller::Mode::kCartesian
                                       ? controller::lost_directions(task.model, task.q)
                                       : "";
    report.lost_directions = directions.empty() ? "some" : directions;
    report.no_suggestion =
        "where the posture is singular, the damping for it fits no posture beside it; take another "
        "--q, or many (dashpot design --region)";
    return;
  }
  try {
    report.suggestion = audit.suggest(task.q, task.wanted_ratio);
  } catch (const std::exception& error) {  // such as a stiffness of zero
    report.no_suggestion = error.what();
  }
}

void run_audit(const AuditCommand& command) try {
  const AuditTask task = read_task(command);
  const Audit audit(task.model, task.options);
  OutputFile csv("--csv", command.csv);
  AuditReport report;
  report.posture = audit.audit(task.q);
  report.posture.rotors = audit.missing_rotors(report.posture);
  suggest(audit, task, report);
  const std::int64_t listed = static_cast<std::int64_t>(task.postures.size());
  const Postures postures{task, audit, command.postures.seed,
                          listed > 0 ? listed : command.postures.samples};
  if (postures.count > 0) {
    const std::vector<PostureNumbers> numbers =
        PostureWorkers<PostureNumbers>(postures.count, [&](std::int64_t first, std::int64_t size) {
          return postures.numbers(first, size);
        }).run(command.jobs);
    report.interrupted = static_cast<std::int64_t>(numbers.size()) < postures.count;
    report.workspace = controller::summarize(
        audit, numbers, [&postures](std::int64_t i) { return postures.at(i); });
    if (csv) write_csv(csv, postures, numbers);
    if (!command.plot.empty()) draw_audit(command.plot, task, numbers);
  }
  print(command.json ? audit_json(task, report) : audit_table(task, report));
  if (report.interrupted) {
    throw Interrupted(std::to_string(report.workspace->samples) + " of " +
                      std::to_string(postures.count) + " postures were audited");
  }
} catch (const std::invalid_argument& error) {
  throw InputError("", error.what());
}

constexpr const char* kAuditHelp =
    R"(The modes of  M q'' + C q' + K q = 0  with gains as a controller states them, where the ratio
that they were meant to give is F/2 for a damping of F sqrt(stiffness). Damping, pole and margin are
given at one posture, with proved bounds, and over many. A quaternion's vector part is half of the
rotation vector, so that half-quaternion halves the rotational stiffness, not the damping. Ctrl-C
ends the sampling with what is done.
)";

}  // namespace

void add_audit(CLI::App& program) {
  CLI::App* command =
      program.add_subcommand("audit", "What the gains of a controller really do on an arm");
  command->alias("modes");  // the word that many look for
  const auto options = std::make_shared<AuditCommand>();
  add_audit_options(*command, *options);
  command->footer(std::string(kAuditHelp) + kUnitsHelp + "\n" + kExitStatusHelp);
  command->callback([options] {
    check_outputs({{"--csv", options->csv}, {"--plot", options->plot}},
                  {{"CONFIG", options->config},
                   {"--urdf", options->arm.urdf},
                   {"--gains", options->gains},
                   {"--postures", options->postures.file},
                   {"--log", options->postures.log}});
    run_audit(*options);
  });
}

}  // namespace dashpot::apps
