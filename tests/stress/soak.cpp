// The loop of a host in real time, for as long as one likes, or so many times as fast. A simulated
// Panda follows goals at 1 kHz under the plugin. Meanwhile the host changes gains, asks for some
// that are refused, releases faults, and makes a second controller with a publisher and destroys
// it; states and modes go over LCM and are read again. A line each 10 minutes, or each quarter of a
// shorter run. The first of these is for warming up; what the last one needs more than the second
// is a failure, as is a status other than ok, a bound that is lost, a goal that is not reached.
// Durations are printed and not judged. SIGINT or SIGTERM ends it with the cycle of 4 s.
#include <dashpot/lcmtypes/plugin_publisher.h>
#include <dashpot/analysis/solver_status.hpp>
#include <dashpot/lcmtypes/bus.hpp>
#include <dashpot/lcmtypes/message_reader.hpp>
#include <dashpot/tests/stress/part.hpp>
#include <dashpot/tests/stress/soak_loop.hpp>
#include <dashpot/tests/support/places.hpp>

#include <unistd.h>

#include <algorithm>
#include <atomic>
#include <chrono>
#include <cmath>
#include <csignal>
#include <cstdio>
#include <filesystem>
#include <fstream>
#include <memory>
#include <stdexcept>
#include <string>
#include <thread>

namespace {

using namespace dashpot::stress;  // NOLINT(google-build-using-namespace)
using dashpot::modes_t;
using dashpot::state_t;
using std::chrono::milliseconds;

// Limits of the growth of an interval over the second one, and of the arm's distance from its goal.
constexpr std::int64_t kMoreMemory = 4 << 20;  // bytes
constexpr double kMoreError = 5e-4;            // m
constexpr auto kUnfinished = static_cast<int>(dashpot::analysis::Status::kUnfinished);
constexpr double kLargestError = 5e-3;  // m

std::atomic<bool> interrupted{false};

struct Destroy {
  void operator()(dashpot_controller* controller) const { dashpot_destroy(controller); }
  void operator()(dashpot_publisher* publisher) const { dashpot_publisher_destroy(publisher); }
};

/// A controller at rest at its home, with its publisher.
struct Hosted {
  explicit Hosted(const std::string& url)
      : controller(
            dashpot_create_from_text(kSoakConfig, (DASHPOT_SOURCE_DIR "/sim/models").c_str())) {
    if (!controller || dashpot_start(controller.get(), SoakLoop::home().data(), nullptr) != 0) {
      throw std::runtime_error(dashpot_last_error());
    }
    publisher.reset(dashpot_publisher_create(controller.get(), url.c_str()));
    if (!publisher) throw std::runtime_error(dashpot_publisher_error());
  }
  std::unique_ptr<dashpot_controller, Destroy> controller;
  std::unique_ptr<dashpot_publisher, Destroy> publisher;
};

/// Reads what is published, on a thread of its own.
class Listener {
 public:
  explicit Listener(const std::string& url) : reader_(dashpot::lcmtypes::open_bus(url), handlers_) {
    handlers_.on_state = [this](const state_t&) { ++states; };
    handlers_.on_modes = [this](const modes_t& message) {
      if (message.status == kUnfinished) return;  // another thread goes on with it
      ++modes;
      const bool bounded =
          message.status == 0 &&
          std::all_of(message.eigenvalue_bound.begin(), message.eigenvalue_bound.end(),
                      [](double bound) { return std::isfinite(bound); });
      if (!bounded) ++unbounded;
    };
    thread_ = std::thread([this] {
      while (!stop_ && reader_.wait(100)) {
      }
    });
  }
  ~Listener() {
    stop_ = true;
    thread_.join();
  }
  Listener(const Listener&) = delete;
  Listener& operator=(const Listener&) = delete;

  std::atomic<std::int64_t> states{0}, modes{0};
  std::atomic<std::int64_t> unbounded{0};  ///< modes without a proved bound

