#include <dashpot/apps/cli/arm_option.hpp>
#include <dashpot/apps/cli/number_list.hpp>
#include <dashpot/apps/cli/output_file.hpp>
#include <dashpot/apps/cli/subcommands.hpp>
#include <dashpot/apps/cli/terminal.hpp>
#include <dashpot/apps/drive/drive_session.hpp>
#include <dashpot/apps/identify/identify.hpp>
#include <dashpot/apps/loop/loop_thread.hpp>
#include <dashpot/apps/scene/scene.hpp>
#include <dashpot/lcmtypes/bus.hpp>
#include <dashpot/lcmtypes/publisher.hpp>
#include <dashpot/lcmtypes/sink.hpp>
#include <dashpot/text/printable.hpp>

#include <CLI/CLI.hpp>
#include <cerrno>
#include <chrono>
#include <cmath>
#include <csignal>
#include <cstdio>
#include <exception>
#include <lcm/lcm-cpp.hpp>
#include <memory>
#include <optional>
#include <utility>

namespace dashpot::apps {
namespace {

struct DriveOptions {
  std::string config, url, log, plugin, excite;
  std::optional<double> duration;
  bool iiwa = false;
  bool panda = false;
  bool dry_run = false;
  bool commands = false;
  bool scenario = false;
  bool json = false;
};

std::int64_t utime_now() {
  const auto now = std::chrono::system_clock::now().time_since_epoch();
  return std::chrono::duration_cast<std::chrono::microseconds>(now).count();
}

/// Keeps the newest status of the driver, and passes its commands on to the session.
class Inbox {
 public:
  Inbox(lcm::LCM& bus, lcmtypes::DriverKind driver, DriveSession& session)
      : driver_(driver), session_(session) {
    const lcmtypes::DriverProfile& profile = lcmtypes::profile_of(driver);
    bus.subscribe(profile.status_channel, &Inbox::take_status, this);
    bus.subscribe(profile.command_channel, &Inbox::take_command, this);
  }

  std::optional<lcmtypes::DriverStatus> newest;
  std::int64_t arrived = 0;  ///< us since 1970-01-01 UTC

 private:
  void take_status(const lcm::ReceiveBuffer* buffer, const std::string&) {
    lcmtypes::DriverStatus status;
    if (!decode(driver_, buffer->data, buffer->data_size, status)) {
      ++session_.record.unreadable;
      return;
    }
    if (newest) {
      ++session_.record.overtaken;
      if (status.utime <= newest->utime) return;  // reordered: the one before is newer
    }
    newest = std::move(status);
    arrived = buffer->recv_utime;
  }
  void take_command(const lcm::ReceiveBuffer* buffer, const std::string&) {
    session_.hear_command(buffer->data, buffer->data_size);
  }

  lcmtypes::DriverKind driver_;
  DriveSession& session_;
};

/// Follows the goals of a scenario until a fault, or until the robot stops by itself.
class GoalFollower {
 public:
  /// Both must outlive it.
  GoalFollower(LoopGoal& goal, const LoopJournal& journal) : goal_(goal), journal_(journal) {}

  /// Reads the goals, without the place where the scenario starts. Throws InputError.
  void read(const std::string& path, std::optional<double>& duration) {
    const Scene scene = load_scene(path);
    if (!duration) duration = scene.duration;
    for (const ScenarioStep& step : scene.steps) {
      if (step.payload) throw InputError("--scenario", path + ": has a payload, for dashpot run");
    }
    steps_ = scene.steps;
    next_ = 1;
  }

  /// Throws InputError unless the arm stands where the scenario starts: no simulation has shown
  /// another way to the first goal.
  void check_start(const JointVector& q) const {
    constexpr double kNear = 0.1;  // rad (m)
    if (steps_.empty() || q.size() != steps_[0].setpoint.joint_position.size()) return;
    for (Eigen::Index j = 0; j < q.size(); ++j) {
      const double start = steps_[0].setpoint.joint_position[j];
      if (!(std::abs(q[j] - start) > kNear)) continue;
      throw InputError("scenario.start.position",
                       "joint " + std::to_string(j + 1) + " starts at " + text::number(start, 4) +
                           " rad (m), the arm is at " + text::number(q[j], 4) +
                           ": move it there first");
    }
  }
  /// Goes to the goal of `time`, s since the arm is held. The gains of steps do not count.
  void follow(double time, bool interrupted) noexcept {
    if (interrupted || journal_.record.faults > 0) next_ = steps_.size();
    for (; next_ < steps_.size() && time >= steps_[next_].at; ++next_) {
      goal_.hold(steps_[next_].setpoint);
    }
  }

