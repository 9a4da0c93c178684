// The loop of a host in real time, for as long as one likes, or so many times as fast. A simulated
// Panda follows goals at 1 kHz under the plugin. Meanwhile another thread changes gains, asks for
// some that are refused, releases faults, and makes a second controller with a publisher and
// destroys it; states and modes go over LCM and are read again. A line each 10 minutes, or each
// quarter of a shorter run. The first of these is for warming up; what the last one needs more than
// the second is a failure, as is a status other than ok, a bound that is lost, a goal that is not
// reached. SIGINT or SIGTERM ends it with the cycle of 4 s.
#include <dashpot/lcmtypes/plugin_publisher.h>
#include <dashpot/analysis/solver_status.hpp>
#include <dashpot/lcmtypes/bus.hpp>
#include <dashpot/lcmtypes/message_reader.hpp>
#include <dashpot/sim/arm.hpp>
#include <dashpot/sim/plant.hpp>
#include <dashpot/tests/stress/part.hpp>
#include <dashpot/tests/support/places.hpp>

#include <unistd.h>

#include <algorithm>
#include <array>
#include <atomic>
#include <chrono>
#include <cmath>
#include <csignal>
#include <cstdio>
#include <filesystem>
#include <fstream>
#include <limits>
#include <memory>
#include <stdexcept>
#include <string>
#include <thread>

