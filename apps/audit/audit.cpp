#include <dashpot/analysis/system.hpp>
#include <dashpot/apps/audit/audit_report.hpp>
#include <dashpot/apps/audit/posture_workers.hpp>
#include <dashpot/apps/cli/output_file.hpp>
#include <dashpot/apps/cli/subcommands.hpp>
#include <dashpot/apps/cli/terminal.hpp>
#include <dashpot/apps/report/text_table.hpp>
#include <dashpot/controller/posture.hpp>

#include <CLI/CLI.hpp>
#include <memory>
#include <stdexcept>
#include <string>
#include <vector>

namespace dashpot::apps {
namespace {

using controller::Audit;
using controller::JointVector;
using controller::PostureNumbers;

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
