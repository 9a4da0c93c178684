#include <dashpot/analysis/solver_status.hpp>
#include <dashpot/apps/loop/loop_journal.hpp>
#include <dashpot/lcmtypes/plugin_samples.hpp>

#include <algorithm>
#include <cmath>

namespace dashpot::apps {
namespace {

constexpr std::int64_t kMostTimes = 1 << 24;  // tick times that are kept
constexpr std::int64_t kPublishEvery = 64;    // ticks: all without real time, and samples

}  // namespace

LoopJournal::LoopJournal(LoopController& controller, LoopGoal& goal, lcmtypes::Publisher& publisher,
                         CommandSource* commands, Pace pace)
    : controller_(controller),
      goal_(goal),
      publisher_(publisher),
      commands_(commands),
      pace_(pace) {}

void LoopJournal::keep_times(std::int64_t ticks) {
  record.tick_times.assign(static_cast<std::size_t>(std::min(ticks, kMostTimes)), 0);
}

void LoopJournal::begin_tick() noexcept {
  released_ = commands_ != nullptr && commands_->take();
  if (commands_ != nullptr) state_.health.commands = commands_->fetch_tally();
}

void LoopJournal::note_tick(std::int64_t utime, std::int32_t status,
                            std::int32_t tick_time) noexcept {
  const bool commanded = commands_ != nullptr && commands_->taken();
  if (commanded && status == DASHPOT_SETPOINT_REJECTED) ++record.commands_refused;
  const auto kept = static_cast<std::size_t>(record.ticks % kMostTimes);
  if (kept < record.tick_times.size()) record.tick_times[kept] = tick_time;
  const auto last = record.statuses.size() - 1;
  ++record.statuses[status < 0 ? last : std::min(static_cast<std::size_t>(status), last)];
  if (record.ticks > 0 && status != last_status_) ++record.status_changes;
  last_status_ = status;
  publish(utime);
  // Published with the next state.
  state_.health.tick_time = tick_time;
  state_.health.longest_tick_time = std::max(state_.health.longest_tick_time, tick_time);
  state_.health.overruns = record.overruns;
}

void LoopJournal::note_fault(const dashpot_snapshot& snapshot) noexcept {
  // A fault that latches again at the tick of its release is another fault.
  if (snapshot.fault != record.fault || (released_ && snapshot.fault != DASHPOT_OK)) {
    record.fault = snapshot.fault;
    record.fault_tick = 0;
    if (record.fault != DASHPOT_OK) {
      record.fault_tick = static_cast<std::int64_t>(snapshot.tick);
      ++record.faults;
    }
  }
  state_.health.fault_tick = record.fault_tick;
  goal_.note_fault(record.fault != DASHPOT_OK);
  if (commands_ != nullptr) commands_->set_fault_tick(record.fault_tick);
}

void LoopJournal::publish(std::int64_t utime) noexcept {
  const dashpot_snapshot& snapshot = controller_.snapshot();
  note_errors(snapshot);
  if (record.ticks == 0) first_restarts_ = snapshot.restarts;
  record.restarts = snapshot.restarts - first_restarts_;
  note_fault(snapshot);
  state_.utime = utime;
  lcmtypes::fill(snapshot, state_.snapshot);
  publisher_.offer(state_);
  bool publish_now = record.ticks % kPublishEvery == 0;
  const dashpot_modes* modes = controller_.new_modes();
  if (modes != nullptr && modes->time >= 0) {  // not of the hand's guidance
    awaits_modes_ = modes->status == static_cast<std::int32_t>(analysis::Status::kUnfinished);
    if (!awaits_modes_) {
      if (record.first_modes.tick == 0) record.first_modes = *modes;
      record.last_modes = *modes;
    }
    // They may belong to an earlier tick.
    modes_.utime = utime - (snapshot.time - modes->time) / 1000;
    lcmtypes::fill(*modes, modes_);
    publisher_.offer(modes_);
    publish_now = true;
  }
  if (pace_ == Pace::kFast && publish_now) publisher_.publish_pending();
  // Their thread keeps its own pace: in fast motion they would come at random times.
  if (pace_ == Pace::kRealTime && record.ticks % kPublishEvery == 0) {
    publish_sampled(utime, snapshot.time);
  }
}

void LoopJournal::publish_sampled(std::int64_t utime, std::int64_t time) noexcept {
  const dashpot_sampled_modes* modes = controller_.new_sampled_modes();
  if (modes == nullptr || modes->time < 0) return;  // of the hand's guidance
  sampled_.utime = utime - (time - modes->time) / 1000;
  lcmtypes::fill(*modes, sampled_);
  publisher_.offer(sampled_);
}

void LoopJournal::note_errors(const dashpot_snapshot& snapshot) noexcept {
  if (snapshot.status >= DASHPOT_STATE_NOT_FINITE) return;  // of an earlier tick
  record.damping_level = std::min(record.damping_level, snapshot.damping_level);
  if (snapshot.mode == DASHPOT_MODE_CARTESIAN) {
    record.cartesian = true;
    const Eigen::Map<const controller::Vector6> error(snapshot.tip_error);
    record.tip_error = std::max(record.tip_error, error.head<3>().norm());
    record.tip_angle_error = std::max(record.tip_angle_error, error.tail<3>().norm());
    return;
  }
  record.joint = true;
  for (std::uint32_t i = 0; i < snapshot.joints; ++i) {
    const double error = std::abs(snapshot.reference_joint_position[i] - snapshot.position[i]);
    record.joint_error = std::max(record.joint_error, error);
  }
}

}  // namespace dashpot::apps
