#include <dashpot/apps/cli/number_list.hpp>
#include <dashpot/apps/cli/subcommands.hpp>
#include <dashpot/apps/cli/terminal.hpp>
#include <dashpot/apps/monitor/monitor_view.hpp>
#include <dashpot/apps/monitor/plotjuggler.hpp>
#include <dashpot/apps/monitor/web_monitor.hpp>
#include <dashpot/lcmtypes/message_reader.hpp>
#include <dashpot/text/printable.hpp>

#include <CLI/CLI.hpp>
#include <chrono>
#include <cstdio>
#include <cstdlib>
#include <filesystem>
#include <memory>
#include <optional>
#include <string>
#include <system_error>
#include <thread>

namespace dashpot::apps {
namespace {

using Clock = std::chrono::steady_clock;

struct Options {
  std::string url;
  std::string log;
  std::optional<double> speed;
  std::optional<int> web;
  std::string config;
  std::string identified;
  std::optional<int> plotjuggler;
};

constexpr std::chrono::milliseconds kRedraw{100};
constexpr double kLinePeriod = 1;  // s

/// Shows the view: in place on a terminal, and otherwise as a line for each second of its time.
class Display {
 public:
  explicit Display(const std::string& source) : source_(text::printable(source)) {
    if (on_terminal()) screen_.emplace();
  }

  void update(const MonitorView& view) {
    if (screen_) {
      if (Clock::now() - drawn_at_ < kRedraw) return;
      drawn_at_ = Clock::now();
      const bool bold = std::getenv("NO_COLOR") == nullptr;
      screen_->draw("dashpot monitor, " + source_ + " (Ctrl-C ends)\n\n" +
                    (view.empty() ? "waiting for messages" : view.screen(bold)));
    } else if (!view.empty() &&
               !(view.time() >= line_at_ - kLinePeriod && view.time() < line_at_)) {
      print(view.line());
      line_at_ = view.time() + kLinePeriod;
    }
  }

