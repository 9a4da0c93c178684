#include <dashpot/controller/robot_model.hpp>
#include <dashpot/controller/state_check.hpp>

#include <algorithm>
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
    const double own = model.joints()[i].velocity;
    double& limit = velocity_limit_[static_cast<Eigen::Index>(i)];
    if (std::isfinite(own)) limit = std::max(limit, own);
  }
  reset();
}

void StateCheck::reset() noexcept {
  timed_ = false;
  for (Last* last : {&good_, &doubtful_}) {
    last->any = false;
    last->age = 0;
    last->position.setZero(n_);
    last->velocity.setZero(n_);
  }
}

Status StateCheck::check(const RobotState& state) noexcept {
  const double gap = timed_ ? seconds_between(last_time_, state.time) : period_;
  const bool backward = !(gap > 0);
  timed_ = true;
  last_time_ = state.time;
  good_.age += backward ? period_ : gap;
  doubtful_.age = gap;

  Status status = Status::kOk;
  if (state.position.size() != n_ || state.velocity.size() != n_) {
    status = Status::kStateWrongSize;
  } else if (!state.position.allFinite() || !state.velocity.allFinite()) {
    status = Status::kStateNotFinite;
  } else if (good_.any && !follows(good_, state) && !believed(state, gap)) {
    status = Status::kStateJump;
  }
  if (backward) status = worse(status, Status::kTimeBackward);
  if (backward || status != Status::kStateJump) doubtful_.any = false;
  if (status != Status::kOk) return status;

  if (any_continuous_ && good_.any) {
    JointVector position = state.position;
    unwrap(position, good_.position);
    good_.position = position;
  } else {
    good_.position = state.position;
  }
  good_.velocity = state.velocity;
  good_.age = 0;
  good_.any = true;
  return gap > longest_gap_ ? Status::kTimeGap : Status::kOk;
}

bool StateCheck::follows(const Last& last, const RobotState& state) const noexcept {
  JointVector position = state.position;
  if (any_continuous_) unwrap(position, last.position);
  for (Eigen::Index i = 0; i < n_; ++i) {
    const double limit = velocity_limit_[i];
    const double before = last.velocity[i], now = state.velocity[i];
    const double moved = position[i] - last.position[i];
    const double apart = std::abs(moved - 0.5 * (before + now) * last.age);
    const double fastest = std::max(std::abs(before), std::abs(now));
    const bool near = std::abs(moved) <= 2 * last.age * limit + 1e-3;
    const bool as_measured = apart <= 0.5 * fastest * last.age + 1e-3;
    if (!(near || as_measured) || !(std::abs(now - before) <= (0.5 + 10 * last.age) * limit)) {
      return false;
    }
  }
  return true;
}

bool StateCheck::believed(const RobotState& state, double gap) noexcept {
  constexpr double kAgreement = 0.02;  // s
  const bool agrees = doubtful_.any && follows(doubtful_, state);
  agreement_ = agrees ? agreement_ + gap : 0;
  doubtful_.any = true;
  doubtful_.position = state.position;
  doubtful_.velocity = state.velocity;
  return agreement_ > std::max(kAgreement, longest_gap_);
}

void StateCheck::unwrap(JointVector& position, const JointVector& last) const noexcept {
  constexpr double kTurn = 2 * std::numbers::pi;
  for (Eigen::Index i = 0; i < n_; ++i) {
    if (!continuous_[static_cast<std::size_t>(i)]) continue;
    position[i] += kTurn * std::nearbyint((last[i] - position[i]) / kTurn);
  }
}

}  // namespace dashpot::controller
