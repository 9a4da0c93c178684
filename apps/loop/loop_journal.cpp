#include <dashpot/analysis/solver_status.hpp>
#include <dashpot/apps/loop/loop_journal.hpp>
#include <dashpot/apps/report/json.hpp>
#include <dashpot/controller/attachment.hpp>
#include <dashpot/controller/input_error.hpp>
#include <dashpot/controller/tick_status.hpp>
#include <dashpot/lcmtypes/message_reader.hpp>
#include <dashpot/lcmtypes/plugin_samples.hpp>

#include <algorithm>
#include <chrono>
#include <cmath>
#include <nlohmann/json.hpp>
#include <numeric>
#include <stdexcept>
#include <utility>

namespace dashpot::apps {

using lcmtypes::Command;
using lcmtypes::CommandVerdict;

namespace {

/// Carries out the receiver's part of a valid command; false if the controller refuses it.
bool carry_out(Command& command, LoopGoal& goal, std::string& reason) {
  const std::int64_t before = command.accepted - 1;
  const auto change = [&command, before](controller::Gains& gains) {
    controller::Setpoint changed;
    changed.gains = gains;
    lcmtypes::apply(command, changed, before);
    gains = changed.gains;
  };
  LoopGoal::Change wanted{change, {}, {}, {}};
  if (lcmtypes::has_set(command, command_t::PAYLOAD, before)) wanted.payload = command.payload;
  if (lcmtypes::has_set(command, command_t::TOOL_FRAME, before)) wanted.tool = command.tool;
  if (lcmtypes::has_set(command, command_t::TIP_SPEED, before)) {
    wanted.tip_speed = command.tip_speed;
  }
  if (goal.change(wanted, reason) != DASHPOT_OK) return false;
  if (lcmtypes::has_set(command, command_t::TIP_POSE, before)) {
    command.pose_tool = goal.latest_tool();
  }
  if (lcmtypes::has_set(command, command_t::RELEASE, before)) goal.release();
  return true;
}

}  // namespace

void refuse_second_loop(const std::shared_ptr<lcm::LCM>& bus) {
  constexpr std::chrono::milliseconds kListened{300};  // states come every period
  bool heard = false;
  lcmtypes::MessageHandlers handlers;
  handlers.on_state = [&heard](const state_t& /*message*/) { heard = true; };
  lcmtypes::BusReader reader(bus, handlers);
  const auto end = std::chrono::steady_clock::now() + kListened;
  while (!heard && std::chrono::steady_clock::now() < end) reader.wait(20);
  if (!heard) return;
  throw controller::InputError(
      "--commands",
      "another loop publishes states on this bus, and both would take each "
      "command: end it, or give this one a bus of its own (--lcm-url)");
}

CommandSource::CommandSource(std::shared_ptr<lcm::LCM> bus, const lcmtypes::CommandLimits& limits,
                             LoopGoal& goal)
    : goal_(goal),
      receiver_(std::move(bus), limits, [&goal](Command& command, std::string& reason) {
        return carry_out(command, goal, reason);
      }) {}

bool CommandSource::take() noexcept {
  constexpr std::int32_t kGoals = int{command_t::MODE} + int{command_t::JOINT_POSITION} +
                                  int{command_t::TIP_POSE} + int{command_t::WRENCH};
  taken_ = false;
  if (!receiver_.fetch()) return false;
  const Command& command = receiver_.command();
  // Only new parts: the scenario may have replaced older ones meanwhile.
  const std::int64_t before = std::exchange(commands_, command.accepted);
  for (std::int32_t part = 1; part <= kGoals; part *= 2) {
    taken_ = taken_ || ((kGoals & part) != 0 && lcmtypes::has_set(command, part, before));
  }
  if (taken_) {
    controller::Setpoint setpoint = goal_.setpoint();
    lcmtypes::apply(command, setpoint, before);
    if (lcmtypes::has_set(command, command_t::TIP_POSE, before)) {
      setpoint.tip_pose = controller::carried(setpoint.tip_pose, command.pose_tool, goal_.tool());
    }
    goal_.hold(setpoint);
  }
  return lcmtypes::has_set(command, command_t::RELEASE, before);
}

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

namespace {

std::string latched_text(std::int32_t fault) {
  return controller::to_text(static_cast<controller::Status>(fault));
}

}  // namespace

std::string verdicts_text(std::span<const std::int64_t> verdicts) {
  const std::int64_t accepted = verdicts.empty() ? 0 : verdicts.front();
  const std::int64_t all = std::accumulate(verdicts.begin(), verdicts.end(), std::int64_t{0});
  std::string out =
      std::to_string(accepted) + " accepted, " + std::to_string(all - accepted) + " rejected";
  std::string reasons;
  for (std::size_t i = 1; i < verdicts.size(); ++i) {
    if (verdicts[i] == 0) continue;
    reasons += (reasons.empty() ? "" : ", ") + std::to_string(verdicts[i]) + " " +
               lcmtypes::to_text(static_cast<CommandVerdict>(i));
  }
  return reasons.empty() ? out : out + " (" + reasons + ")";
}

std::string commands_text(const std::optional<CommandReport>& report, std::int64_t refused) {
  if (!report) return "  Commands: not taken (--commands)\n";
  const lcmtypes::CommandTally& tally = report->tally;
  std::string out = "  Commands: " + verdicts_text(tally.verdicts);
  if (refused > 0) {
    out += ", " + std::to_string(refused) + " of those accepted refused by the controller";
  }
  if (tally.last_refusal != CommandVerdict::kAccepted) {
    out += "; last rejected: " + report->last_reason + ", of sender " +
           std::to_string(tally.last_refused_sender);
  }
  return out + "\n";
}

std::string fault_text(const LoopRecord& loop) {
  if (loop.faults == 0) return "";
  std::string out = "  Faults latched: " + std::to_string(loop.faults);
  if (loop.fault != DASHPOT_OK) {
    out += "; not released: " + latched_text(loop.fault) + ", at tick " +
           std::to_string(loop.fault_tick);
  }
  return out + "\n";
}

void refuse_latched_fault(const LoopRecord& loop) {
  if (loop.fault == DASHPOT_OK) return;
  throw std::runtime_error("ended in a fault: " + latched_text(loop.fault) + ", at tick " +
                           std::to_string(loop.fault_tick) + " (docs/safety.md)");
}

Json commands_json(const std::optional<CommandReport>& report, std::int64_t refused) {
  const CommandReport commands = report.value_or(CommandReport());
  const lcmtypes::CommandTally& tally = commands.tally;
  Json verdicts = Json::object(), last_refusal;
  for (std::size_t i = 0; i < tally.verdicts.size(); ++i) {
    if (tally.verdicts[i] == 0) continue;
    verdicts[lcmtypes::to_text(static_cast<CommandVerdict>(i))] = tally.verdicts[i];
  }
  if (tally.last_refusal != CommandVerdict::kAccepted) {
    last_refusal = {{"verdict", lcmtypes::to_text(tally.last_refusal)},
                    {"reason", commands.last_reason},
                    {"sender", tally.last_refused_sender},
                    {"utime", tally.last_refusal_utime}};
  }
  return {{"taken", report.has_value()},  {"accepted", tally.accepted()},
          {"rejected", tally.rejected()}, {"refused", refused},
          {"verdicts", verdicts},         {"last_refusal", last_refusal},
          {"commander", tally.commander}};
}

Json fault_json(const LoopRecord& loop) {
  if (loop.fault == DASHPOT_OK) return nullptr;
  return {{"status", latched_text(loop.fault)}, {"tick", loop.fault_tick}};
}

}  // namespace dashpot::apps
