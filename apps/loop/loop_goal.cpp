#include <dashpot/apps/loop/loop_goal.hpp>
#include <dashpot/controller/setpoint_check.hpp>

#include <cstdio>

namespace dashpot::apps {

void LoopGoal::begin(const controller::Setpoint& setpoint) {
  setpoint_ = accepted_ = setpoint;
  in_force_ = news_ = true;
  const std::lock_guard lock(mutex_);
  gains_ = setpoint.gains;
  begun_ = true;
}

const controller::Setpoint* LoopGoal::told(std::int64_t time) noexcept {
  // New gains count with a set-point that is read again.
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
  told_ = in_force_;
  if (!told_) return nullptr;
  if (!excitation_) return &setpoint_;
  if (news_) excited_ = setpoint_;
  excited_.wrench = wrench;
  return &excited_;
}

void LoopGoal::note_status(std::int32_t status) noexcept {
  // What was rejected shows in the status, once; then what was held before goes on.
  const bool rejected = told_ && news_ && status == DASHPOT_SETPOINT_REJECTED;
  if (rejected) setpoint_ = accepted_;
  if (told_ && news_ && !rejected) accepted_ = setpoint_;
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
  return this->change({change, {}, {}}, reason);
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
  if (code == DASHPOT_OK && change.payload) {
    code = controller_.set_payload(*change.payload, news ? &gains : nullptr, said);
  } else if (code == DASHPOT_OK && news) {
    code = controller_.set_gains(gains, said);
  }
  if (code != DASHPOT_OK) {
    reason = said;
    // Back to the speed that was in force, which therefore is not refused.
    if (slowed) controller_.limit_tip_speed(tip_speed_, said);
    return code;
  }
  if (!said.empty()) std::fprintf(stderr, "warning: %s\n", said.c_str());
  tip_speed_ = change.tip_speed.value_or(tip_speed_);
  gains_ = gains;
  if (news) gain_changes_.fetch_add(1, std::memory_order_release);
  return code;
}

void LoopGoal::release() {
  const std::lock_guard lock(mutex_);
  if (!begun_) return;
  released_.store(true, std::memory_order_release);  // first, so that no tick takes it for its own
  controller_.release();
}

}  // namespace dashpot::apps
