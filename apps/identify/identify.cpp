#include <dashpot/apps/cli/output_file.hpp>
#include <dashpot/apps/cli/subcommands.hpp>
#include <dashpot/apps/cli/terminal.hpp>
#include <dashpot/apps/identify/identify.hpp>
#include <dashpot/apps/report/json.hpp>

#include <CLI/CLI.hpp>
#include <algorithm>
#include <memory>
#include <nlohmann/json.hpp>
#include <numbers>
#include <sstream>
#include <stdexcept>

namespace dashpot::apps {
namespace {

/// Draws how the poles of the first posture's models settle as their order rises, and the measured
/// modes with their 95 % intervals beside the predicted ones. Throws std::runtime_error if gnuplot
/// is missing or fails.
void draw_identification(const std::string& path, const IdentifyReport& report) {
  if (report.postures.empty()) throw std::runtime_error("--plot: there is nothing to draw");
  const PostureReport& posture = report.postures.front();
  constexpr double kHertz = 1 / (2 * std::numbers::pi);
  // The measured modes fill the picture; predictions far from them are left out.
  double most = 0, largest_ratio = 1;
  for (const identification::MeasuredMode& mode : posture.found.modes) {
    most = std::max(most, 2 * kHertz * mode.natural_frequency);
  }
  for (const PredictedMode& mode : posture.predicted) {
    if (posture.found.modes.empty()) most = std::max(most, 1.2 * kHertz * mode.natural_frequency);
  }
  if (most == 0) most = 10;
  for (const identification::MeasuredMode& mode : posture.found.modes) {
    largest_ratio = std::max(largest_ratio, 1.1 * mode.damping_ratio);
  }
  for (const PredictedMode& mode : posture.predicted) {
    if (kHertz * mode.natural_frequency > most) continue;
    largest_ratio = std::max(largest_ratio, 1.1 * mode.damping_ratio);
  }
  std::ostringstream out;
  out << plot_heading(path, 900, 800) << "set multiplot layout 2,1\nset xrange [0:" << most
      << "]\nset style fill solid\n$all << EOD\n";
  for (const bool stable : {false, true}) {
    if (stable) out << "EOD\n$stable << EOD\n";
    for (const identification::ModelPole& pole : posture.found.poles) {
      if (pole.stable != stable || pole.damping_ratio >= 1) continue;
      out << kHertz * pole.natural_frequency << ' ' << pole.order << '\n';
    }
    out << "nan nan\n";  // gnuplot wants a line
  }
  out << "EOD\n$measured << EOD\n";
  for (const identification::MeasuredMode& mode : posture.found.modes) {
    out << kHertz * mode.natural_frequency << ' ' << mode.damping_ratio << ' '
        << 1.96 * kHertz * mode.natural_frequency_std << ' ' << 1.96 * mode.damping_ratio_std
        << '\n';
  }
  out << "nan nan nan nan\nEOD\n$predicted << EOD\n";
  for (const PredictedMode& mode : posture.predicted) {
    out << kHertz * mode.natural_frequency << ' ' << mode.damping_ratio << '\n';
  }
  out << "nan nan\nEOD\n";
  int number = 0;
  for (const identification::MeasuredMode& mode : posture.found.modes) {
    const double f = kHertz * mode.natural_frequency;
    out << "set arrow " << ++number << " from " << f << ", graph 0 to " << f
        << ", graph 1 nohead lc rgb '#bbbbbb'\n";
  }
  out << "set key outside top center horizontal\nset ylabel 'order of the model'\n"
      << "plot $all using 1:2 with points pt 6 ps 0.6 lc rgb '#999999' title 'pole', "
      << "$stable using 1:2 with points pt 7 ps 0.7 lc rgb '#1f77b4' title 'stable', "
      << "1/0 with lines lc rgb '#bbbbbb' title 'mode'\n"
      << "set xlabel 'natural frequency, Hz'\nset ylabel 'damping ratio'\nset yrange [0:"
      << largest_ratio << "]\n"
      << "plot $measured using 1:2:3:4 with xyerrorbars pt 7 ps 0.7 lw 1.5 lc rgb '#1f77b4' title "
         "'measured, 95 %'";
  if (report.against) {
    out << ", $predicted using 1:2 with points pt 4 ps 1.6 lw 1.5 lc rgb '#d62728' title "
           "'predicted'";
  }
  out << "\nunset multiplot\n";
  run_gnuplot(path, out.str());
}

constexpr const char* kHelp =
    R"(FILE is an LCM log of `dashpot run` or `dashpot drive`, or a CSV file with a line of names and
units ("time [s], q1 [rad], ..."). Several files are one experiment. Free decays, after a push, a
release or a step, are found unless --from or --to says where one is. With --inputs, or a chirp of
`run --excite` in the log, the modes come from the response to these inputs. With --ambient they
come from motion that many small unknown forces cause for a minute or more.
)";

}  // namespace