 private:
  LoopGoal& goal_;
  const LoopJournal& journal_;
  std::vector<ScenarioStep> steps_;
  std::size_t next_ = 0;
};

/// Answers statuses until the user, the time or a refusal ends it. In the first two cases the arm
/// first stops and the torque fades. Returns why it ended.
std::string converse(const DriveOptions& options, lcm::LCM& bus, lcmtypes::DriverKind driver,
                     DriveSession& session, GoalFollower& goals) {
  constexpr int kWait = 50;       // ms
  constexpr double kSilence = 2;  // s without a status until a message is printed
  const lcmtypes::DriverProfile& profile = lcmtypes::profile_of(driver);
  Inbox inbox(bus, driver, session);
  lcmtypes::DriverCommand command;
  std::vector<std::uint8_t> bytes;
  using Clock = std::chrono::steady_clock;  // the time of day may be set meanwhile
  const auto since = [](Clock::time_point then) {
    return std::chrono::duration<double>(Clock::now() - then).count();  // s
  };
  Clock::time_point heard = Clock::now(), began, asked;
  std::int64_t stopped = 0;  // statuses of a robot that stopped by itself, before the start
  std::string why;           // it ends
  bool told = false;
  while (!session.ended()) {
    if (why.empty() && StopSignal::given()) why = "ended by the user";
    if (why.empty() && session.running() && options.duration && since(began) >= *options.duration) {
      why = "ended after its time";
    }
    if (!why.empty()) {
      if (!session.running() || options.dry_run) return why;
      if (asked == Clock::time_point()) asked = Clock::now();
      if (since(asked) > session.end_time() + 1) return why + ", without the driver";
      session.end();
    }
    const int handled = bus.handleTimeout(kWait);
    // A signal may interrupt it before the program has noticed the signal.
    if (handled < 0 && errno != EINTR && !StopSignal::given())
      throw std::runtime_error("the LCM bus failed");
    if (handled <= 0) {
      if (!told && since(heard) > kSilence) {
        print_error(std::string("no status on ") + profile.status_channel + " for 2 s");
        told = true;
      }
      continue;
    }
    while (bus.handleTimeout(0) > 0) {
    }
    if (session.rivalled()) {
      throw std::runtime_error(std::string("somebody else commands on ") + profile.command_channel +
                               ": nothing more is sent");
    }
    if (!inbox.newest) continue;
    const std::int64_t now = utime_now();
    heard = Clock::now();
    told = false;
    const bool ran = session.running();
    const lcmtypes::DriverStatus status = std::move(*inbox.newest);
    inbox.newest.reset();
    if (session.running()) {
      goals.follow(since(began), session.record.stopped > stopped);
    } else {
      stopped = session.record.stopped;
    }
    const bool answers = session.take(status, inbox.arrived, now, command);
    if (!ran && session.running()) {
      goals.check_start(status.position);  // nothing was sent yet
      began = Clock::now();
      std::fprintf(
          stderr, "%s\n",
          options.dry_run ? "watching; nothing is commanded" : "the arm is held where it is");
    }
    // The program may have been kept waiting since.
    if (answers && (session.may_send(utime_now()) || !session.engaged().empty())) {
      encode(driver, command, bytes);
      const int failed =
          bus.publish(profile.command_channel, bytes.data(), static_cast<unsigned>(bytes.size()));
      if (failed != 0) throw std::runtime_error("a command could not be sent");
      session.note_sent(bytes, 1e-6 * static_cast<double>(utime_now() - inbox.arrived));
    }
    if (!session.engaged().empty()) throw std::runtime_error(session.engaged());
    const std::string warning = session.warning();
    if (!warning.empty()) print_error(warning);
  }
  return why;
}

std::vector<std::unique_ptr<lcmtypes::Sink>> drive_sinks(const DriveOptions& options,
                                                         const std::shared_ptr<lcm::LCM>& bus) {
  std::vector<std::unique_ptr<lcmtypes::Sink>> sinks;
  sinks.push_back(lcmtypes::make_bus_sink(bus));
  try {
    if (!options.log.empty()) sinks.push_back(lcmtypes::make_log_sink(options.log));
  } catch (const std::runtime_error& error) {
    throw InputError("--log", error.what());
  }
  return sinks;
}

std::shared_ptr<lcm::LCM> drive_bus(const DriveOptions& options) try {
  return lcmtypes::open_bus(options.url);
} catch (const std::runtime_error& error) {
  throw InputError("--lcm-url", error.what());
}

void drive(DriveOptions options) {
  if (options.iiwa == options.panda) throw InputError("--iiwa, --panda", "one of them is wanted");
  const auto driver = options.iiwa ? lcmtypes::DriverKind::kIiwa : lcmtypes::DriverKind::kPanda;
  const CommandedConfig file = load_commanded_config(options.config);
  check_outputs({{"--log", options.log}}, {{"the configuration", options.config},
                                           {"--plugin", options.plugin},
                                           {"the robot description", file.config.robot.urdf}});
  std::optional<Excitation> excitation;
  if (!options.excite.empty()) {
    excitation = read_excitation(options.excite, file.config.settings);
  }
  warn_of(file.config);
  const PluginLibrary plugin(options.plugin);
  const auto controller = plugin.create(options.config, file.config.model.dof());
  constexpr double kRepeat = 0.1;  // s between two repetitions of a set-point
  LoopGoal goal(*controller,
                std::max<std::int64_t>(1, std::llround(kRepeat / file.config.settings.period)));
  if (excitation) goal.excite(*excitation);
  const std::shared_ptr<lcm::LCM> bus = drive_bus(options);
  std::optional<CommandSource> commands;
  if (options.commands) {
    refuse_second_loop(bus);
    commands.emplace(drive_bus(options), file.commands, goal);
  }
  lcmtypes::Publisher publisher(drive_sinks(options, bus));
  LoopJournal journal(*controller, goal, publisher, commands ? &*commands : nullptr,
                      LoopJournal::Pace::kRealTime);
  DriveReport report;
  GoalFollower goals(goal, journal);
  if (options.scenario) goals.read(options.config, options.duration);
  DriveSession session(file.config, *controller, goal, journal, {driver, options.dry_run});
  const StopSignal stop;
  std::signal(SIGPIPE, SIG_IGN);  // a reader that closes its pipe must not end the loop
  lock_memory();
  publisher.start();
  schedule_ahead_of_others();
  std::exception_ptr failure;
  try {
    report.ended = converse(options, *bus, driver, session, goals);
  } catch (const InputError& error) {
    if (!session.running()) throw;
    report.ended = error.what();
    failure = std::current_exception();
  } catch (const std::exception& error) {
    report.ended = error.what();
    failure = std::current_exception();
  }
  publisher.stop();
  report.config = options.config;
  report.driver = driver;
  report.dry_run = options.dry_run;
  report.running = session.running();
  report.drive = session.record;
  report.loop = journal.record;
  report.messages = publisher.counters();
  if (commands) report.commands = {commands->tally(), commands->last_reason()};
  if (excitation && !options.log.empty() && report.loop.ticks > 0) {
    const LogExcitation told{excitation->chirp,
                             [asked = *excitation](double time) { return asked.wrench(time); }};
    report.identified = identify_log(options.log, options.config, told);
  }
  print(options.json ? to_json(report) : to_table(report));
  if (failure) std::rethrow_exception(failure);
  if (report.messages.send_errors > 0 && !options.log.empty()) {
    throw std::runtime_error("--log: " + options.log + ": " +
                             std::to_string(report.messages.send_errors) +
                             " messages could not be sent or written");
  }
  refuse_latched_fault(report.loop);
}

}  // namespace

void add_drive(CLI::App& program) {
  CLI::App* command =
      program.add_subcommand("drive", "Drives a real arm through its public LCM driver");
  const auto options = std::make_shared<DriveOptions>();
  command
      ->add_option("config", options->config,
                   "Configuration file of the controller: controller/examples has some")
      ->required()
      ->option_text("FILE");
  CLI::Option* iiwa = command->add_flag("--iiwa", options->iiwa, "By drake-iiwa-driver");
  command->add_flag("--panda", options->panda, "By drake-franka-driver")->excludes(iiwa);
  command->add_flag("--dry-run", options->dry_run,
                    "Computes and publishes everything, and commands nothing");
  CLI::Option* commands = command->add_flag(
      "--commands", options->commands, "Take commands from the bus; without it none are taken");
  command
      ->add_flag("--scenario", options->scenario,
                 "Goes to the goals of scenario.steps, as dashpot run does, without their gains")
      ->excludes(commands);
  command->add_option("--duration", options->duration, "Ends after this time, s")
      ->transform(quantity("s", 1e-3, 1e7, "a time from 1e-3 to 1e7 s"))
      ->option_text("S");
  command
      ->add_option("--lcm-url", options->url,
                   "Bus; by default LCM_DEFAULT_URL, or multicast within this machine")
      ->option_text("URL");
  command->add_option("--log", options->log, "LCM log to write")->option_text("FILE");
  command->add_option("--excite", options->excite, kExciteHelp)->option_text("SPEC");
  command->add_option("--plugin", options->plugin, "Controller to load instead of Dashpot's own")
      ->option_text("FILE");
  command->add_flag("--json", options->json, "End with one JSON object instead of a table");
  command->footer(
      "Read docs/drive.md first; begin with --dry-run. Ctrl-C ends it: the arm stops, the torque "
      "fades,\nand the driver then does what it does without commands.\n" +
      std::string(kExitStatusHelp));
  command->callback([options] { drive(*options); });
}

}  // namespace dashpot::apps
