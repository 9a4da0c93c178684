#include <dashpot/apps/loop/loop_goal.hpp>
#include <dashpot/controller/setpoint_check.hpp>

#include <cstdio>

namespace dashpot::apps {

void LoopGoal::begin(const controller::Setpoint& setpoint,
                     const controller::Attachment& attachment) {
  setpoint_ = accepted_ = setpoint;
  in_force_ = news_ = true;
  tool_ = attachment.tool;
  const std::lock_guard lock(mutex_);
  gains_ = setpoint.gains;
  payload_ = attachment.payload();
  latest_tool_ = attachment.tool;
  begun_ = true;
}

const controller::Setpoint* LoopGoal::told(std::int64_t time) noexcept {
  told_ = false;
  if (!follow_tool()) return nullptr;
  // The controller must read the set-point again for new gains to count.
  const std::int64_t changes = gain_changes_.load(std::memory_order_acquire);
  if (ticks_++ % repeat_every_ == 0 || changes != gain_changes_seen_) news_ = true;
  gain_changes_seen_ = changes;
  controller::Vector6 wrench = setpoint_.wrench;
  if (excitation_) {
    if (!excited_since_) excited_since_ = time;
    wrench += excitation_->wrench(1e-9 * static_cast<double>(time - *excited_since_));
    if (wrench != excited_.wrench) news_ = true;
  }
  if (news_) setpoint_.time = time;
  told_ = in_force_ && !stopped_;
  if (!told_) return nullptr;
  if (!excitation_) return &setpoint_;
  if (news_) excited_ = setpoint_;
  excited_.wrench = wrench;
  return &excited_;
}

bool LoopGoal::follow_tool() noexcept {
  const std::int64_t changes = tool_changes_.load(std::memory_order_acquire);
  if (changes == tool_changes_seen_) return true;
  if (changes % 2 != 0) return false;
  tool_changes_seen_ = changes;
  if (!tools_.fetch()) return false;  // it was refused
  for (controller::Setpoint* held : {&setpoint_, &accepted_}) {
    held->tip_pose = controller::carried(held->tip_pose, tool_, tools_.value());
  }
  tool_ = tools_.value();
  news_ = true;
  return false;  // this tick takes T up unless an earlier one did
}

void LoopGoal::note_status(std::int32_t status) noexcept {
  if (!told_) return;
  // A rejection shows in the status once; then the previous set-point is held again.
  const bool rejected = news_ && status == DASHPOT_SETPOINT_REJECTED;
  if (rejected) setpoint_ = accepted_;
  if (news_ && !rejected) accepted_ = setpoint_;
  news_ = rejected;
}

void LoopGoal::hold(const controller::Setpoint& setpoint) noexcept {
  setpoint_ = setpoint;
  in_force_ = news_ = true;
}

void LoopGoal::note_fault(bool latched) noexcept {
  if (latched) {
    in_force_ = false;
    excitation_.reset();
  }
  if (faulted_ && !latched && !released_.exchange(false, std::memory_order_acquire)) {
    in_force_ = news_ = true;
  }
  faulted_ = latched;
}

std::int32_t LoopGoal::change_gains(const std::function<void(controller::Gains&)>& change,
                                    std::string& reason) {
  return this->change({change, {}, {}, {}}, reason);
}

std::int32_t LoopGoal::change(const Change& change, std::string& reason) {
  const std::lock_guard lock(mutex_);
  if (!begun_) {
    reason = "the loop has not begun";
    return DASHPOT_NOTHING_YET;
  }
  controller::Gains gains = gains_;
  if (change.gains) change.gains(gains);
  const bool news = !controller::same_gains(gains, gains_);
  std::string said;
  std::int32_t code = DASHPOT_OK;
  if (change.tip_speed) code = controller_.limit_tip_speed(*change.tip_speed, said);
  const bool slowed = change.tip_speed && code == DASHPOT_OK;
  if (code == DASHPOT_OK && (change.payload || change.tool)) {
    code = attach(change, news ? &gains : nullptr, said);
  } else if (code == DASHPOT_OK && news) {
    code = controller_.set_gains(gains, said);
  }
  if (code != DASHPOT_OK) {
    reason = said;
    // The previous speed was accepted before, so it is not refused.
    if (slowed) controller_.limit_tip_speed(tip_speed_, said);
    return code;
  }
  if (!said.empty()) std::fprintf(stderr, "warning: %s\n", said.c_str());
  tip_speed_ = change.tip_speed.value_or(tip_speed_);
  gains_ = gains;
  if (news) gain_changes_.fetch_add(1, std::memory_order_release);
  return code;
}

std::int32_t LoopGoal::attach(const Change& change, const controller::Gains* gains,
                              std::string& said) {
  struct UnderWay {
    explicit UnderWay(std::atomic<std::int64_t>& changes) : count(changes) { ++count; }
    ~UnderWay() { ++count; }
    UnderWay(const UnderWay&) = delete;
    UnderWay& operator=(const UnderWay&) = delete;
    std::atomic<std::int64_t>& count;
  };
  const controller::Payload payload = change.payload.value_or(payload_);
  const controller::Pose tool = change.tool.value_or(latest_tool_);
  std::optional<UnderWay> under_way;
  if (change.tool) under_way.emplace(tool_changes_);
  const std::int32_t code = controller_.set_payload(payload, tool, gains, said);
  if (code != DASHPOT_OK) return code;
  if (change.tool) tools_.write(tool);
  payload_ = payload;
  latest_tool_ = tool;
  return code;
}

controller::Pose LoopGoal::latest_tool() {
  const std::lock_guard lock(mutex_);
  return latest_tool_;
}

void LoopGoal::release() {
  const std::lock_guard lock(mutex_);
  if (!begun_) return;
  released_.store(true, std::memory_order_release);  // first, so that no tick takes it for its own
  controller_.release();
}

}  // namespace dashpot::apps