 private:
  std::string source_;
  std::optional<FullScreen> screen_;
  Clock::time_point drawn_at_{};
  double line_at_ = 0;  // s, of the view's time
};

/// Calls `open`; a failure is bad input.
template <class Open>
auto open_input(const std::string& option, const Open& open) {
  try {
    return open();
  } catch (const std::runtime_error& error) {
    throw CLI::ValidationError(option, error.what());
  }
}

/// Throws if a file in which no message was found cannot be a log that has just begun.
void check_log(const std::string& path) {
  std::error_code unknown;
  if (std::filesystem::file_size(path, unknown) == 0 && !unknown) return;
  throw CLI::ValidationError("--log", path + ": is not an LCM log");
}

/// Returns the fault of the log, "" if it has none.
std::string watch_log(const Options& options, MonitorView& view,
                      lcmtypes::MessageHandlers& handlers) {
  const auto reader = open_input(
      "--log", [&] { return std::make_unique<lcmtypes::LogReader>(options.log, handlers); });
  Display display(options.log);
  const double speed = options.speed.value_or(on_terminal() ? 1 : 0);
  const Clock::time_point start = Clock::now();
  std::optional<double> first;  // us
  while (!StopSignal::given() && reader->read()) {
    const auto utime = static_cast<double>(reader->utime());
    if (!first) first = utime;
    if (speed > 0) {
      const double due = 1e-6 * (utime - *first) / speed;
      const auto due_at = start + std::chrono::duration<double>(due);
      while (!StopSignal::given() && Clock::now() < due_at) {
        display.update(view);
        const auto rest = due_at - Clock::now();
        std::this_thread::sleep_for(std::min<std::chrono::duration<double>>(rest, kRedraw));
      }
    }
    reader->handle();
    display.update(view);
  }
  if (!first && !StopSignal::given()) check_log(options.log);
  if (!reader->foreign().empty()) {
    throw CLI::ValidationError("--log", options.log + ": " + reader->foreign());
  }
  return reader->damage();
}

void watch_bus(const Options& options, MonitorView& view, lcmtypes::MessageHandlers& handlers) {
  const std::string url = options.url.empty() ? lcmtypes::default_url() : options.url;
  const auto reader = open_input("--lcm-url", [&] {
    return std::make_unique<lcmtypes::BusReader>(lcmtypes::open_bus(url), handlers);
  });
  if (!on_terminal()) print_error("waiting for messages on " + url);
  Display display(url);
  while (!StopSignal::given() && reader->wait(static_cast<int>(kRedraw.count()))) {
    display.update(view);
  }
}

void run(const Options& options) {
  const StopSignal stop;
  if (options.web) {
    serve_monitor({*options.web, options.url, options.log, options.config, options.identified});
    return;
  }
  MonitorView view;
  lcmtypes::MessageHandlers handlers;
  std::optional<PlotJuggler> other;
  if (options.plotjuggler) other.emplace(*options.plotjuggler);
  const auto take = [&](const char* channel, const auto& message) {
    view.take(message);
    if (other) other->send(channel, message);
  };
  handlers.on_state = [&](const state_t& message) { take("DASHPOT_STATE", message); };
  handlers.on_modes = [&](const modes_t& message) { take("DASHPOT_MODES", message); };
  handlers.on_sampled_modes = [&](const sampled_modes_t& message) {
    take("DASHPOT_SAMPLED_MODES", message);
  };
  std::string damage;
  if (!options.log.empty()) {
    damage = watch_log(options, view, handlers);
  } else {
    watch_bus(options, view, handlers);
  }
  print(view.summary(handlers.malformed) +
        (damage.empty() ? "" : "\nThe log is " + damage + ".\n"));
}

}  // namespace

void add_monitor(CLI::App& program) {
  CLI::App* command = program.add_subcommand(
      "monitor", "The modes and the health of a control loop, from LCM or from a log");
  const auto options = std::make_shared<Options>();
  CLI::Option* url =
      command
          ->add_option("--lcm-url", options->url,
                       "Bus to listen to; by default LCM_DEFAULT_URL, or multicast within "
                       "this machine")
          ->option_text("URL");
  command->add_option("--log", options->log, "LCM log to read instead of a bus")
      ->check([](const std::string& path) { return path.empty() ? "names no file" : ""; })
      ->excludes(url)
      ->option_text("FILE");
  command
      ->add_option("--speed", options->speed,
                   "Pace of a log relative to its recording; 0 is as fast as possible")
      ->transform(quantity("", 0, 1e6, "a factor from 0 to 1e6"))
      ->option_text("X (1 on a terminal, otherwise 0)");
  CLI::Option* plotjuggler =
      command
          ->add_option("--plotjuggler", options->plotjuggler,
                       "Also send each message as JSON over UDP to this port of 127.0.0.1")
          ->expected(0, 1)
          ->default_str(std::to_string(PlotJuggler::kPort))
          ->check(CLI::Range(1, 65535))
          ->option_text("[PORT] (" + std::to_string(PlotJuggler::kPort) + ")");
  CLI::Option* web =
      command
          ->add_option("--web", options->web,
                       "Serve a page at http://127.0.0.1:PORT/ instead; 0 is any free port")
          ->expected(0, 1)
          ->default_str(std::to_string(kWebPort))
          ->check(CLI::Range(0, 65535))
          ->excludes(plotjuggler)
          ->option_text("[PORT] (" + std::to_string(kWebPort) + ")");
  command->add_option("--config", options->config, "Configuration of the arm that the page draws")
      ->needs(web)
      ->option_text("FILE");
  command
      ->add_option("--identified", options->identified,
                   "Measured modes to lay over: JSON of `dashpot identify --json`")
      ->needs(web)
      ->option_text("FILE");
  command->footer(
      "Updated in place on a terminal; otherwise one line for each second. Ctrl-C, or the end of\n"
      "the log, ends it with a summary.\n" +
      std::string(kExitStatusHelp));
  command->callback([options] { run(*options); });
}

}  // namespace dashpot::apps
