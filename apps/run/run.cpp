#include <dashpot/apps/cli/arm_option.hpp>
#include <dashpot/apps/cli/number_list.hpp>
#include <dashpot/apps/cli/output_file.hpp>
#include <dashpot/apps/cli/subcommands.hpp>
#include <dashpot/apps/cli/terminal.hpp>
#include <dashpot/apps/identify/identify.hpp>
#include <dashpot/apps/report/text_table.hpp>
#include <dashpot/apps/run/run_report.hpp>
#include <dashpot/apps/scene/scene.hpp>
#include <dashpot/controller/config.hpp>
#include <dashpot/controller/robot_model.hpp>
#include <dashpot/controller/rotors.hpp>
#include <dashpot/lcmtypes/bus.hpp>
#include <dashpot/lcmtypes/contact_t.hpp>
#include <dashpot/lcmtypes/sink.hpp>
#include <dashpot/lcmtypes/state_t.hpp>

#include <CLI/CLI.hpp>
#include <algorithm>
#include <array>
#include <chrono>
#include <cmath>
#include <cstdio>
#include <memory>
#include <optional>
#include <stdexcept>
#include <string>
#include <thread>
#include <utility>

namespace dashpot::apps {
namespace {

constexpr std::int64_t kFlushPeriod = 100'000;  // us
constexpr std::array kJointColumns = {"q", "qd", "torque"};

class CsvSink : public lcmtypes::Sink {
 public:
  CsvSink(const std::string& path, std::array<text::Units, 3> units)
      : file_("--csv", path), units_(std::move(units)) {}

  bool send(const std::string& channel, const std::vector<std::uint8_t>& bytes,
            std::int64_t utime) override {
    const int size = static_cast<int>(bytes.size());
    if (channel == lcmtypes::kContactChannel) {  // before the state of its tick
      return contact_.emplace().decode(bytes.data(), 0, size) >= 0;
    }
    if (channel != lcmtypes::kStateChannel) return true;
    state_t state;
    if (state.decode(bytes.data(), 0, size) < 0) return false;
    line_.clear();
    if (!any_) write_heading(state.n);
    if (!any_) begin_ = utime;
    any_ = true;
    write("%.6f", 1e-6 * static_cast<double>(utime - begin_));
    for (const auto* list : {&state.joint_position, &state.joint_velocity, &state.joint_torque}) {
      write(list->data(), list->size());
    }
    write(state.tip_position, 3);
    write(state.tip_error, 6);
    write(",%d", state.status);
    if (contact_) write(contact_->force, 3);
    line_ += '\n';
    return keeps([&] {
      file_.write(line_);
      if (utime - flushed_at_ < kFlushPeriod) return;
      flushed_at_ = utime;  // errors are noticed, and a killed run leaves its table
      file_.flush();
    });
  }

  bool finish() override {
    return keeps([this] { file_.finish(); });
  }

 private:
  void write_heading(int n) {
    line_ = "time [s]";
    for (std::size_t k = 0; k < units_.size(); ++k) {
      for (std::size_t i = 0; i < static_cast<std::size_t>(n); ++i) {
        line_.append(",").append(kJointColumns[k]).append(std::to_string(i + 1));
        line_.append(" [").append(units_[k][i]).append("]");
      }
    }
    line_ +=
        ",x [m],y [m],z [m],error_x [m],error_y [m],error_z [m],error_rx [rad],error_ry [rad],"
        "error_rz [rad],status";
    if (contact_) line_ += ",contact_x [N],contact_y [N],contact_z [N]";
    line_ += '\n';
  }

  void write(const char* format, auto value) {
    std::array<char, 40> text{};
    std::snprintf(text.data(), text.size(), format, value);
    line_ += text.data();
  }
  void write(const double* values, std::size_t count) {
    for (std::size_t i = 0; i < count; ++i) write(",%.17g", values[i]);
  }

