#pragma once
// A `dashpot` that runs beside the test, and what it says over its bus.

#include <dashpot/lcmtypes/bus.hpp>
#include <dashpot/lcmtypes/command_t.hpp>
#include <dashpot/lcmtypes/message_reader.hpp>
#include <dashpot/tests/apps/json_result.hpp>
#include <dashpot/tests/support/places.hpp>
#include <dashpot/tests/support/sanitized.hpp>

#include <algorithm>
#include <chrono>
#include <csignal>
#include <lcm/lcm-cpp.hpp>
#include <optional>
#include <string>
#include <vector>

namespace dashpot::tests {

using Clock = std::chrono::steady_clock;
using testing::kHang;

/// Waits for the end of a loop with --json, and returns what it says; its exit status is 1 only if
/// a fault is latched at the end.
inline nlohmann::json summary_of(Running& loop) {
  const int status = loop.finish();
  nlohmann::json result = nlohmann::json::parse(loop.output());
  EXPECT_EQ(status, result["fault"].is_null() ? 0 : 1) << loop.complaints();
  return result;
}

/// Collects the messages of a bus.
class Listener {
 public:
  explicit Listener(const std::string& url) : bus_(lcmtypes::open_bus(url)) {
    handlers_.on_state = [this](const state_t& message) {
      ++states;
      state = message;
    };
    handlers_.on_modes = [this](const modes_t& message) {
      ++modes_messages;
      modes = message;
    };
    handlers_.on_sampled_modes = [this](const sampled_modes_t& message) {
      ++sampled_messages;
      sampled = message;
    };
    reader_.emplace(bus_, handlers_);
  }

  /// Listens until `done()`; false if it is not before a hang is sure.
  template <class Done>
  bool until(const Done& done) {
    const auto end = Clock::now() + kHang;
    while (!done()) {
      if (Clock::now() > end) return false;
      reader_->wait(50);
    }
    return true;
  }
  /// The same, or until `program` ends; what it refuses, but to use the bus, fails the test.
  template <class Done>
  bool until(const Done& done, Running& program) {
    bool ended = false;
    until([&] { return done() || (ended = program.ended()); });
    const auto says = [&](const char* what) {
      return program.complaints().find(what) != std::string::npos;
    };
    // A driver without lock-step that was kept waiting sends what it has missed at once.
    if (ended && !says("--lcm-url") && !says("driver's statuses come every")) {
      EXPECT_NE(program.finish(), 2) << program.complaints();
    }
    return done();
  }
  lcm::LCM& bus() { return *bus_; }
  std::int64_t malformed() const { return handlers_.malformed; }

  std::int64_t states = 0, modes_messages = 0, sampled_messages = 0;
  state_t state{};
  modes_t modes{};
  sampled_modes_t sampled{};

 private:
  std::shared_ptr<lcm::LCM> bus_;
  lcmtypes::MessageHandlers handlers_;
  std::optional<lcmtypes::BusReader> reader_;
};

inline constexpr const char* kNoMulticast = "multicast does not work on this machine";
inline constexpr const char* kNoPace = "the machine did not keep the pace of the arm's driver";

/// A `dashpot run` beside the test, for a minute at most unless told otherwise, and what it says
/// over a bus of its own.
class LiveRun : public Listener {
 public:
  explicit LiveRun(const std::string& scene, std::vector<std::string> more = {"--commands"},
                   std::string bus_url = own_url())
      : Listener(bus_url), url(std::move(bus_url)), run([&] {
          more.insert(more.begin(), {"run", scene, "--json", "--lcm-url", url});
          if (std::find(more.begin(), more.end(), "--duration") == more.end()) {
            more.insert(more.end(), {"--duration", "60"});
          }
          return more;
        }()) {}

  /// Waits for states, and modes; false if none come, which is so without multicast.
  bool heard(int least_modes = 0) {
    return until([&] { return states > 100 && modes_messages >= least_modes; }, run);
  }
  /// Waits for so many ticks more.
  bool passed(std::int64_t ticks) {
    return until([this, end = state.tick + ticks] { return state.tick > end; });
  }
  void publish(const command_t& command) { bus().publish(lcmtypes::kCommandChannel, &command); }
  /// Ends the run; what it says at its end.
  Json end(int signal = SIGTERM) {
    run.send(signal);
    EXPECT_EQ(run.finish(), 0) << run.complaints();
    return Json::parse(run.output());
  }

  std::string url;
  Running run;
};

/// Now, us since 1970-01-01 UTC.
inline std::int64_t utime() {
  return std::chrono::duration_cast<std::chrono::microseconds>(
             std::chrono::system_clock::now().time_since_epoch())
      .count();
}

inline constexpr std::int64_t kMe = 42;  // a sender

/// A command for a Panda that moves joint 1 in joint mode.
inline command_t joint_command(const state_t& state, double first_joint, std::int64_t sequence) {
  command_t command{};
  command.n = state.n;
  command.sender = kMe;
  command.utime = utime();
  command.sequence = sequence;
  command.parts = int{command_t::MODE} + int{command_t::JOINT_POSITION};
  command.mode = command_t::JOINT;
  command.joint_position = state.reference_joint_position;
  command.joint_position[0] = first_joint;
  command.tip_quaternion[0] = 1;
  const auto n = static_cast<std::size_t>(state.n);
  command.joint_stiffness.assign(n, std::vector<double>(n));
  command.joint_damping = command.joint_stiffness;
  command.null_stiffness.assign(n, 0);
  command.null_damping.assign(n, 0);
  return command;
}

}  // namespace dashpot::tests