namespace {

namespace sim = dashpot::sim;
using dashpot::stress::Request;
using std::chrono::steady_clock;

constexpr std::int64_t kSecond = 1000, kCycle = 4 * kSecond;  // ticks
constexpr std::int64_t kLost = 20;             // ticks without positions, with which a cycle begins
constexpr std::int64_t kAct = 200;             // tick of a second in which the other thread begins
constexpr std::int64_t kMoreMemory = 4 << 20;  // bytes
constexpr double kLargestError = 5e-3, kMoreError = 5e-4;  // m
constexpr auto kUnfinished = static_cast<int>(dashpot::analysis::Status::kUnfinished);

std::atomic<bool> interrupted{false};

sim::JointVector home() {
  return (sim::JointVector(7) << 0, -0.785, 0, -2.356, 0, 1.571, 0.785).finished();
}

struct Destroy {
  void operator()(dashpot_controller* controller) const { dashpot_destroy(controller); }
  void operator()(dashpot_publisher* publisher) const { dashpot_publisher_destroy(publisher); }
};

/// A controller at rest at its home, with its publisher.
struct Hosted {
  explicit Hosted(const std::string& url)
      : controller(dashpot_create_from_text(
            "robot: {urdf: panda.urdf, base: panda_link0, tip: panda_hand_tcp}\n"
            "analysis: {sampled: {interval: 100 ms}}\n",
            (DASHPOT_SOURCE_DIR "/sim/models").c_str())) {
    if (!controller || dashpot_start(controller.get(), home().data(), nullptr) != 0) {
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
    handlers_.on_state = [this](const dashpot::state_t&) { ++states; };
    handlers_.on_modes = [this](const dashpot::modes_t& message) {
      if (message.status == kUnfinished) return;  // another thread goes on with it
      ++modes;
      const auto& bounds = message.eigenvalue_bound;
      if (message.status != 0 ||
          !std::all_of(bounds.begin(), bounds.end(), [](double x) { return std::isfinite(x); }))
        ++unbounded;
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
  std::int64_t descriptors = 0, threads = 0;
};

Footprint footprint() {
  const auto entries = [](const char* directory) {
    const std::filesystem::directory_iterator begin(directory);
    return std::distance(begin, std::filesystem::directory_iterator());
  };
  std::int64_t size = 0, resident = 0;
  std::ifstream("/proc/self/statm") >> size >> resident;
  return {resident * sysconf(_SC_PAGESIZE), entries("/proc/self/fd") - 1,  // the one that counts
          entries("/proc/self/task")};
}

void expect(std::int32_t code, std::int32_t expected, const char* what) {
  if (code == expected) return;
  throw std::runtime_error(std::string(what) + " returned " + std::to_string(code) + ": " +
                           dashpot_last_error());
}

/// `stiffness` in N/m and `damping` in N s/m; a tenth of the numbers for rotation.
void set_gains(dashpot_controller* controller, double stiffness, double damping, double ratio,
               std::int32_t expected) {
  const Eigen::Matrix<double, 6, 1> shares{{1, 1, 1, 0.1, 0.1, 0.1}};
  const Eigen::Matrix<double, 6, 6> K = (stiffness * shares).asDiagonal();
  const Eigen::Matrix<double, 6, 6> C = (damping * shares).asDiagonal();
  dashpot_gains gains{};
  gains.struct_size = sizeof gains;
  gains.joints = 7;
  gains.task_stiffness = K.data();
  (ratio > 0 ? gains.task_damping_ratio : gains.task_damping) = ratio > 0 ? &ratio : C.data();
  expect(dashpot_set_gains(controller, &gains), expected, "dashpot_set_gains");
}

/// Acts as the other thread does in a second of a cycle. Returns what went wrong, or nothing.
std::string act(dashpot_controller* controller, const std::string& url, std::int64_t second) try {
  if (second == 0) {
    dashpot_release(controller);
    set_gains(controller, 400, 0, 0.7, DASHPOT_OK);
  }
  if (second == 1) set_gains(controller, 600, 60, 0, DASHPOT_OK);
  if (second == 2) set_gains(controller, 1e7, 0, 0, DASHPOT_UNSTABLE_GAINS);
  if (second == 3) {
    const Hosted other(url);
    dashpot_modes modes{};
    modes.struct_size = sizeof modes;
    expect(dashpot_analyze(other.controller.get(), home().data(), DASHPOT_MODE_CARTESIAN, nullptr,
                           nullptr, &modes),
           DASHPOT_OK, "dashpot_analyze");
  }
  return "";
} catch (const std::exception& error) {
  return error.what();
}

struct Goal {
  sim::JointVector position;
  sim::Pose tip;
  Eigen::Matrix<double, 3, 3, Eigen::RowMajor> rotation;
};

std::array<Goal, 4> goals_of(sim::Arm& arm) {
  std::array<Goal, 4> goals;
  for (std::size_t i = 0; i < goals.size(); ++i) {
    sim::JointVector& q = goals[i].position = home();
    for (Eigen::Index j = 0; j < q.size(); ++j) {
      q[j] += 0.05 * std::sin(static_cast<double>(j) + 1.5 * static_cast<double>(i));
    }
    goals[i].tip = arm.tip_pose(q);
    goals[i].rotation = goals[i].tip.rotation;
  }
  return goals;
}

bool soak(const Request& request) {
  for (const int signal : {SIGINT, SIGTERM}) std::signal(signal, [](int) { interrupted = true; });
  // A port of this process alone.
  const std::string url =
      "udpm://239.255.76.67:" + std::to_string(20000 + getpid() % 30000) + "?ttl=0";
  const auto cycles = std::max<std::int64_t>(4, std::llround(request.count * kSecond / kCycle));
  const std::int64_t interval = std::min<std::int64_t>(cycles / 4, 150) * kCycle;
  Listener listener(url);
  const Hosted hosted(url);
  sim::Arm arm(sim::Robot::from_file(DASHPOT_SOURCE_DIR "/sim/models/panda.urdf", "panda_link0",
                                     "panda_hand_tcp"));
  const std::array<Goal, 4> goals = goals_of(arm);
  sim::PlantOptions options;
  sim::JointVector torque = options.initial_torque = sim::JointVector::Zero(7);
  sim::Plant plant(arm, options, home());

  bool good = true, fault = false;
  const auto check = [&good](bool well, const std::string& what) {
    if (!well) std::printf("FAILED: %s\n", what.c_str());
    good = good && well;
  };
  std::string said;  // by the other thread
  std::thread other;
  Footprint first, last;  // of the second interval and of the last
  double error = 0, first_error = 0, longest = 0;
  std::printf("%8s%9s%5s%8s%9s%8s%9s%13s\n", "s", "MB", "fd", "threads", "tip, um", "states",
              "modes", "longest, us");
  const std::chrono::nanoseconds period(std::llround(1e6 / request.times));
  auto deadline = steady_clock::now();
  for (std::int64_t k = 0; k < cycles * kCycle && good && !(interrupted && k % kCycle == 0); ++k) {
    std::this_thread::sleep_until(deadline += period);
    const auto begin = steady_clock::now();
    if (begin > deadline + period) deadline = begin;
    const std::int64_t second = k / kSecond % 4, rest = k % kSecond;
    // The arm goes to another goal each second, two in joint space and two in Cartesian space.
    const Goal& goal = goals[static_cast<std::size_t>(second)];
    const sim::Measurement& measured = plant.measured();
    sim::JointVector position = measured.position;
    if (second == 0 && k >= kCycle && rest < kLost) {
      fault = true;
      position.setConstant(std::numeric_limits<double>::quiet_NaN());
    }
    if (rest == kAct) {
      other = std::thread([&, second] { said = act(hosted.controller.get(), url, second); });
    }
    const dashpot_state state = {
        sizeof state, 7, measured.time, position.data(), measured.velocity.data(), nullptr};
    const dashpot_setpoint setpoint = {
        sizeof setpoint,      7,
        measured.time,        second < 2 ? DASHPOT_MODE_JOINT : DASHPOT_MODE_CARTESIAN,
        goal.position.data(), goal.tip.position.data(),
        goal.rotation.data(), nullptr};
    dashpot_output output = {sizeof output, 7, torque.data()};
    const std::int32_t status = dashpot_update(hosted.controller.get(), &state,
                                               rest % 100 == 0 ? &setpoint : nullptr, &output);
    const std::chrono::duration<double, std::micro> duration = steady_clock::now() - begin;
    longest = std::max(longest, duration.count());
    if (rest > kAct && status == DASHPOT_OK) fault = false;
    check(status == DASHPOT_OK || (fault && status > 0 && k % kCycle < kSecond + kAct),
          std::string("a tick was not ok: ") + dashpot_status_text(status));
    check(plant.step(torque) == sim::Status::kOk, "the simulation failed");
    if (rest < kSecond - 1) continue;
    if (second % 2 == 1) {  // the other seconds begin with another mode
      error = std::max(error, (arm.tip_pose(plant.position()).position - goal.tip.position).norm());
    }
    other.join();
    check(said.empty(), said);
    if ((k + 1) % interval != 0) continue;
    last = footprint();
    std::printf("%8.0f%9.2f%5ld%8ld%9.1f%8ld%9ld%13.1f\n", 1e-3 * static_cast<double>(k + 1),
                1e-6 * static_cast<double>(last.memory), last.descriptors, last.threads,
                1e6 * error, listener.states.exchange(0), listener.modes.load(), longest);
    std::fflush(stdout);
    check(error < kLargestError, "the arm does not reach its goals");
    check(listener.unbounded == 0, "modes have lost their bound");
    check(listener.modes.exchange(0) > 0, "nothing comes over the bus");
    if ((k + 1) / interval == 2) first = last, first_error = error;
    if ((k + 1) / interval > 2) {
      check(last.memory <= first.memory + kMoreMemory, "memory grew");
      check(last.descriptors <= first.descriptors, "descriptors grew");
      check(last.threads <= first.threads, "threads grew");
      check(error <= first_error + kMoreError, "the arm drifts away from its goals");
    }
    error = longest = 0;
  }
  if (other.joinable()) other.join();
  return good;
}

const dashpot::stress::AddPart part({"soak",
                                     0,
                                     "Run the loop of a host in real time, or so many times as "
                                     "fast: memory, descriptors and threads; SIGINT ends it early",
                                     "SECONDS",
                                     {{60, 16}},
                                     soak,
                                     {"TIMES"}});

}  // namespace
