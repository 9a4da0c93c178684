#include <dashpot/apps/cli/number_list.hpp>
#include <dashpot/apps/cli/output_file.hpp>
#include <dashpot/apps/cli/subcommands.hpp>
#include <dashpot/apps/cli/system_file.hpp>
#include <dashpot/apps/cli/terminal.hpp>
#include <dashpot/apps/report/json.hpp>
#include <dashpot/apps/report/system_report.hpp>
#include <dashpot/apps/report/text_table.hpp>
#include <dashpot/controller/input_error.hpp>
#include <dashpot/text/printable.hpp>

#include <unistd.h>
#include <CLI/CLI.hpp>
#include <algorithm>
#include <array>
#include <cmath>
#include <cstdlib>
#include <limits>
#include <map>
#include <memory>
#include <sstream>
#include <string>
#include <vector>

namespace dashpot::apps {
namespace {

using Modes = analysis::ModeList<analysis::kDynamic>;

/// Returns the colour of a mode in both pictures, as gnuplot's `lc rgb variable` takes it.
int colour(int mode) {
  static constexpr std::array<int, 8> kColours = {0x1f77b4, 0xd62728, 0x2ca02c, 0x9467bd,
                                                  0xff7f0e, 0x17becf, 0x8c564b, 0xe377c2};
  return kColours[static_cast<std::size_t>(mode) % kColours.size()];
}

/// How far the picture of the plane reaches, 1/s.
struct Window {
  double left = 0, right = 0, top = 0;
};

/// Complex eigenvalues and unstable ones fill the picture. Real ones may be a thousand times faster
/// than these, and do not, unless there are no others.
Window window_of(const Modes& modes) {
  double complex = 0, real = 0, right = 0;
  for (const auto& mode : modes) {
    for (const analysis::Complex& value : mode.eigenvalues) {
      double& reach = value.imag() == 0 ? real : complex;
      if (std::isfinite(std::abs(value))) reach = std::max(reach, std::abs(value));
      if (std::isfinite(value.real())) right = std::max(right, value.real());
    }
  }
  double reach = 1.15 * (complex > 0 ? complex : real);
  if (reach == 0) reach = 1;
  return {-reach, std::max(0.06 * reach, 1.15 * right), reach};
}

/// Writes the plane: eigenvalues with the number of their mode, and lines of equal ratio.
void write_plane(const Modes& modes, std::ostream& out) {
  const Window window = window_of(modes);
  const double most = 0.92 * window.top;
  std::ostringstream labels;
  out << "$lines << EOD\n";
  for (const double ratio : {0.1, 0.3, 0.5, 0.7, 0.9}) {
    const double x = -ratio * most, y = std::sqrt(1 - ratio * ratio) * most;
    out << "0 0\n" << x << ' ' << y << "\n\n";
    labels << "set label '" << ratio << "' at " << x << ',' << y
           << " offset -0.5,0.5 center tc rgb '#888888'\n";
  }
  out << "EOD\n$values << EOD\n";
  int outside = 0;
  for (int i = 0; i < modes.size(); ++i) {
    for (const analysis::Complex& value : modes[i].eigenvalues) {
      if (!std::isfinite(std::abs(value)) || value.imag() < 0) continue;
      if (value.real() >= window.left) {
        out << value.real() << ' ' << value.imag() << ' ' << i + 1 << ' ' << colour(i) << '\n';
        continue;
      }
      labels << "set label '<- " << i + 1 << ": " << format_number(value.real(), 3) << "' at "
             << window.left << ",0 offset 0.5," << 1 + outside++ << " tc rgb " << colour(i) << '\n';
    }
  }
  out << "nan nan nan 0\nEOD\n"  // gnuplot wants a line
      << labels.str() << "set title 'eigenvalues, upper half, with lines of equal ratio'\n"
      << "set xlabel 'real part, 1/s'\nset ylabel 'imaginary part, rad/s'\nset size ratio -1\n"
      << "set xrange [" << window.left << ':' << window.right << "]\nset yrange [0:" << window.top
      << "]\nset xzeroaxis lt 1 lc rgb '#bbbbbb'\nset yzeroaxis lt 1 lc rgb '#bbbbbb'\n"
      << "plot $lines using 1:2 with lines lc rgb '#cccccc' notitle, "
      << "$values using 1:2:4 with points pt 7 ps 1 lc rgb variable notitle, "
      << "$values using 1:2:3 with labels offset 1.2,0.6 notitle\n"
      << "unset label\nunset xzeroaxis\nunset yzeroaxis\nset size noratio\n";
}

/// Writes the shapes: a row of bars for each mode, relative to the largest entry.
void write_shapes(const Modes& modes, std::ostream& out) {
  constexpr double kHeight = 0.42;  // of the largest bar, in rows
  const Eigen::Index n = modes[0].shapes[0].size();
  std::ostringstream tics;
  for (const bool late : {false, true}) {
    out << (late ? "$late << EOD\n" : "$bars << EOD\n");
    const double half = late ? 0.07 : 0.36;  // of the width
    for (int i = 0; i < modes.size(); ++i) {
      const Eigen::VectorXcd shape = modes[i].shapes[0];
      const double largest = std::max(1e-300, shape.cwiseAbs().maxCoeff());
      for (Eigen::Index k = 0; k < n; ++k) {
        const double value = (late ? shape[k].imag() : shape[k].real()) / largest;
        const auto x = static_cast<double>(k + 1), y = -static_cast<double>(i + 1);
        const double end = y + kHeight * value;
        out << x << ' ' << y << ' ' << x - half << ' ' << x + half << ' ' << std::min(y, end) << ' '
            << std::max(y, end) << ' ' << (late ? 0x333333 : colour(i)) << '\n';
      }
      if (late) continue;
      const bool known = std::isfinite(modes[i].natural_frequency);
      tics << (i > 0 ? ", '" : "'") << i + 1 << ": "
           << (known ? format_number(modes[i].natural_frequency, 4) + " rad/s, " +
                           format_number(modes[i].damping_ratio, 3)
                     : analysis::to_text(modes[i].kind))
           << "' " << -(i + 1);
    }
    out << "EOD\n";
  }
  out << "set title 'mode shapes (thin: a quarter period apart)'\n"
      << "set xlabel 'coordinate'\nunset ylabel\nset xrange [0.4:" << static_cast<double>(n) + 0.6
      << "]\nset yrange [" << -modes.size() - 0.6 << ":-0.4]\nset ytics (" << tics.str() << ")\n"
      << (n <= 20 ? "set xtics 1\n" : "set xtics auto\n")
      << "set grid ytics lt 1 lc rgb '#dddddd'\nset style fill solid noborder\n"
      << "plot $bars using 1:2:3:4:5:6:7 with boxxyerror lc rgb variable notitle, "
      << "$late using 1:2:3:4:5:6:7 with boxxyerror lc rgb variable notitle\n";
}

/// Draws the eigenvalues of a system in the complex plane, with lines of equal damping ratio, and
/// its mode shapes as bars, to `path`. Throws InputError if there are no modes, and
/// std::runtime_error if gnuplot is missing or fails.
void draw_modes(const std::string& path, const std::string& title, const Report& report) {
  const Modes& modes = report.spectrum.modes;
  if (modes.empty()) throw controller::InputError("--plot", "there are no modes to draw");
  const int height = std::clamp(140 + 34 * modes.size(), 480, 2000);
  std::ostringstream out;
  out << plot_heading(path, 1200, height) << "set termoption noenhanced\n"
      << "set multiplot layout 1,2 title " << quoted_for_gnuplot(text::printable(title)) << '\n';
  write_plane(modes, out);
  write_shapes(modes, out);
  out << "unset multiplot\n";
  run_gnuplot(path, out.str());
}

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