void add_identify(CLI::App& program) {
  CLI::App* command =
      program.add_subcommand("identify", "The modes that an arm really has, from recorded motion");
  const auto options = std::make_shared<IdentifyCommand>();
  command->add_option("FILE", options->files, "Records: LCM logs or CSV files")->required();
  command
      ->add_option("--channels", options->channels,
                   "Columns to use, by name; without it all positions, or else all velocities")
      ->option_text("NAME,...");
  command
      ->add_option("--rate", options->hints.rate,
                   "Samples in a second, for files without a column of time")
      ->option_text("HZ")
      ->check(CLI::Range(1e-9, 1e9));
  command
      ->add_option("--columns", options->hints.columns,
                   "Names and units of all columns, for files without a line of them")
      ->option_text("NAME,...");
  CLI::Option* ambient = command->add_flag("--ambient", options->ambient,
                                           "Unmeasured forces shake the arm all the time");
  command
      ->add_option("--inputs", options->inputs,
                   "Columns of what moved the arm from outside: forces, torques, set-points")
      ->option_text("NAME,...")
      ->excludes(ambient);
  command
      ->add_flag("--excited", options->excited,
                 "The wrench of the excitation in a log moved the arm; without it only if it "
                 "changes all the time")
      ->excludes(ambient);
  command->add_flag(
      "--large-motion", options->large_motion,
      "Treat motion of more than 0.5 rad as linear: right if the moved inertia is constant, "
      "such as on a lone joint");
  command
      ->add_option("--from", options->from,
                   "Begin of a free decay, or of the part used, s after the file's first sample")
      ->option_text("S");
  command->add_option("--to", options->to, "End of it, s")->option_text("S");
  command
      ->add_option(
          "--order", options->order,
          "Largest order of the models tried, eigenvalues; 0: 2 for each channel, at least "
          "12; with --ambient 4 for each channel and 4")
      ->check(CLI::Range(0, 60));
  CLI::Option* against =
      command
          ->add_option("--against", options->against,
                       "Configuration of the controller, whose predicted modes are shown as well")
          ->option_text("CONFIG");
  CLI::Option* calibrated =
      command
          ->add_option("--calibrate", options->calibrate,
                       "Explain the differences by payload, payload_center, payload_inertia, "
                       "reflected_inertia, friction, gear_stiffness, delay: those named")
          ->option_text("NAME,...")
          ->needs(against);
  command
      ->add_option("--output", options->output, "The configuration with the results of --calibrate")
      ->option_text("CONFIG")
      ->needs(calibrated);
  command
      ->add_option("--plot", options->plot,
                   "Picture of the stabilisation of the poles, and of measured beside predicted "
                   "modes; .svg or .png")
      ->option_text("FILE");
  command->add_flag("--json", options->json, "Print one JSON object");
  command->footer(std::string(kHelp) + kExitStatusHelp);
  command->callback([options] {
    std::vector<NamedFile> inputs = {{"--against", options->against}};
    add_records(options->files, inputs);
    check_outputs({{"--output", options->output}, {"--plot", options->plot}}, inputs);
    if (!options->plot.empty()) check_plot_name(options->plot);
    const StopSignal signal;
    options->stop = [](double done) {
      show_progress(done);
      return StopSignal::given();
    };
    const IdentifyReport report = identify_files(*options);
    if (!options->plot.empty()) draw_identification(options->plot, report);
    print(options->json ? json_text(identify_json(report)) : identify_table(report));
    if (StopSignal::given()) throw Interrupted("the modes above are those found until then");
    const bool any = std::any_of(report.postures.begin(), report.postures.end(),
                                 [](const auto& posture) { return !posture.found.modes.empty(); });
    if (any && !options->calibrate.empty() && !report.calibration) {
      throw std::runtime_error(
          "--calibrate: no mode that was measured is like one that is predicted");
    }
    if (any) return;
    throw std::runtime_error("no modes: " + report.advice);
  });
}

}  // namespace dashpot::apps
