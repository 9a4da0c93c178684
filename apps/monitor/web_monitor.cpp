#include <dashpot/apps/cli/subcommands.hpp>
#include <dashpot/apps/cli/terminal.hpp>
#include <dashpot/apps/monitor/web_monitor.hpp>
#include <dashpot/apps/report/json.hpp>
#include <dashpot/apps/web/web_site.hpp>
#include <dashpot/lcmtypes/bus.hpp>

#include <atomic>
#include <exception>
#include <fstream>
#include <thread>

namespace dashpot::apps {
namespace {

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

}  // namespace

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

}  // namespace dashpot::apps
