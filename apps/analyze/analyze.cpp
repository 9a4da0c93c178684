#include <dashpot/apps/analyze/analyze_plot.hpp>
#include <dashpot/apps/cli/gnuplot.hpp>
#include <dashpot/apps/cli/number_list.hpp>
#include <dashpot/apps/cli/output_file.hpp>
#include <dashpot/apps/cli/subcommands.hpp>
#include <dashpot/apps/cli/system_file.hpp>
#include <dashpot/apps/cli/terminal.hpp>
#include <dashpot/apps/report/json.hpp>
#include <dashpot/apps/report/system_report.hpp>
#include <dashpot/apps/report/text_table.hpp>

#include <unistd.h>
#include <CLI/CLI.hpp>
#include <cstdlib>
#include <limits>
#include <map>
#include <memory>
#include <string>
#include <vector>

namespace dashpot::apps {
namespace {

using Residual = analysis::SpectrumOptions::Residual;

struct AnalyzeOptions {
  std::string file, plot;
  bool json = false;
  double soft_frequency = analysis::SpectrumOptions().soft_frequency;  // rad/s
  Residual residual = Residual::kAutomatic;
  analysis::Pivot pivot = analysis::Pivot::kLargest;
};

/// `interrupted`: how many are done if Ctrl-C ended it early; otherwise "".
std::vector<Report> make_reports(const SystemFile& file, const AnalyzeOptions& options,
                                 std::string& interrupted) {
  std::vector<analysis::System<>> systems;
  for (const SystemEntry& entry : file.entries) {
    try {
      systems.push_back(entry.system(entry.impedance));
    } catch (const analysis::InvalidSystem& error) {
      throw entry.error(error);
    }
  }
  analysis::SpectrumOptions spectrum;
  spectrum.soft_frequency = options.soft_frequency;
  spectrum.residual = options.residual;
  std::vector<Report> reports;
  const auto each = [&](const SystemEntry& entry) {
    try {
      reports.push_back(make_report(entry, systems[reports.size()], spectrum, options.pivot));
    } catch (const analysis::InvalidSystem& error) {
      throw entry.error(error);
    }
  };
  interrupted = for_each_shown(file.entries, each, "systems");
  return reports;
}

/// "3 coordinates: 2 vibration modes, 1 zero mode"
std::string plot_title(const AnalyzeOptions& options, const Report& report) {
  return options.file + ": " + count(report.dof, "coordinate") + ", " +
         count(report.spectrum.modes.size(), "vibration mode") + ", " +
         count(report.spectrum.zero_modes.count, "zero mode", "no");
}

void run_analyze(const AnalyzeOptions& options) try {
  if (!options.plot.empty()) check_plot_name(options.plot);
  check_outputs({{"--plot", options.plot}}, {{"FILE", options.file}});
  const SystemFile file = read_systems(options.file);
  if (!options.plot.empty() && file.entries.size() != 1) {
    throw InputError("--plot",
                     "draws one system; there are " + std::to_string(file.entries.size()));
  }
  std::string interrupted;
  const std::vector<Report> reports = make_reports(file, options, interrupted);
  if (!options.plot.empty() && !reports.empty()) {
    draw_modes(options.plot, plot_title(options, reports.front()), reports.front());
  }
  const bool bold = isatty(STDOUT_FILENO) != 0 && std::getenv("NO_COLOR") == nullptr;
  if (options.json) {
    print(to_json(reports, file.is_list));
  } else {  // a table of numbers: no text of the file is in it
    print_styled(to_table(reports, file.is_list, bold));
  }
  if (!interrupted.empty()) throw Interrupted(interrupted);
} catch (const InputError& error) {
  throw error.in_file(options.file);
}

/// An option whose value is one of the words in `choices`; `words` lists them for the help text.
template <class Value>
void add_choice(CLI::App& command, const std::string& name, const std::string& help,
                const std::string& words, const std::map<std::string, Value>& choices,
                const std::shared_ptr<AnalyzeOptions>& options, Value AnalyzeOptions::*member) {
  command
      .add_option_function<std::string>(
          name,
          [choices, options, member](const std::string& word) {
            (*options).*member = choices.at(word);
          },
          help)
      ->check(CLI::IsMember(choices))
      ->option_text(words);
}

}  // namespace

void add_analyze(CLI::App& program) {
  CLI::App* command = program.add_subcommand(
      "analyze", "Frequencies, damping ratios, zero modes and response of a system");
  const auto options = std::make_shared<AnalyzeOptions>();
  command->add_option("FILE", options->file, "YAML or JSON file; - reads standard input")
      ->required()
      ->option_text(" ");
  command->add_flag("--json", options->json, "Print JSON instead of a table");
  command
      ->add_option("--soft-frequency", options->soft_frequency,
                   "Call modes below this many rad/s soft")
      ->transform(quantity("rad/s", 0, std::numeric_limits<double>::max(), "a frequency in rad/s"))
      ->option_text("W (1e-06)");
  command
      ->add_option("--plot", options->plot,
                   "Draw eigenvalues and mode shapes of one system there, with gnuplot")
      ->option_text("FILE.svg|FILE.png");
  add_choice(*command, "--residual", "Precision of the residuals behind the error bounds",
             "automatic|working|extended (automatic)",
             {{"automatic", Residual::kAutomatic},
              {"working", Residual::kWorking},
              {"extended", Residual::kExtended}},
             options, &AnalyzeOptions::residual);
  add_choice(*command, "--pivot",
             "Coordinate that the constraint matrix eliminates for a zero mode",
             "largest|last (largest)",
             {{"largest", analysis::Pivot::kLargest}, {"last", analysis::Pivot::kLast}}, options,
             &AnalyzeOptions::pivot);
  command->footer(std::string(kSystemFileHelp) + "\n\n" + kExitStatusHelp);
  command->callback([options] { run_analyze(*options); });
}

}  // namespace dashpot::apps