  /// Whether `call` could write.
  static bool keeps(const auto& call) {
    try {
      call();
      return true;
    } catch (const std::runtime_error&) {
      return false;
    }
  }

  OutputFile file_;
  std::array<text::Units, 3> units_;
  std::optional<contact_t> contact_;  // of the next state
  std::string line_;
  bool any_ = false;
  std::int64_t begin_ = 0;       // us
  std::int64_t flushed_at_ = 0;  // us
};

/// Writes a row for each state message: time since the first one (s), then joint positions,
/// velocities and torques, tip position (m), tip error, the status of the tick, and the force of a
/// contact if contact messages come. The first line names the columns with their units; `model`
/// gives the units of the joints. Throws InputError that names the file and the reason.
std::unique_ptr<lcmtypes::Sink> make_csv_sink(const std::string& path,
                                              const controller::RobotModel& model) {
  return std::make_unique<CsvSink>(path, std::array{controller::joint_units(model, "rad", "m"),
                                                    controller::joint_units(model, "rad/s", "m/s"),
                                                    controller::joint_units(model, "N m", "N")});
}

using Clock = std::chrono::steady_clock;

struct Options {
  std::string scene, url, log, csv, plugin, excite;
  std::optional<double> duration;
  bool fast = false;
  bool real_time = false;  // the default, unless `fast`
  bool commands = false;
  bool ring_down = false;
  bool json = false;
};

constexpr std::chrono::milliseconds kLook{5};  // how often the loop's progress is looked at

double seconds_since(Clock::time_point start) {
  return std::chrono::duration<double>(Clock::now() - start).count();
}

/// Calls `open`; a failure is bad input.
template <class Open>
auto open_for(const std::string& option, const Open& open) {
  try {
    return open();
  } catch (const std::runtime_error& error) {
    throw InputError(option, error.what());
  }
}

/// The bus of a run: null in fast motion unless an option names it.
std::shared_ptr<lcm::LCM> open_bus(const Options& options) {
  if (!options.url.empty()) {
    return open_for("--lcm-url", [&] { return lcmtypes::open_bus(options.url); });
  }
  if (options.fast) return nullptr;
  if (options.commands) return open_for("--commands", [] { return lcmtypes::open_bus(""); });
  try {
    return lcmtypes::open_bus("");
  } catch (const std::runtime_error& error) {
    print_error(std::string("running without a bus: ") + error.what());
    return nullptr;
  }
}

std::vector<std::unique_ptr<lcmtypes::Sink>> make_sinks(const Options& options, const Scene& scene,
                                                        const std::shared_ptr<lcm::LCM>& bus) {
  std::vector<std::unique_ptr<lcmtypes::Sink>> sinks;
  if (bus) sinks.push_back(lcmtypes::make_bus_sink(bus));
  if (!options.log.empty()) {
    sinks.push_back(open_for("--log", [&] { return lcmtypes::make_log_sink(options.log); }));
  }
  if (!options.csv.empty()) {
    sinks.push_back(make_csv_sink(options.csv, scene.arm->config.model));
  }
  return sinks;
}

/// Throws unless the controller takes every set-point of the scenario.
void check_steps(const Scene& scene, const PluginLibrary& plugin) {
  const auto controller = plugin.create(scene.path, scene.dof());
  std::string reason;
  const JointVector& begin = scene.outside_limits ? scene.start : scene.rest;
  if (controller->start(begin, reason) != DASHPOT_OK) {
    throw InputError("scenario.start", "the controller refuses it: " + reason).in_file(scene.path);
  }
  for (const ScenarioStep& step : scene.steps) {
    if (controller->check(step.setpoint, begin, reason) == DASHPOT_OK) continue;
    throw InputError("scenario.steps", "the controller refuses this: " + reason, step.line)
        .in_file(scene.path);
  }
}

/// Runs the loop to its end, or until the user stops it.
RunReport run_loop(const Options& options, const Scene& scene, ClosedLoop& loop,
                   const std::shared_ptr<lcm::LCM>& bus) {
  RunReport report;
  report.pace = options.fast ? Pace::kFast : Pace::kRealTime;
  std::optional<CommandSource> commands;
  if (options.commands) {
    refuse_second_loop(bus);
    commands.emplace(bus, scene.commands, loop.goal());
  }
  lcmtypes::Publisher publisher(make_sinks(options, scene, bus));
  if (!options.fast) publisher.start();
  const double period = scene.plant.period;
  const std::int64_t ticks = std::max<std::int64_t>(1, std::llround(scene.duration / period));
  const Clock::time_point start = Clock::now();
  LoopThread thread(loop, publisher, commands ? &*commands : nullptr, {report.pace, period, ticks});
  thread.start();
  while (!thread.done()) {
    std::this_thread::sleep_for(kLook);
    if (!options.fast) loop.follow_gains();
    const auto done = static_cast<double>(thread.ticks());
    show_progress(std::min(0.999, done / static_cast<double>(ticks)),
                  format_number(done * period, 3) + " of " + format_number(scene.duration, 3) +
                      " s, " + std::to_string(thread.overruns()) + " overruns");
    if (StopSignal::given()) {
      thread.stop();
      report.interrupted = true;
    }
  }
  thread.join();
  clear_progress();
  report.wall_time = seconds_since(start);
  if (loop.refused_steps() > 0) {
    print_error("gains of " + std::to_string(loop.refused_steps()) +
                " steps of the scenario were refused, the last: " + loop.refusal());
  }
  publisher.stop();  // the counters below are final
  report.privileges = thread.privileges();
  report.loop = thread.record();
  report.messages = publisher.counters();
  if (commands) report.commands = {commands->tally(), commands->last_reason()};
  return report;
}

/// Throws if an output would overwrite an input or another output.
void check_files(const Options& options, const Scene& scene) {
  const std::vector<NamedFile> inputs = {{"the scene", options.scene},
                                         {"--plugin", options.plugin},
                                         {"the robot description", scene.arm->config.robot.urdf}};
  const std::string url =
      options.url.empty() && !options.fast ? lcmtypes::default_url() : options.url;
  check_outputs(
      {{"--lcm-url", lcmtypes::path_of(url)}, {"--log", options.log}, {"--csv", options.csv}},
      inputs);
}

/// Notes drives and sensors of the scene that are slower than in the analysis of modes and margin.
void note_unknown(const sim::PlantOptions& plant, const controller::Analysis::Sampled& known) {
  std::string unknown;
  if (plant.delay > known.delay) unknown += " delay";
  if (plant.torque_cutoff > 0 && (known.cutoff == 0 || plant.torque_cutoff < known.cutoff)) {
    unknown += " cutoff";
  }
  if (plant.difference_velocity && !known.difference_velocity) unknown += " difference_velocity";
  if (unknown.empty()) return;
  print_error("note: the simulation has properties that analysis.sampled lacks:" + unknown +
              "; the sampled modes and the gain margin do not include them");
}

void run(const Options& options) {
  if (options.commands && options.fast) {
    throw InputError("--commands",
                     "is for real time: with --fast commands would come at no particular time");
  }
  Scene scene = load_scene(options.scene);
  check_files(options, scene);
  std::optional<Excitation> excitation;
  if (!options.excite.empty()) {
    excitation = read_excitation(options.excite, scene.arm->config.settings);
  }
  if (options.duration) scene.duration = *options.duration;
  warn_of(scene.arm->config);
  note_unknown(scene.plant, scene.arm->config.settings.analysis.sampled);
  const PluginLibrary plugin(options.plugin);
  const auto make_controller = [&] { return plugin.create(scene.path, scene.dof()); };
  check_steps(scene, plugin);

  const auto controller = make_controller();
  ClosedLoop loop(scene, *controller);
  if (excitation) loop.goal().excite(*excitation);
  const StopSignal stop;
  RunReport report = run_loop(options, scene, loop, open_bus(options));
  report.scene = options.scene;
  report.joints = scene.dof();
  const controller::RobotModel& model = scene.arm->config.model;
  report.missing_rotors = controller::missing_rotors_text(model);
  report.friction_text = controller::friction_text(model);
  report.drives = scene.arm->config.robot.options.drives;
  report.drives_text = controller::drives_text(model, report.drives);
  report.without_rotors = controller::arm_without_rotors(model);
  report.rotors_hint =
      controller::rotors_hint(model, "robot.reflected_inertia", "robot.drives:", "\n  ");
  report.period = scene.plant.period;
  report.simulated_time = loop.plant().time();
  report.release = predict_release(scene);
  report.energy = loop.plant().audit();
  report.extremes = loop.extremes();
  report.contact_force = loop.contact_force();
  if ((scene.ring_down || options.ring_down) && !report.interrupted) {
    report.ring_down = measure_ring_down(scene, make_controller, StopSignal::given);
    report.interrupted = !report.ring_down;
  }
  if (excitation && !options.log.empty()) {
    const LogExcitation told{excitation->chirp,
                             [asked = *excitation](double time) { return asked.wrench(time); }};
    report.identified = identify_log(options.log, options.scene, told);
  }
  print(options.json ? to_json(report) : to_table(report));
  if (report.messages.send_errors > 0 && !(options.log.empty() && options.csv.empty())) {
    throw std::runtime_error((options.log.empty() ? "" : "--log: " + options.log + ": ") +
                             (options.csv.empty() ? "" : "--csv: " + options.csv + ": ") +
                             "cannot write: " + std::to_string(report.messages.send_errors) +
                             " messages could not be written");
  }
  if (report.loop.simulation != sim::Status::kOk) {
    throw std::runtime_error(std::string("the simulation ended at ") +
                             std::to_string(report.simulated_time) +
                             " s: " + sim::to_text(report.loop.simulation) +
                             " (see simulation.integrator in the scene)");
  }
  refuse_latched_fault(report.loop);
}

}  // namespace

void add_run(CLI::App& program) {
  CLI::App* command =
      program.add_subcommand("run", "A robot and its controller in simulation, watched over LCM");
  const auto options = std::make_shared<Options>();
  command->add_option("scene", options->scene, "Scene file: sim/scenes has examples")
      ->required()
      ->option_text("FILE");
  command->add_option("--duration", options->duration, "Duration instead of the scene's, s")
      ->transform(quantity("s", 1e-6, 1e7, "a time from 1e-6 to 1e7 s"))
      ->option_text("S");
  CLI::Option* real_time =
      command->add_flag("--realtime", options->real_time, "At the robot's pace (default)");
  command
      ->add_flag("--fast", options->fast, "As fast as possible; without a bus unless one is named")
      ->excludes(real_time);
  command->add_flag("--commands", options->commands,
                    "Take commands from the bus; without it none are taken");
  command
      ->add_option("--lcm-url", options->url,
                   "Bus; by default LCM_DEFAULT_URL, or multicast within this machine")
      ->option_text("URL");
  command->add_option("--log", options->log, "LCM log to write")->option_text("FILE");
  command->add_option("--csv", options->csv, "Table of the states to write")->option_text("FILE");
  command->add_option("--excite", options->excite, kExciteHelp)->option_text("SPEC");
  command->add_option("--plugin", options->plugin, "Controller to load instead of Dashpot's own")
      ->option_text("FILE");
  command->add_flag("--ring-down", options->ring_down,
                    "Fit the modes of small releases, and show them beside those predicted");
  command->add_flag("--json", options->json, "End with one JSON object instead of tables");
  command->footer("Ctrl-C ends it with the summary of what was run.\n" +
                  std::string(kExitStatusHelp));
  command->callback([options] { run(*options); });
}

}  // namespace dashpot::apps
