#include <dashpot/apps/cli/gnuplot.hpp>
#include <dashpot/apps/cli/output_file.hpp>
#include <dashpot/apps/cli/subcommands.hpp>
#include <dashpot/apps/cli/terminal.hpp>
#include <dashpot/apps/identify/identify.hpp>
#include <dashpot/apps/identify/identify_plot.hpp>
#include <dashpot/apps/report/json.hpp>

#include <CLI/CLI.hpp>
#include <algorithm>
#include <memory>
#include <nlohmann/json.hpp>
#include <stdexcept>
#include <string>

namespace dashpot::apps {
namespace {

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
