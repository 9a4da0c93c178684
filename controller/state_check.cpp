#include <dashpot/controller/robot_model.hpp>
#include <dashpot/controller/state_check.hpp>

#include <cmath>
#include <numbers>

namespace dashpot::controller {

StateCheck::StateCheck(const RobotModel& model, const Settings& settings)
    : n_(model.dof()),
      period_(settings.period),
      longest_gap_(settings.watchdog.longest_gap),
      velocity_limit_(settings.limits.velocity) {
  for (std::size_t i = 0; i < model.joints().size(); ++i) {
    continuous_[i] = model.joints()[i].type == JointType::kContinuous;
    any_continuous_ |= continuous_[i];
  }
  reset();
}

void StateCheck::reset() noexcept {
  timed_ = false;
  started_ = false;
  age_ = 0;
  position_.setZero(n_);
  velocity_.setZero(n_);
}

Status StateCheck::check(const RobotState& state) noexcept {
  const double gap = timed_ ? seconds_between(last_time_, state.time) : period_;
  const bool backward = !(gap > 0);
  timed_ = true;
  last_time_ = state.time;
  age_ += backward ? period_ : gap;

  Status status = Status::kOk;
  if (state.position.size() != n_ || state.velocity.size() != n_) {
    status = Status::kStateWrongSize;
  } else if (!state.position.allFinite() || !state.velocity.allFinite()) {
    status = Status::kStateNotFinite;
  } else if (jumped(state)) {
    status = Status::kStateJump;
  }
  if (backward) status = worse(status, Status::kTimeBackward);
  if (status != Status::kOk) return status;

  position_ = state.position;
  if (any_continuous_ && started_) unwrap(position_);
  velocity_ = state.velocity;
  age_ = 0;
  started_ = true;
  return gap > longest_gap_ ? Status::kTimeGap : Status::kOk;
}

bool StateCheck::jumped(const RobotState& state) noexcept {
  if (!started_) return false;
  JointVector position = state.position;
  if (any_continuous_) unwrap(position);
  const double distance_factor = 2 * age_;
  const double velocity_factor = 0.5 + 10 * age_;
  for (Eigen::Index i = 0; i < n_; ++i) {
    const double limit = velocity_limit_[i];
    if (!(std::abs(position[i] - position_[i]) <= distance_factor * limit + 1e-3) ||
        !(std::abs(state.velocity[i] - velocity_[i]) <= velocity_factor * limit)) {
      return true;
    }
  }
  return false;
}

void StateCheck::unwrap(JointVector& position) const noexcept {
  constexpr double kTurn = 2 * std::numbers::pi;
  for (Eigen::Index i = 0; i < n_; ++i) {
    if (!continuous_[static_cast<std::size_t>(i)]) continue;
    position[i] += kTurn * std::nearbyint((position_[i] - position[i]) / kTurn);
  }
}

}  // namespace dashpot::controller