 private:
  dashpot::lcmtypes::MessageHandlers handlers_;
  dashpot::lcmtypes::BusReader reader_;
  std::atomic<bool> stop_{false};
  std::thread thread_;
};

/// Resources of the process.
struct Footprint {
  std::int64_t memory = 0;  ///< resident, bytes
  std::int64_t descriptors = 0;
  std::int64_t threads = 0;
};

std::int64_t entries(const char* directory) {
  const std::filesystem::directory_iterator begin(directory);
  return std::distance(begin, std::filesystem::directory_iterator());
}

Footprint footprint() {
  std::int64_t size = 0, resident = 0;
  std::ifstream("/proc/self/statm") >> size >> resident;
  return {resident * sysconf(_SC_PAGESIZE), entries("/proc/self/fd") - 1,  // the one that counts
          entries("/proc/self/task")};
}

/// The work of the thread beside the loop in each second of a cycle. Throws std::runtime_error if
/// the controller answers otherwise than it should.
class Operator {
 public:
  Operator(dashpot_controller* controller, std::string url)
      : controller_(controller), url_(std::move(url)) {}

  void work(std::int64_t second) {
    switch (second % 4) {
      case 0:
        set_gains(400, 0, 0.7, DASHPOT_OK);
        break;
      case 1:
        set_gains(600, 60, 0, DASHPOT_OK);
        break;
      case 2:
        set_gains(1e7, 0, 0, DASHPOT_UNSTABLE_GAINS);
        break;
      default:
        make_another();
    }
  }

 private:
  static void expect(std::int32_t code, std::int32_t expected, const char* what) {
    if (code == expected) return;
    throw std::runtime_error(std::string(what) + " returned " + std::to_string(code) + ": " +
                             dashpot_last_error());
  }

  /// `stiffness` in N/m and `damping` in N s/m; a tenth of the numbers for rotation.
  void set_gains(double stiffness, double damping, double ratio, std::int32_t expected) {
    Eigen::Matrix<double, 6, 1> shares;
    shares << 1, 1, 1, 0.1, 0.1, 0.1;
    const Eigen::Matrix<double, 6, 6> K = (stiffness * shares).asDiagonal();
    const Eigen::Matrix<double, 6, 6> C = (damping * shares).asDiagonal();
    dashpot_gains gains{};
    gains.struct_size = sizeof gains;
    gains.joints = 7;
    gains.task_stiffness = K.data();
    if (ratio > 0) {
      gains.task_damping_ratio = &ratio;
    } else {
      gains.task_damping = C.data();
    }
    expect(dashpot_set_gains(controller_, &gains), expected, "dashpot_set_gains");
  }

  void make_another() {
    const Hosted other(url_);
    const dashpot::sim::JointVector q = SoakLoop::home();
    dashpot_modes modes{};
    modes.struct_size = sizeof modes;
    expect(dashpot_analyze(other.controller.get(), q.data(), DASHPOT_MODE_CARTESIAN, nullptr,
                           nullptr, &modes),
           DASHPOT_OK, "dashpot_analyze");
  }

  dashpot_controller* controller_;
  std::string url_;
};

/// Prints the intervals, and judges them.
class Judge {
 public:
  bool good() const { return good_; }

  void print_header() const {
    std::printf("%52s%42s\n", "tick, us", "wake-up late, us");
    std::printf("%8s%10s", "s", "ticks");
    for (int i = 0; i < 2; ++i) {
      std::printf("%9s%8s%8s%8s%9s", "50 %", "99 %", "99.9 %", "99.99 %", "max");
    }
    std::printf("%7s%9s%5s%8s%8s%8s%9s\n", "missed", "MB", "fd", "threads", "tip, um", "modes",
                "bounded");
  }

