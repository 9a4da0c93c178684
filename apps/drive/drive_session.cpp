#include <dashpot/apps/drive/drive_session.hpp>
#include <dashpot/controller/dynamics.hpp>
#include <dashpot/text/printable.hpp>

#include <algorithm>
#include <cmath>
#include <ctime>
#include <limits>
#include <stdexcept>
#include <utility>

namespace dashpot::apps {
namespace {

using lcmtypes::DriverCommand;
using lcmtypes::DriverKind;
using lcmtypes::DriverStatus;

constexpr std::int64_t kWatch = 300'000;        // us of statuses before the start
constexpr std::size_t kFewest = 20;             // of them
constexpr double kPeriodTolerance = 0.2;        // of the period
constexpr double kOldest = 2;                   // largest age of an answered status, periods
constexpr std::int64_t kSameClock = 1'000'000;  // us between the driver's clock and the time of day
constexpr std::int64_t kDrift = 1000;           // 1/kDrift: largest drift between the clocks
constexpr double kUpright = 0.9998;      // cosine of the largest angle of an upright base, 1 deg
constexpr double kNearLimit = 0.8;       // share of the external torque at which the driver stops
constexpr std::size_t kRemembered = 64;  // commands sent
constexpr double kFade = 0.2;            // s from a stop to no torque, at least
constexpr std::int64_t kLongestStop = 1'000'000;  // us: the torque fades then in any case
constexpr std::int64_t kLook = 100'000;           // us between two checks of a stopping arm
constexpr double kStands = 1e-3;                  // rad between two checks: less is standstill
// us: a later time is invalid, and does not fit into nanoseconds.
constexpr std::int64_t kLatest = std::numeric_limits<std::int64_t>::max() / 2000;

bool finite(const DriverStatus& status) {
  return status.position.allFinite() && status.velocity.allFinite();
}

/// Throws unless the controller knows the loop that this driver closes.
void check_loop(const controller::Config& config, DriverKind driver) {
  const controller::Settings& settings = config.settings;
  const controller::Analysis::Sampled& loop = settings.analysis.sampled;
  if (settings.feed_forward.gravity) {
    throw InputError("feed_forward.gravity",
                     "must be false: the driver compensates gravity, which would act twice");
  }
  const Eigen::Vector3d& gravity = config.model.gravity();
  if (gravity.z() > -kUpright * gravity.norm()) {
    throw InputError("robot.gravity",
                     "is not along -z of the base: the robot compensates gravity for an upright "
                     "base, so that an arm on a wall or a ceiling would pull by the difference");
  }
  if (loop.delay < 1) {
    throw InputError("analysis.sampled.delay",
                     "must be at least 1: a command acts a period after its status at the soonest");
  }
  if (driver == DriverKind::kIiwa && !loop.difference_velocity) {
    throw InputError(
        "analysis.sampled.difference_velocity",
        "must be true with --iiwa: velocities are differences of positions here, because the "
        "driver filters its velocities with a low-pass of 40 Hz");
  }
  if (driver == DriverKind::kPanda && !(loop.cutoff > 0)) {
    throw InputError(
        "analysis.sampled.cutoff",
        "must be the cutoff of the driver's low-pass on torques with --panda: 27.484 Hz for its "
        "--low_pass_freq of 30 Hz");
  }
}

}  // namespace

DriveSession::DriveSession(const controller::Config& config, LoopController& controller,
                           LoopGoal& goal, LoopJournal& journal, const Options& options)
    : config_(config),
      controller_(controller),
      goal_(goal),
      journal_(journal),
      options_(options),
      profile_(lcmtypes::profile_of(options.driver)),
      n_(config.model.dof()) {
  check_loop(config, options.driver);
  torque_ = record.external = JointVector::Zero(n_);
  const controller::Limits& limits = config.settings.limits;
  const double slowest = limits.torque.cwiseQuotient(limits.torque_rate).maxCoeff();
  fade_ = std::llround(1e6 * std::max(kFade, slowest));
}

bool DriveSession::stopped_by_itself(const DriverStatus& status) const noexcept {
  // libfranka's modes: 3 guiding, 4 reflex, 5 stopped by the user, 6 recovers
  return options_.driver == DriverKind::kPanda && status.robot_mode >= 3 && status.robot_mode <= 6;
}

bool DriveSession::take(const DriverStatus& status, std::int64_t arrived, std::int64_t now,
                        DriverCommand& command) {
  ++record.statuses;
  const bool possible = status.utime <= kLatest;
  if (!possible || status.position.size() != n_ || status.velocity.size() != n_) {
    if (running_ || !possible) {
      ++record.unreadable;
      return false;
    }
    throw InputError("robot", "has " + std::to_string(n_) +
                                  " joints from base to tip, the driver " +
                                  std::to_string(status.position.size()));
  }
  if (status.utime < 0) {  // the iiwa's clock is not known yet
    restarted_ = running_;
    return false;
  }
  if (last_ > 0 && status.utime <= last_) {
    note_repeated(status);
    return false;
  }
  const std::int64_t interval = last_ > 0 ? status.utime - last_ : 0;
  last_ = status.utime;
  repeated_ = 0;
  note_age(status.utime, interval, arrived, now);
  if (stopped_by_itself(status)) {
    ++record.stopped;
    if (record.stopped == 1) {
      warning_ = "the robot has stopped by itself (robot_mode " +
                 std::to_string(status.robot_mode) + "): not answered";
    }
    first_ = 0;
    intervals_.clear();
    return false;
  }
  if (!running_) {
    if (interval > 0 && first_ > 0) intervals_.push_back(interval);
    watch(status, age(now) > kOldest * config_.settings.period);
    if (!running_) return false;
  } else {
    const double periods = 1e-6 * static_cast<double>(interval) / config_.settings.period;
    record.lost += std::max<std::int64_t>(0, std::llround(periods) - 1);
  }
  if (restarted_ || interval > kWatch) quiet_until_ = status.utime + kWatch;
  restarted_ = false;
  if (status.utime < quiet_until_) {  // after a restart a command would end the driver
    ++record.awaited;
    fastest_.reset();  // the iiwa's driver is still learning the robot's clock
    return false;
  }
  if (!fresh(now)) return false;
  note_external(status);

  journal_.begin_tick();
  JointVector velocity = status.velocity;
  if (config_.settings.analysis.sampled.difference_velocity && measured_at_ < status.utime) {
    velocity = (status.position - last_position_) /
               (1e-6 * static_cast<double>(status.utime - measured_at_));
  }
  if (status.position.allFinite()) {
    last_position_ = status.position;
    measured_at_ = status.utime;
  }
  const std::int64_t time = 1000 * status.utime;
  timespec begin{}, end{};
  clock_gettime(CLOCK_MONOTONIC, &begin);
  const std::int32_t code =
      controller_.update(time, status.position, velocity, goal_.told(time), torque_);
  clock_gettime(CLOCK_MONOTONIC, &end);
  goal_.note_status(code);
  if (code < 0) torque_.setZero();  // a refused call: nothing beyond the driver's gravity
  const std::int64_t took =
      (end.tv_sec - begin.tv_sec) * 1'000'000'000LL + end.tv_nsec - begin.tv_nsec;
  journal_.note_tick(status.utime, code,
                     static_cast<std::int32_t>(
                         std::min<std::int64_t>(took, std::numeric_limits<std::int32_t>::max())));
  journal_.end_tick();
  if (ending_) journal_.record.last_modes = modes_;  // a brake reports no modes
  fade(status.utime);
  if (options_.dry_run) {  // another program moves the arm: its faults do not matter
    if (journal_.record.fault != DASHPOT_OK) goal_.release();
    return false;
  }
  note_fault(code);
  // On the driver's clock, because the Panda's driver lets commands expire by it.
  command.utime = status.utime;
  // The driver itself commands this position with --torque_only.
  command.position = options_.driver == DriverKind::kIiwa ? last_position_ : JointVector();
  command.torque = torque_;
  if (controller_.needs_brakes()) engage(code, command);
  return true;
}

/// Warns of a fault, and of worse statuses after it.
void DriveSession::note_fault(std::int32_t code) {
  const LoopRecord& loop = journal_.record;
  if (loop.faults > faults_ || loop.fault == DASHPOT_OK) told_ = DASHPOT_FAULT_LATCHED;
  faults_ = loop.faults;
  if (loop.fault == DASHPOT_OK) return;
  const std::int32_t worst = std::max(code, loop.fault);
  if (worst <= told_) return;
  told_ = worst;
  warning_ = "a fault has latched, the arm is damped: " +
             std::string(controller::to_text(static_cast<controller::Status>(worst)));
}

/// Ends the motion in the driver's way, with the last command. The Panda's driver ends at a command
/// for another mode, with which libfranka ends the motion, and the robot holds itself. No message
/// makes KUKA brake: after its last command, which has no torque, kuka_driver holds the arm.
void DriveSession::engage(std::int32_t code, DriverCommand& command) {
  const bool panda = options_.driver == DriverKind::kPanda;
  command.torque.setZero();
  if (panda) command.control_mode = 0;
  engaged_ = std::string(controller::to_text(static_cast<controller::Status>(code))) + ": " +
             (panda ? "the driver was made to end the motion"
                    : "press the stop button, the driver cannot engage the robot's brakes") +
             "; nothing more is sent";
}

/// LCM gives the time when it read a status, perhaps long after the arrival: it asks for the
/// kernel's time only if no message was waiting. So the delay beyond the fastest status counts as
/// well, if the driver's clock shows the time of day. The two clocks may drift apart.
void DriveSession::note_age(std::int64_t utime, std::int64_t interval, std::int64_t arrived,
                            std::int64_t now) {
  sent_at_ = arrived;
  const std::int64_t way = now - utime;
  if (!fastest_ && std::abs(way) > kSameClock) return;
  fastest_ = fastest_ ? std::min(way, *fastest_ + (interval + kDrift - 1) / kDrift) : way;
  sent_at_ = std::min(arrived, utime + *fastest_);
}

double DriveSession::age(std::int64_t now) const noexcept {
  return 1e-6 * static_cast<double>(now - sent_at_);
}

bool DriveSession::fresh(std::int64_t now) {
  if (age(now) <= kOldest * config_.settings.period) {
    lates_ = 0;
    return true;
  }
  ++record.late;
  ++lates_;
  if (static_cast<double>(lates_) * config_.settings.period < 1e-6 * kWatch) return false;
  throw std::runtime_error("for " + text::number(1e-6 * kWatch, 4) +
                           " s all statuses were older than two periods: nothing more is sent");
}

/// Reports a clock that went back, because every status would stay unanswered.
void DriveSession::note_repeated(const DriverStatus& status) {
  ++record.repeated;
  if (1e-6 * static_cast<double>(last_ - status.utime) < 1e-6 * kWatch) return;
  if (static_cast<double>(++repeated_) * config_.settings.period < 1e-6 * kWatch) return;
  throw std::runtime_error("the driver's clock has gone back by " +
                           text::number(1e-6 * static_cast<double>(last_ - status.utime), 4) +
                           " s: nothing more is sent");
}

void DriveSession::end() noexcept {
  if (!ending_) modes_ = journal_.record.last_modes;
  ending_ = true;
  goal_.stop();
}

double DriveSession::end_time() const noexcept {
  return 1e-6 * static_cast<double>(kLongestStop + fade_);
}

/// True if a stopping arm has not moved between two checks, or takes too long to stop.
bool DriveSession::stands(std::int64_t utime) {
  if (!stopping_since_) stopping_since_ = utime;
  if (utime - *stopping_since_ >= kLongestStop) return true;
  if (seen_.size() > 0 && utime - seen_at_ < kLook) return false;
  const bool stood = seen_.size() > 0 && (last_position_ - seen_).cwiseAbs().maxCoeff() < kStands;
  seen_ = last_position_;
  seen_at_ = utime;
  return stood;
}

/// After end() was called, scales the torque to zero from standstill on.
void DriveSession::fade(std::int64_t utime) {
  if (!ending_) return;
  if (!fading_since_ && !stands(utime)) return;
  if (!fading_since_) fading_since_ = utime;
  const double share = 1 - static_cast<double>(utime - *fading_since_) / static_cast<double>(fade_);
  torque_ *= std::clamp(share, 0.0, 1.0);
  ended_ = share <= 0;
}

/// Begins after enough statuses. Reports faults of the statuses once they are certain.
void DriveSession::watch(const DriverStatus& status, bool late) {
  if (first_ == 0) {
    first_ = status.utime;
    first_position_ = status.position;
    first_commanded_ = status.commanded;
    moved_ = recommanded_ = false;
  }
  moved_ = moved_ || status.position != first_position_;
  recommanded_ = recommanded_ || status.commanded != first_commanded_;
  last_position_ = status.position;
  measured_at_ = status.utime;
  const bool enough = status.utime - first_ >= kWatch && intervals_.size() >= kFewest && !late;
  if (!enough) return;
  if (!finite(status)) {
    throw InputError("", "the driver's status has NaN or infinity as a position or velocity");
  }
  if (foreign_ && !options_.dry_run) {
    throw InputError("", std::string("somebody else commands on ") + profile_.command_channel +
                             ": end that program first");
  }
  check_period();
  check_springs();
  begin(status);
}

/// With --torque_only the driver commands each position that it measures. With KUKA's springs it
/// commands the position where they are fixed. Commands then move the springs with the arm, so that
/// they only damp; the configuration must give this damping, and no stiffness.
void DriveSession::check_springs() {
  const bool known = first_commanded_.allFinite() && !first_commanded_.isZero(0);
  if (options_.driver != DriverKind::kIiwa || !known || !moved_ || recommanded_) return;
  const controller::Environment& told = config_.settings.environment;
  std::string reason;
  if (told.joint_damping.isZero(0)) {
    reason =
        "the driver commands one fixed position while the arm's measured one changes: KUKA's mode "
        "Torque, or no torque is taken yet; use the mode TorqueOnly and --torque_only, or say in "
        "environment.joint_damping how KUKA's springs damp the arm";
  } else if (!told.joint_stiffness.isZero(0)) {
    reason =
        "environment.joint_stiffness must be 0 in KUKA's mode Torque, because commands lead KUKA's "
        "springs with the arm, so that they hold nothing";
  }
  if (reason.empty()) return;
  if (!options_.dry_run) throw InputError("", reason);
  warning_ = reason;
}

void DriveSession::check_period() {
  std::vector<std::int64_t> sorted = intervals_;
  const auto middle = sorted.begin() + static_cast<std::ptrdiff_t>(sorted.size() / 2);
  std::nth_element(sorted.begin(), middle, sorted.end());
  record.period = 1e-6 * static_cast<double>(*middle);
  const double wanted = config_.settings.period;
  if (std::abs(record.period - wanted) > kPeriodTolerance * wanted) {
    throw InputError("control.period", "is " + text::number(1e3 * wanted, 4) +
                                           " ms, but the driver's statuses come every " +
                                           text::number(1e3 * record.period, 4) + " ms");
  }
}

void DriveSession::begin(const DriverStatus& status) {
  std::string reason;
  if (controller_.start(status.position, reason) != DASHPOT_OK) {
    throw InputError("gains", "the controller refuses to start here: " + reason);
  }
  if (!reason.empty()) warning_ = reason;
  controller::Setpoint setpoint = config_.settings.initial;
  setpoint.joint_position = status.position;
  const auto there = controller::evaluate(config_.model, status.position, JointVector::Zero(n_));
  setpoint.tip_pose = {there.p_BT_B, there.R_BT};
  setpoint.wrench.setZero();
  goal_.begin(setpoint, config_.model.attachment());
  fastest_.reset();  // until now the iiwa's driver may not have known the robot's clock
  running_ = true;
}

void DriveSession::note_external(const DriverStatus& status) {
  if (status.external.size() != n_ || !status.external.allFinite()) return;
  record.external = record.external.cwiseMax(status.external.cwiseAbs());
  for (int i = 0; i < n_ && !warned_external_; ++i) {
    if (static_cast<std::size_t>(i) >= profile_.external_torque.size()) break;
    const double limit = profile_.external_torque[static_cast<std::size_t>(i)];
    if (std::abs(status.external[i]) < kNearLimit * limit) continue;
    warned_external_ = true;
    warning_ = "joint " + std::to_string(i + 1) + ": external torque " +
               text::number(status.external[i], 4) + " N m; the driver stops at " +
               text::number(limit, 4) + " N m";
  }
}

void DriveSession::hear_command(const void* data, std::size_t size) noexcept {
  const auto* bytes = static_cast<const std::uint8_t*>(data);
  for (const std::vector<std::uint8_t>& own : sent_) {
    if (own.size() == size && std::equal(own.begin(), own.end(), bytes)) return;
  }
  foreign_ = true;
}

bool DriveSession::rivalled() const noexcept {
  return running_ && foreign_ && !options_.dry_run;
}

void DriveSession::note_sent(const std::vector<std::uint8_t>& bytes, double latency) {
  ++record.commands;
  sent_.push_back(bytes);
  if (sent_.size() > kRemembered) sent_.pop_front();
  const double us = std::clamp(1e6 * latency, 0.0, 1e9);
  const auto last = static_cast<double>(record.latencies.size() - 1);
  ++record.latencies[static_cast<std::size_t>(std::min(us, last))];
  record.longest_latency = std::max(record.longest_latency, us);
}

std::string DriveSession::warning() {
  return std::exchange(warning_, std::string());
}

}  // namespace dashpot::apps
