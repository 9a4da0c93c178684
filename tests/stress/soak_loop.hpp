#pragma once
// A simulated Panda under a controller of the C interface, in real time or a multiple of it, on a
// thread of its own.

#include <dashpot/controller/plugin.h>
#include <dashpot/apps/loop/privileges.hpp>
#include <dashpot/controller/latest.hpp>
#include <dashpot/sim/arm.hpp>
#include <dashpot/sim/plant.hpp>
#include <dashpot/tests/stress/log_histogram.hpp>
#include <dashpot/tests/support/places.hpp>

#include <algorithm>
#include <array>
#include <atomic>
#include <cerrno>
#include <cstdint>
#include <ctime>
#include <limits>
#include <optional>
#include <thread>

namespace dashpot::stress {

constexpr std::int64_t kSecond = 1000;        ///< ticks of a second
constexpr std::int64_t kCycle = 4 * kSecond;  ///< ticks after which everything happens again
constexpr std::int64_t kLost = 20;      ///< ticks without positions, with which a cycle begins
constexpr std::int64_t kRelease = 200;  ///< tick of a cycle when the fault is to be released
constexpr const char* kSoakConfig =
    "robot: {urdf: panda.urdf, base: panda_link0, tip: panda_hand_tcp}\n"
    "analysis: {sampled: {interval: 100 ms}}\n";

/// Results of the loop in some whole cycles.
struct LoopInterval {
  std::int64_t number = 0;  ///< from 1
  std::int64_t ticks = 0;
  LogHistogram tick;         ///< durations of dashpot_update
  LogHistogram late;         ///< wake-ups after their deadline
  std::int64_t missed = 0;   ///< ticks that ended after their period
  std::int64_t unasked = 0;  ///< ticks with a status other than ok, but for the faults on purpose
  std::int32_t status = 0;   ///< the last of these
  double tip_error = 0;      ///< m, farthest of the tip from a goal when it had to be there
  bool simulated = true;     ///< the simulation did not fail
};

/// The arm goes to another goal each second, two in joint space and two in Cartesian space. A cycle
/// begins with a fault, positions that are lost for 20 ms, which somebody else has to release.
class SoakLoop {
 public:
  /// `controller` is one of kSoakConfig; only this loop may call its dashpot_update. The loop wakes
  /// every `period`, ns, and lives through a millisecond. Throws sim::InvalidRobot.
  SoakLoop(dashpot_controller* controller, std::int64_t period, std::int64_t cycles,
           std::int64_t cycles_of_interval)
      : controller_(controller),
        period_(period),
        ticks_(cycles * kCycle),
        ticks_of_interval_(cycles_of_interval * kCycle),
        arm_(sim::Robot::from_file(DASHPOT_SOURCE_DIR "/sim/models/panda.urdf", "panda_link0",
                                   "panda_hand_tcp")) {
    for (std::size_t i = 0; i < goals_.size(); ++i) {
      Goal& goal = goals_[i];
      goal.position = home();
      for (Eigen::Index j = 0; j < goal.position.size(); ++j) {
        goal.position[j] += 0.05 * std::sin(static_cast<double>(j) + 1.5 * static_cast<double>(i));
      }
      goal.tip = arm_.tip_pose(goal.position);
      goal.rotation = goal.tip.rotation;
    }
    sim::PlantOptions options;
    options.initial_torque = sim::JointVector::Zero(7);
    plant_.emplace(arm_, options, home());
    torque_ = options.initial_torque;
  }
  ~SoakLoop() {
    stop();
    leave_ = true;
    leave_.notify_one();
    if (thread_.joinable()) thread_.join();
  }
  SoakLoop(const SoakLoop&) = delete;
  SoakLoop& operator=(const SoakLoop&) = delete;

  static sim::JointVector home() {
    return (sim::JointVector(7) << 0, -0.785, 0, -2.356, 0, 1.571, 0.785).finished();
  }

  void start() {
    thread_ = std::thread([this] { run(); });
  }
  /// The loop ends with its cycle.
  void stop() noexcept { stop_ = true; }
  bool done() const noexcept { return done_; }
  /// Whether SCHED_FIFO was granted.
  bool scheduled() const noexcept { return scheduled_; }
  std::int64_t ticks() const noexcept { return ticks_made_; }
  /// Whether a fault is to be released; true once for each.
  bool take_release() noexcept { return release_.exchange(false); }
  /// Fetches the latest interval that is over; false if there is no new one.
  bool fetch() noexcept { return over_.fetch(); }
  const LoopInterval& interval() const noexcept { return over_.value(); }

