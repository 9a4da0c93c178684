// dashpot contact: the command line, and the work.
#include <dashpot/apps/audit/audit_report.hpp>
#include <dashpot/apps/cli/number_list.hpp>
#include <dashpot/apps/cli/output_file.hpp>
#include <dashpot/apps/cli/subcommands.hpp>
#include <dashpot/controller/posture.hpp>
#include <dashpot/controller/rotors.hpp>

#include <CLI/CLI.hpp>
#include <cmath>
#include <limits>
#include <memory>
#include <stdexcept>

namespace dashpot::apps {
namespace {

using controller::Audit;
using controller::ContactOptions;
using controller::JointVector;

struct ContactCommand {
  AuditCommand audit;
  ContactOptions options;
  double asked = 0;
  std::string direction, plot;
};

/// Ten stiffnesses a decade, and zero.
std::vector<double> curve_stiffness() {
  constexpr int kFirst = 10, kLast = 80, kADecade = 10;
  std::vector<double> stiffness{0};
  for (int i = kFirst; i <= kLast; ++i) {
    stiffness.push_back(std::pow(10.0, static_cast<double>(i) / kADecade));
  }
  return stiffness;
}

PostureContact contact_at(const Audit& audit, const JointVector& q, const ContactOptions& options) {
  PostureContact found;
  found.held = controller::too_heavy(audit.model(), q).empty();
  found.touch.limit.stiffness = std::numeric_limits<double>::quiet_NaN();
  if (!found.held) return found;
  try {
    found.touch = controller::find_contact(audit, q, options);
  } catch (const std::exception&) {  // the tip cannot move, or no convergence
  }
  return found;
}

/// Returns the limit at the posture with the published rotors in place of missing ones; NaN if none
/// are published.
double limit_with_rotors(const AuditTask& task, const ContactReport& report) {
  const controller::Drives* published = controller::unknown_rotors(task.model).published;
  if (published == nullptr) return std::numeric_limits<double>::quiet_NaN();
  const Audit with(
      controller::with_at_least(task.model, published->values(published->reflected_inertia)),
      task.options);
  ContactOptions options = report.options;
  options.direction = report.posture.touch.direction;
  return controller::find_contact(with, task.q, options).limit.stiffness;
}

void sample(const Audit& audit, const AuditTask& task, const ContactCommand& command,
            ContactReport& report) {
  const auto listed = static_cast<std::int64_t>(task.postures.size());
  const std::int64_t count = listed > 0 ? listed : command.audit.postures.samples;
  const auto posture = [&](std::int64_t i) {
    return listed > 0 ? task.postures[static_cast<std::size_t>(i)]
                      : audit.posture(command.audit.postures.seed, i);
  };
  const auto find = [&](std::int64_t first, std::int64_t size) {
    std::vector<PostureContact> found;
    for (std::int64_t i = first; i < first + size; ++i) {
      found.push_back(contact_at(audit, posture(i), report.options));
    }
    return found;
  };
  report.workspace = PostureWorkers<PostureContact>(count, find).run(command.audit.jobs);
  report.interrupted = static_cast<std::int64_t>(report.workspace.size()) < count;
  for (std::size_t i = 0; i < report.workspace.size(); ++i) {
    report.postures.push_back(posture(static_cast<std::int64_t>(i)));
  }
}

void run_contact(const ContactCommand& command) try {
  ContactReport report;
  report.options = command.options;
  report.asked = command.asked;
  report.options.most = std::max(report.options.most, 1.01 * command.asked);
  if (!command.direction.empty()) report.options.direction = read_direction(command.direction);
  if (!command.plot.empty()) check_plot_name(command.plot);
  const AuditTask task = read_task(command.audit);
  const Audit audit(task.model, task.options);
  report.posture = controller::audit_contact(audit, task.q, report.options);
  ContactOptions here = report.options;
  here.direction = report.posture.touch.direction;
  report.curve = controller::contact_curve(audit, task.q, here, curve_stiffness());
  report.limit_with_rotors = limit_with_rotors(task, report);
  if (command.audit.postures.any()) sample(audit, task, command, report);
  if (!command.plot.empty()) draw_contact(command.plot, task, report);
  print(command.audit.json ? contact_json(task, report) : contact_table(task, report));
  if (report.interrupted) {
    throw Interrupted(std::to_string(report.workspace.size()) + " postures were looked at");
  }
} catch (const std::invalid_argument& error) {
  throw InputError("", error.what());
}

constexpr const char* kContactHelp =
    R"(Prints up to which stiffness of an undamped spring at the tip the sampled loop stays stable,
in one direction or in the direction with the lowest limit; whether the loop is passive; and the
forces that the joints can hold. The interval of the limit is proved at the posture. Ctrl-C ends the
sampling and prints the results so far.
)";

}  // namespace

void add_contact(CLI::App& program) {
  CLI::App* command = program.add_subcommand("contact", "What an arm may touch, press and hold");
  const auto options = std::make_shared<ContactCommand>();
  AuditCommand& audit = options->audit;
  constexpr double kMost = std::numeric_limits<double>::max();
  audit.timing.period = 1e-3;
  audit.arm.posture.has_to_hold = true;
  CLI::Option* config = add_stated_options(*command, audit);
  command->add_option("--period", audit.timing.period, "Of the control loop")
      ->excludes(config)
      ->transform(control_period())
      ->option_text("S (1 ms)");
  command->add_option("--direction", options->direction, "Of the touch, in the base's axes")
      ->option_text("x|y|z|a,b,c (lowest limit)")
      ->check(not_empty());
  command->add_option("--damper", options->options.damping, "Of what is touched")
      ->transform(quantity("N s/m", 0, kMost, "a damping of at least 0, in N s/m,"))
      ->option_text("B (0)");
  command->add_option("--mass", options->options.mass, "Of what is touched")
      ->transform(quantity("kg", 0, kMost, "a mass of at least 0, in kg,"))
      ->option_text("M (0)");
  command
      ->add_option("--touch", options->asked,
                   "Stiffness to touch: says whether the loop stays stable")
      ->transform(quantity("N/m", 0, 1e12, "a stiffness from 0 to 1e12, in N/m,"))
      ->option_text("K");
  command->add_option("--plot", options->plot, "Draw ratio and frequency over the stiffness there")
      ->option_text("FILE.svg|FILE.png");
  command->footer(std::string(kContactHelp) + kUnitsHelp + "\n" + kExitStatusHelp);
  command->callback([options] {
    check_outputs({{"--plot", options->plot}}, {{"CONFIG", options->audit.config},
                                                {"--urdf", options->audit.arm.urdf},
                                                {"--gains", options->audit.gains},
                                                {"--postures", options->audit.postures.file},
                                                {"--log", options->audit.postures.log}});
    run_contact(*options);
  });
}

}  // namespace dashpot::apps
