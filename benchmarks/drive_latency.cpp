// How long a driver waits for the command to its status: from `dashpot drive`, and in the same run
// from a peer that only copies the position into a command.
//     drive_latency PROGRAM CONFIG [SECONDS]

#include <dashpot/lcmtypes/bus.hpp>
#include <dashpot/lcmtypes/driver.hpp>

#include <poll.h>
#include <sched.h>
#include <sys/prctl.h>
#include <sys/wait.h>
#include <unistd.h>

#include <algorithm>
#include <chrono>
#include <cmath>
#include <csignal>
#include <cstdio>
#include <cstdlib>
#include <deque>
#include <exception>
#include <lcm/lcm-cpp.hpp>
#include <string>
#include <utility>
#include <vector>

namespace {

using dashpot::lcmtypes::DriverCommand;
using dashpot::lcmtypes::DriverKind;
using dashpot::lcmtypes::DriverStatus;
using dashpot::lcmtypes::open_bus;
using dashpot::lcmtypes::profile_of;
using Clock = std::chrono::steady_clock;
using Bytes = std::vector<std::uint8_t>;

constexpr DriverKind kKind = DriverKind::kIiwa;
constexpr auto kHalfPeriod = std::chrono::microseconds(500);

void publish(lcm::LCM& bus, const char* channel, const Bytes& bytes) {
  bus.publish(channel, bytes.data(), static_cast<unsigned>(bytes.size()));
}

/// As in `dashpot drive`, if that is allowed.
void schedule_ahead() {
  sched_param parameter{};
  parameter.sched_priority = 80;
  sched_setscheduler(0, SCHED_FIFO, &parameter);
}

struct Echo {
  lcm::LCM& bus;
  DriverStatus status;
  DriverCommand answer;
  Bytes bytes;
  void take(const lcm::ReceiveBuffer* buffer, const std::string&) {
    if (!decode(kKind, buffer->data, buffer->data_size, status)) return;
    answer.utime = status.utime;
    answer.position = status.position;
    encode(kKind, answer, bytes);
    publish(bus, "ECHO_COMMAND", bytes);
  }
};

[[noreturn]] void echo(const std::string& url) {
  prctl(PR_SET_PDEATHSIG, SIGKILL);
  const auto bus = open_bus(url);
  Echo echo{*bus, {}, {}, {}};
  echo.answer.torque.setZero(7);
  bus->subscribe("ECHO_STATUS", &Echo::take, &echo);
  schedule_ahead();
  while (bus->handle() == 0) {
  }
  _exit(1);
}

[[noreturn]] void drive(const std::string& url, const char* program, const char* config) {
  prctl(PR_SET_PDEATHSIG, SIGKILL);
  if (std::freopen("/dev/null", "w", stdout) == nullptr) _exit(1);
  execlp(program, program, "drive", config, "--iiwa", "--lcm-url", url.c_str(), nullptr);
  _exit(127);
}

/// Sends statuses on one channel and hears the answers on another, which have the position of their
/// status.
class Peer {
 public:
  Peer(lcm::LCM& bus, std::string channel, const std::string& answers)
      : bus_(bus), channel_(std::move(channel)) {
    bus.subscribe(answers, &Peer::take, this);
  }
  void ask(const DriverStatus& status) {
    encode(kKind, status, bytes_);
    waiting_.push_back({status.position[0], Clock::now()});
    publish(bus_, channel_.c_str(), bytes_);
    ++asked_;
  }
  bool answered() const { return !waits_.empty(); }
  void forget() {
    waits_.clear();
    waiting_.clear();
    asked_ = 0;
  }
  void print(const char* name) {
    if (waits_.empty()) return;
    std::sort(waits_.begin(), waits_.end());
    const auto at = [&](double share) {
      return waits_[static_cast<std::size_t>(share * static_cast<double>(waits_.size() - 1))];
    };
    std::printf("%-14s %8.0f %8.0f %8.0f %10d\n", name, at(0.5), at(0.999), waits_.back(),
                asked_ - static_cast<int>(waits_.size()));
  }

