#include <dashpot/lcmtypes/plugin_publisher.h>
#include <dashpot/lcmtypes/bus.hpp>
#include <dashpot/lcmtypes/plugin_samples.hpp>
#include <dashpot/lcmtypes/publisher.hpp>

#include <atomic>
#include <chrono>
#include <exception>
#include <memory>
#include <sstream>
#include <stdexcept>
#include <string>
#include <thread>
#include <utility>
#include <vector>

using namespace dashpot::lcmtypes;  // NOLINT(google-build-using-namespace): the functions are C

namespace {

std::string& last_error() {
  thread_local std::string text;
  return text;
}

std::int64_t utime_now() {
  const auto now = std::chrono::system_clock::now().time_since_epoch();
  return std::chrono::duration_cast<std::chrono::microseconds>(now).count();
}

std::vector<std::unique_ptr<Sink>> bus_sinks(const char* urls) {
  std::vector<std::unique_ptr<Sink>> sinks;
  std::istringstream lines(urls != nullptr ? urls : "");
  for (std::string url; std::getline(lines, url);) {
    sinks.push_back(make_bus_sink(open_bus(url)));
  }
  if (sinks.empty()) sinks.push_back(make_bus_sink(open_bus("")));
  return sinks;
}

}  // namespace

struct dashpot_publisher {
  dashpot_publisher(dashpot_controller* controller, const char* url)
      : controller_(controller), publisher_(bus_sinks(url)) {
    snapshot_.struct_size = sizeof snapshot_;
    modes_.struct_size = sizeof modes_;
    sampled_modes_.struct_size = sizeof sampled_modes_;
    thread_ = std::thread([this] { run(); });
  }
  ~dashpot_publisher() {
    stop_ = true;
    thread_.join();
  }
  dashpot_publisher(const dashpot_publisher&) = delete;
  dashpot_publisher& operator=(const dashpot_publisher&) = delete;

 private:
  void run() noexcept {
    constexpr auto kPeriod = std::chrono::microseconds(500);
    while (!stop_) {
      publish();
      std::this_thread::sleep_for(kPeriod);
    }
    publish();
  }

  void publish() noexcept {
    const std::uint64_t tick = snapshot_.tick, modes = modes_.tick, sampled = sampled_modes_.tick;
    const std::int64_t utime = utime_now();
    if (dashpot_read_snapshot(controller_, &snapshot_) == DASHPOT_OK && snapshot_.tick != tick) {
      state_.utime = utime;
      fill(snapshot_, state_.snapshot);
      const bool faulty = snapshot_.fault != DASHPOT_OK;
      if (!faulty || state_.health.fault_tick == 0) {
        state_.health.fault_tick = faulty ? static_cast<std::int64_t>(snapshot_.tick) : 0;
      }
      publisher_.offer(state_);
    }
    // Modes may belong to an earlier tick, or, before the first tick, to none.
    if (dashpot_read_modes(controller_, &modes_) == DASHPOT_OK && modes_.tick != modes &&
        modes_.time >= 0) {
      modes_sample_.utime = utime - (snapshot_.time - modes_.time) / 1000;
      fill(modes_, modes_sample_);
      publisher_.offer(modes_sample_);
    }
    if (dashpot_read_sampled_modes(controller_, &sampled_modes_) == DASHPOT_OK &&
        sampled_modes_.tick != sampled && sampled_modes_.time >= 0) {
      sampled_sample_.utime = utime - (snapshot_.time - sampled_modes_.time) / 1000;
      fill(sampled_modes_, sampled_sample_);
      publisher_.offer(sampled_sample_);
    }
    publisher_.publish_pending();
  }

  dashpot_controller* controller_;
  Publisher publisher_;
  dashpot_snapshot snapshot_{};
  dashpot_modes modes_{};
  dashpot_sampled_modes sampled_modes_{};
  StateSample state_;
  ModesSample modes_sample_;
  SampledModesSample sampled_sample_;
  std::atomic<bool> stop_{false};
  std::thread thread_;
};

dashpot_publisher* dashpot_publisher_create(dashpot_controller* controller, const char* url) try {
  last_error().clear();
  if (controller == nullptr) throw std::runtime_error("there is no controller");
  return std::make_unique<dashpot_publisher>(controller, url).release();
} catch (const std::exception& error) {
  last_error() = error.what();
  return nullptr;
}

void dashpot_publisher_destroy(dashpot_publisher* publisher) {
  const std::unique_ptr<dashpot_publisher> gone(publisher);
}

const char* dashpot_publisher_error(void) {
  return last_error().c_str();
}