  void take(const LoopInterval& loop, const Footprint& held, const Listener& listener) {
    ticks_ += loop.ticks;
    const std::int64_t states = listener.states - states_, modes = listener.modes - modes_;
    const std::int64_t unbounded = listener.unbounded - unbounded_;
    states_ += states, modes_ += modes, unbounded_ += unbounded;
    std::printf("%8.0f%10ld", 1e-3 * static_cast<double>(ticks_), loop.ticks);
    print(loop.tick);
    print(loop.late);
    std::printf("%7ld%9.2f%5ld%8ld%8.1f%8ld%9ld\n", loop.missed,
                1e-6 * static_cast<double>(held.memory), held.descriptors, held.threads,
                1e6 * loop.tip_error, modes, modes - unbounded);
    if (!loop.simulated) fail("the simulation failed");
    if (loop.unasked > 0) {
      fail(std::to_string(loop.unasked) +
           " ticks were not ok, the last: " + dashpot_status_text(loop.status));
    }
    if (loop.tip_error > kLargestError) fail("the arm does not reach its goals");
    if (unbounded > 0) fail("modes have lost their bound");
    if (states == 0 || modes == 0) fail("nothing comes over the bus");
    if (loop.number == 2) first_ = held, first_error_ = loop.tip_error;
    last_ = held, last_error_ = loop.tip_error;
    intervals_ = loop.number;
    std::fflush(stdout);
  }

  void finish() {
    if (intervals_ < 3) {
      std::printf("too short to compare its beginning with its end\n");
      return;
    }
    std::printf("since the second line: %+.2f MB, %+ld descriptors, %+ld threads, %+.2f um\n",
                1e-6 * static_cast<double>(last_.memory - first_.memory),
                last_.descriptors - first_.descriptors, last_.threads - first_.threads,
                1e6 * (last_error_ - first_error_));
    if (last_.memory > first_.memory + kMoreMemory) fail("memory grew");
    if (last_.descriptors > first_.descriptors) fail("descriptors grew");
    if (last_.threads > first_.threads) fail("threads grew");
    if (last_error_ > first_error_ + kMoreError) fail("the arm drifts away from its goals");
  }

  void fail(const std::string& what) {
    std::printf("FAILED: %s\n", what.c_str());
    good_ = false;
  }

 private:
  static void print(const LogHistogram& durations) {
    const auto us = [](std::int64_t duration) { return 1e-3 * static_cast<double>(duration); };
    std::printf("%9.1f%8.1f%8.1f%8.1f%9.1f", us(durations.quantile(0.5)),
                us(durations.quantile(0.99)), us(durations.quantile(0.999)),
                us(durations.quantile(0.9999)), us(durations.largest()));
  }

  bool good_ = true;
  std::int64_t ticks_ = 0, states_ = 0, modes_ = 0, unbounded_ = 0, intervals_ = 0;
  Footprint first_, last_;  // of the second interval and of the last
  double first_error_ = 0, last_error_ = 0;
};

bool soak(const Request& request) {
  for (const int signal : {SIGINT, SIGTERM}) std::signal(signal, [](int) { interrupted = true; });
  // A port of this process alone.
  const std::string url =
      "udpm://239.255.76.67:" + std::to_string(20000 + getpid() % 30000) + "?ttl=0";
  const auto cycles = std::max<std::int64_t>(4, std::llround(request.count * kSecond / kCycle));
  Listener listener(url);
  const Hosted hosted(url);
  SoakLoop loop(hosted.controller.get(), std::llround(1e6 / request.times), cycles,
                std::min<std::int64_t>(cycles / 4, 150));
  Operator operator_thread(hosted.controller.get(), url);
  Judge judge;
  loop.start();
  std::int64_t second = -1;
  judge.print_header();
  for (bool done = false; !done;) {
    done = loop.done();  // what it has handed over is fetched below
    if (interrupted) loop.stop();
    if (loop.take_release()) dashpot_release(hosted.controller.get());
    if (const std::int64_t now = loop.ticks() / kSecond; now > second) {
      try {
        operator_thread.work(second = now);
      } catch (const std::runtime_error& error) {
        judge.fail(error.what());
      }
    }
    if (loop.fetch()) judge.take(loop.interval(), footprint(), listener);
    std::this_thread::sleep_for(milliseconds(2));
  }
  judge.finish();
  std::printf("%sscheduled ahead of others\n", loop.scheduled() ? "" : "not ");
  return judge.good();
}

const AddPart part({"soak",
                    0,
                    "Run the loop of a host in real time, or so many times as fast: durations, "
                    "memory, descriptors and threads; SIGINT ends it early",
                    "SECONDS",
                    {{60, 16}},
                    soak,
                    {"TIMES"}});

}  // namespace