 private:
  struct Asked {
    double position;
    Clock::time_point begin;
  };
  void take(const lcm::ReceiveBuffer* buffer, const std::string&) {
    const auto end = Clock::now();
    DriverCommand command;
    if (!decode(kKind, buffer->data, buffer->data_size, command)) return;
    const auto found = std::find_if(waiting_.begin(), waiting_.end(), [&](const Asked& asked) {
      return asked.position == command.position[0];
    });
    if (found == waiting_.end()) return;
    waits_.push_back(std::chrono::duration<double, std::micro>(end - found->begin).count());
    waiting_.erase(waiting_.begin(), found + 1);
  }

  lcm::LCM& bus_;
  std::string channel_;
  Bytes bytes_;
  std::deque<Asked> waiting_;
  int asked_ = 0;
  std::vector<double> waits_;  // us
};

/// Hears answers until `end`.
void hear(lcm::LCM& bus, Clock::time_point end) {
  for (auto left = end - Clock::now(); left.count() > 0; left = end - Clock::now()) {
    pollfd readable{bus.getFileno(), POLLIN, 0};
    const timespec timeout{0, std::chrono::nanoseconds(left).count()};
    if (ppoll(&readable, 1, &timeout, nullptr) > 0) bus.handle();
  }
}

/// An arm that is moved to and fro, so that its modes change in every period.
DriverStatus status_at(int k) {
  constexpr double kPeriod = 1e-3, kAmplitude = 0.02, kRate = 6;  // s, rad, rad/s
  DriverStatus status;
  status.utime = 1'000'000 + 1000 * static_cast<std::int64_t>(k);
  status.position.setZero(7);
  status.position << 0, 0.5, 0, -1.4, 0, 1, 0;
  status.position.array() += kAmplitude * std::sin(kRate * kPeriod * k);
  status.velocity.setConstant(7, kAmplitude * kRate * std::cos(kRate * kPeriod * k));
  return status;
}

int run(const char* program, const char* config, double seconds) {
  const std::string url =
      "udpm://239.255.76.67:" + std::to_string(20000 + getpid() % 20000) + "?ttl=0";
  const pid_t echoing = fork();
  if (echoing == 0) echo(url);
  const pid_t driving = fork();
  if (driving == 0) drive(url, program, config);

  const auto bus = open_bus(url);
  Peer arm(*bus, profile_of(kKind).status_channel, profile_of(kKind).command_channel);
  Peer bare(*bus, "ECHO_STATUS", "ECHO_COMMAND");
  schedule_ahead();
  constexpr int kPatience = 10'000;  // periods until the first command
  const int wanted = static_cast<int>(1000 * seconds);
  int began = 0;
  auto next = Clock::now();
  int k = 0;
  for (; began == 0 ? k < kPatience : k < began + wanted; ++k) {
    const DriverStatus status = status_at(k);
    arm.ask(status);
    hear(*bus, next + kHalfPeriod);
    bare.ask(status);
    hear(*bus, next + 2 * kHalfPeriod);
    if (began == 0 && arm.answered()) {
      began = k;
      arm.forget();
      bare.forget();
    }
    next += 2 * kHalfPeriod;
  }
  kill(driving, SIGTERM);
  kill(echoing, SIGKILL);
  int ended = 0;
  waitpid(driving, &ended, 0);
  waitpid(echoing, nullptr, 0);
  if (began == 0 || !WIFEXITED(ended) || WEXITSTATUS(ended) != 0) {
    std::fprintf(stderr, "drive_latency: dashpot drive did not answer, or failed\n");
    return 1;
  }
  std::printf("%d statuses at 1 kHz; from a status to its answer, us\n", wanted);
  std::printf("%-14s %8s %8s %8s %10s\n", "", "median", "99.9 %", "longest", "unanswered");
  arm.print("dashpot drive");
  bare.print("bare echo");
  return 0;
}

}  // namespace

int main(int argc, char** argv) try {
  const double seconds = argc == 4 ? std::atof(argv[3]) : 30;
  if (argc < 3 || argc > 4 || !(seconds >= 1 && seconds <= 3600)) {
    std::fprintf(stderr, "usage: drive_latency PROGRAM CONFIG [SECONDS]\n");
    return 2;
  }
  return run(argv[1], argv[2], seconds);
} catch (const std::exception& error) {
  std::fprintf(stderr, "drive_latency: %s\n", error.what());
  return 1;
}
