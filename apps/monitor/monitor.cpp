#include <dashpot/apps/cli/number_list.hpp>
#include <dashpot/apps/cli/subcommands.hpp>
#include <dashpot/apps/cli/terminal.hpp>
#include <dashpot/apps/monitor/monitor_view.hpp>
#include <dashpot/apps/report/json.hpp>
#include <dashpot/apps/web/web_site.hpp>
#include <dashpot/lcmtypes/bus.hpp>
#include <dashpot/lcmtypes/message_reader.hpp>
#include <dashpot/text/printable.hpp>

#include <arpa/inet.h>
#include <netinet/in.h>
#include <sys/socket.h>
#include <unistd.h>
#include <CLI/CLI.hpp>
#include <atomic>
#include <cerrno>
#include <chrono>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <exception>
#include <filesystem>
#include <fstream>
#include <memory>
#include <optional>
#include <stdexcept>
#include <string>
#include <system_error>
#include <thread>

namespace dashpot::apps {
namespace {

/// Sends messages as JSON over UDP to a program on this machine, one datagram each:
/// {"timestamp": s since 1970-01-01 UTC, "DASHPOT_STATE": {...}}. PlotJuggler's UDP server takes
/// them with the protocol "json" and the field "timestamp". The receiver may be absent.
class PlotJuggler {
 public:
  static constexpr int kPort = 9870;  ///< that PlotJuggler proposes

  /// Throws std::runtime_error.
  explicit PlotJuggler(int port) : socket_(::socket(AF_INET, SOCK_DGRAM | SOCK_CLOEXEC, 0)) {
    sockaddr_in address{};
    address.sin_family = AF_INET;
    address.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
    address.sin_port = htons(static_cast<std::uint16_t>(port));
    const void* any = &address;
    if (socket_ < 0 || connect(socket_, static_cast<const sockaddr*>(any), sizeof address) != 0) {
      const std::string reason = std::strerror(errno);
      if (socket_ >= 0) close(socket_);
      throw std::runtime_error("cannot send over UDP: " + reason);
    }
  }
  ~PlotJuggler() { close(socket_); }
  PlotJuggler(const PlotJuggler&) = delete;
  PlotJuggler& operator=(const PlotJuggler&) = delete;

  template <class Message>
  void send(const char* channel, const Message& message) {
    send(nlohmann::ordered_json{{"timestamp", 1e-6 * static_cast<double>(message.utime)},
                                {channel, message_json(message)}}
             .dump());
  }

 private:
  void send(const std::string& text) const {
    // A receiver that is slow or missing loses messages.
    (void)::send(socket_, text.data(), text.size(), MSG_DONTWAIT);
  }
  int socket_;
};

constexpr int kWebPort = 8024;

struct WebMonitorOptions {
  int port = kWebPort;     ///< 0: any that is free
  std::string url;         ///< of the bus; "": the default
  std::string log;         ///< to show instead; "": none
  std::string config;      ///< of the arm; "": none
  std::string identified;  ///< JSON of measured modes; "": none
};

/// Returns what `open` returns; a failure is bad input of the option.
template <class Open>
auto from_option(const std::string& option, const Open& open) {
  try {
    return open();
  } catch (const InputError&) {
    throw;
  } catch (const std::exception& error) {
    throw InputError(option, error.what(), 0);
  }
}

/// The modes of `dashpot identify --json`, or null.
Json measured_modes(const std::string& path) {
  if (path.empty()) return nullptr;
  std::ifstream file(path);
  if (!file) throw std::runtime_error(path + ": cannot be read");
  const auto document = Json::parse(file, nullptr, false);
  const auto wrong = [&path](const std::string& why) {
    return std::runtime_error(path + ": " + why);
  };
  if (!document.is_object() || !document.contains("modes") || !document["modes"].is_array()) {
    throw wrong("has no list \"modes\"");
  }
  auto modes = Json::array();
  for (const auto& mode : document["modes"]) {
    Json kept;
    for (const char* key : {"natural_frequency", "damping_ratio"}) {
      if (!mode.is_object() || !mode.contains(key) || !mode[key].is_number()) {
        throw wrong(std::string("a mode has no number \"") + key + "\"");
      }
      kept[key] = mode[key];
    }
    modes.push_back(kept);
  }
  return modes;
}

void serve(HttpServer& server) {
  print("http://127.0.0.1:" + std::to_string(server.port()) + "/ (Ctrl-C ends)\n");
  server.run(StopSignal::given);
}

/// Listens to the bus on this thread and serves on another, so that neither waits for the other.
void serve_bus(const std::string& url, WebSite& site, HttpServer& server) {
  lcmtypes::MessageHandlers handlers;
  handlers.on_state = [&site](const state_t& message) { site.take(message); };
  handlers.on_modes = [&site](const modes_t& message) { site.take(message); };
  handlers.on_sampled_modes = [&site](const sampled_modes_t& message) { site.take(message); };
  const auto reader = from_option("--lcm-url", [&] {
    return std::make_unique<lcmtypes::BusReader>(lcmtypes::open_bus(url), handlers);
  });
  std::exception_ptr failure;
  std::atomic<bool> done = false;
  std::thread thread([&] {
    try {
      serve(server);
    } catch (...) {
      failure = std::current_exception();
    }
    done = true;
  });
  while (!done && !StopSignal::given()) {
    if (!reader->wait(100)) std::this_thread::sleep_for(std::chrono::milliseconds(100));
  }
  thread.join();
  if (failure) std::rethrow_exception(failure);
}

/// Serves the page of a bus or a log until Ctrl-C. Throws InputError for bad input.
void serve_monitor(const WebMonitorOptions& options) {
  std::optional<ArmView> arm;
  if (!options.config.empty()) arm.emplace(options.config);
  auto identified = from_option("--identified", [&] { return measured_modes(options.identified); });
  std::unique_ptr<LogFrames> log;
  if (!options.log.empty()) {
    log = from_option("--log", [&] {
      auto frames = std::make_unique<LogFrames>(options.log, StopSignal::given);
      if (frames->empty()) throw std::runtime_error(options.log + ": has no messages");
      return frames;
    });
  }
  const std::string url = options.url.empty() ? lcmtypes::default_url() : options.url;
  WebSite site(options.log.empty() ? url : options.log, std::move(arm), std::move(log),
               std::move(identified));
  HttpContent content;
  content.answer = [&site](const auto& path, const auto& query) {
    return site.answer(path, query);
  };
  if (site.live()) content.next_event = [&site] { return site.next_event(); };
  const auto server = from_option(
      "--web", [&] { return std::make_unique<HttpServer>(options.port, std::move(content)); });
  if (site.live()) {
    serve_bus(url, site, *server);
  } else {
    serve(*server);
  }
}

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