 private:
  struct Goal {
    sim::JointVector position;
    sim::Pose tip;
    Eigen::Matrix<double, 3, 3, Eigen::RowMajor> rotation;
  };

  static std::int64_t now() noexcept {
    timespec time{};
    clock_gettime(CLOCK_MONOTONIC, &time);
    return time.tv_sec * 1'000'000'000 + time.tv_nsec;
  }

  void run() noexcept {
    scheduled_ = apps::schedule_ahead_of_others();
    std::int64_t deadline = now() + period_;
    for (std::int64_t k = 0; k < ticks_ && seen_.simulated; ++k) {
      const timespec time = {deadline / 1'000'000'000, deadline % 1'000'000'000};
      while (clock_nanosleep(CLOCK_MONOTONIC, TIMER_ABSTIME, &time, nullptr) == EINTR) {
      }
      seen_.late.add(now() - deadline);
      tick(k);
      deadline += period_;
      if (const std::int64_t end = now(); end > deadline) {
        ++seen_.missed;
        if (end > deadline + period_) deadline = end;
      }
      // On a busy machine the release is late: nothing goes on until then, for 60 s
      // of the loop at most.
      if (asked_ && (k + 1) % kSecond == kRelease + 100) {
        asked_ = ++waited_ < 600;
        k -= 99;
      }
      ticks_made_ = k + 1;
      const bool last = k + 1 == ticks_ || !seen_.simulated || (stop_ && (k + 1) % kCycle == 0);
      if (last || (k + 1) % ticks_of_interval_ == 0) hand_over();
      if (last) break;
    }
    done_ = true;
    leave_.wait(false);  // so that it counts among the threads until the last look at them
  }

  void tick(std::int64_t k) noexcept {
    const std::int64_t second = k / kSecond % 4, rest = k % kSecond;
    const Goal& goal = goals_[static_cast<std::size_t>(second)];
    const sim::Measurement& measured = plant_->measured();
    sim::JointVector position = measured.position;
    if (second == 0 && k >= kCycle && rest < kLost) {
      asked_ = true;
      position.setConstant(std::numeric_limits<double>::quiet_NaN());
    }
    if (second == 0 && rest == kRelease) release_ = true;
    const dashpot_state state = {
        sizeof state, 7, measured.time, position.data(), measured.velocity.data(), nullptr};
    const dashpot_setpoint setpoint = {
        sizeof setpoint,      7,
        measured.time,        second < 2 ? DASHPOT_MODE_JOINT : DASHPOT_MODE_CARTESIAN,
        goal.position.data(), goal.tip.position.data(),
        goal.rotation.data(), nullptr};
    dashpot_output output = {sizeof output, 7, torque_.data()};
    const std::int64_t begin = now();
    const std::int32_t status =
        dashpot_update(controller_, &state, rest % 100 == 0 ? &setpoint : nullptr, &output);
    seen_.tick.add(now() - begin);
    if (rest > kRelease && status == DASHPOT_OK) asked_ = false, waited_ = 0;
    if (status != DASHPOT_OK && (!asked_ || status < 0)) {
      ++seen_.unasked;
      seen_.status = status;
    }
    seen_.simulated = plant_->step(torque_) == sim::Status::kOk;
    if (second % 2 == 1 && rest == kSecond - 1) {  // the other seconds begin with another mode
      const double error = (arm_.tip_pose(plant_->position()).position - goal.tip.position).norm();
      seen_.tip_error = std::max(seen_.tip_error, error);
    }
    ++seen_.ticks;
  }

  void hand_over() noexcept {
    ++seen_.number;
    over_.write(seen_);
    const std::int64_t number = seen_.number;
    const bool simulated = seen_.simulated;
    seen_ = LoopInterval();
    seen_.number = number;
    seen_.simulated = simulated;
  }

  dashpot_controller* controller_;
  std::int64_t period_, ticks_, ticks_of_interval_;
  sim::Arm arm_;
  std::array<Goal, 4> goals_;
  std::thread thread_;

  // The loop's own:
  std::optional<sim::Plant> plant_;
  sim::JointVector torque_;
  bool asked_ = false;       ///< a fault on purpose is not over yet
  std::int64_t waited_ = 0;  ///< tenths of a second for its release
  LoopInterval seen_;

  // Between the threads:
  controller::Latest<LoopInterval> over_;
  std::atomic<std::int64_t> ticks_made_{0};
  std::atomic<bool> stop_{false}, done_{false}, release_{false}, scheduled_{false}, leave_{false};
};

}  // namespace dashpot::stress
