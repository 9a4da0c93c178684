#include <dashpot/controller/safety/state_check.hpp>

#include <algorithm>
#include <cmath>
#include <numbers>

namespace dashpot::controller {
namespace {

constexpr double kFarthest = 1e6;  // rad (m): beyond any joint; turns would be lost in rounding
// For follows():
constexpr double kFaster = 2;         // times a velocity limit: a robot may exceed it a little
constexpr double kResolution = 1e-3;  // rad (m): coarse encoders
constexpr double kApart = 0.5;        // of the larger velocity: explained by a blow within a tick
constexpr double kJolt = 0.5;         // of a velocity limit, at once: noise, and hard drives
constexpr double kJoltRate = 10;      // of a velocity limit in a second
constexpr double kBlow = 3;           // a third of a velocity change has to show in the position

// For wrong_rate(): long enough for the jitter of a loop that is not in real time.
constexpr int kIntervals = 50;
constexpr double kFastest = -1.0 / 3, kSlowest = 0.5;  // mean interval / period - 1
// For contradictory(): in half a second a joint at a hundredth of its usual speed moves further
// than the tolerance, and no filter of velocities lags behind for so long.
constexpr double kUnexplained = 0.3;       // of the travelled distance
constexpr double kAngleTolerance = 0.02;   // rad
constexpr double kSlideTolerance = 0.005;  // m

/// Returns the multiple of 2 pi that is nearest to `angle`.
double whole_turns(double angle) noexcept {
  constexpr double kTurn = 2 * std::numbers::pi;
  return kTurn * std::nearbyint(angle / kTurn);
}

}  // namespace

StateCheck::StateCheck(const RobotModel& model, const Settings& settings)
    : n_(model.dof()),
      period_(settings.period),
      longest_gap_(settings.watchdog.longest_gap),
      memory_(settings.watchdog.feedback),
      velocity_limit_(settings.limits.velocity),
      tolerance_(JointVector::Constant(n_, kAngleTolerance)) {
  for (std::size_t i = 0; i < model.joints().size(); ++i) {
    continuous_[i] = model.joints()[i].type == JointType::kContinuous;
    any_continuous_ |= continuous_[i];
    if (model.joints()[i].type == JointType::kPrismatic) {
      tolerance_[static_cast<Eigen::Index>(i)] = kSlideTolerance;
    }
    const double own = model.joints()[i].velocity;
    double& limit = velocity_limit_[static_cast<Eigen::Index>(i)];
    if (std::isfinite(own)) limit = std::max(limit, own);
  }
  reset();
}

void StateCheck::reset() noexcept {
  timed_ = false;
  backward_ = ahead_ = 0;
  good_ = doubtful_ = {false, 0, JointVector::Zero(n_), JointVector::Zero(n_)};
  velocity_.setZero(n_);
  blind_ = false;
  intervals_ = 0;
  excess_ = 0;
  forget_motion();
}

void StateCheck::forget_motion() noexcept {
  unexplained_.setZero(n_);
  travelled_.setZero(n_);
}

double StateCheck::counted(double gap) noexcept {
  constexpr double kLeast = 0.1;  // of a period: jitter outside real time is smaller
  const bool says_nothing = gap < kLeast * period_;
  const double left = gap - (says_nothing ? 0 : ahead_);
  ahead_ = says_nothing ? ahead_ + period_ : 0;
  ahead_ = std::min(ahead_, longest_gap_);
  return left < kLeast * period_ ? period_ : left;
}

Status StateCheck::check(const RobotState& state) noexcept {
  const double gap = timed_ ? seconds_between(last_time_, state.time) : period_;
  const bool backward = !(gap > 0);
  timed_ = true;
  last_time_ = state.time;
  backward_ = backward ? backward_ + period_ : 0;
  const double passed = counted(gap);
  good_.age += passed;
  age_ = 1e-9 * std::round(1e9 * good_.age);  // so that gaps add up exactly
  doubtful_.age = passed;

  Status status = Status::kOk;
  bool relocated = false;
  if (state.position.size() != n_ || state.velocity.size() != n_) {
    status = Status::kStateWrongSize;
  } else if (!state.position.allFinite() || !state.velocity.allFinite()) {
    status = Status::kStateNotFinite;
  } else if (good_.any && !follows(good_, state)) {
    relocated = believed(state, passed);
    if (!relocated) status = Status::kStateJump;
  }
  if (status != Status::kStateJump) doubtful_.any = false;
  if (status != Status::kOk) return status;

  const bool unwraps = any_continuous_ && good_.any;
  JointVector unwrapped;
  if (unwraps) {
    unwrapped = state.position;
    for (Eigen::Index i = 0; i < n_; ++i) {
      if (!continuous_[static_cast<std::size_t>(i)]) continue;
      unwrapped[i] += whole_turns(good_.position[i] - unwrapped[i]);
    }
  }
  const JointVector& position = unwraps ? unwrapped : state.position;
  if (good_.any && (relocated || good_.age > longest_gap_)) {
    if (blind_) velocity_.setZero();  // the speed of a jump has no meaning
    forget_motion();
    intervals_ = 0;
    if (gap > longest_gap_) status = Status::kTimeGap;
  } else if (good_.any) {
    status = compare(position, state.velocity, gap);
  }
  good_.position = position;
  good_.velocity = state.velocity;
  good_.age = 0;
  good_.any = true;
  return backward ? worse(status, Status::kTimeBackward) : status;
}

Status StateCheck::compare(const JointVector& position, const JointVector& velocity,
                           double gap) noexcept {
  const bool contradicts = contradictory(position, velocity);
  // The smoothed velocity begins with the change of position, so that it does not pass through zero
  // if the velocity has the wrong sign.
  if (contradicts && !blind_) velocity_ = (position - good_.position) / good_.age;
  blind_ |= contradicts;
  const bool wrong = !contradicts && wrong_rate(gap);
  if (blind_) velocity_ += ((position - good_.position) / good_.age - velocity_) / 3;
  if (contradicts) return Status::kStateContradictory;
  return wrong ? Status::kWrongRate : Status::kOk;
}

bool StateCheck::wrong_rate(double gap) noexcept {
  const double excess = std::max(gap, 0.0) / period_ - 1;
  if (intervals_ < kIntervals) ++intervals_;
  excess_ += (excess - excess_) / intervals_;
  return intervals_ == kIntervals && (excess_ < kFastest || excess_ > kSlowest);
}

bool StateCheck::contradictory(const JointVector& position, const JointVector& velocity) noexcept {
  if (memory_ == 0) return false;
  const double keep = std::max(0.0, 1 - good_.age / memory_);
  bool found = false;
  for (Eigen::Index i = 0; i < n_; ++i) {
    const double moved = position[i] - good_.position[i];
    const double said = 0.5 * (good_.velocity[i] + velocity[i]) * good_.age;
    unexplained_[i] = keep * unexplained_[i] + moved - said;
    travelled_[i] = keep * travelled_[i] + std::max(std::abs(moved), std::abs(said));
    found |= std::abs(unexplained_[i]) > tolerance_[i] + kUnexplained * travelled_[i];
  }
  return found;
}

bool StateCheck::follows(const Last& last, const RobotState& state) const noexcept {
  for (Eigen::Index i = 0; i < n_; ++i) {
    const double limit = velocity_limit_[i];
    const double before = last.velocity[i], now = state.velocity[i];
    double position = state.position[i];  // as in `check`
    if (std::abs(position) > kFarthest) return false;
    if (any_continuous_ && continuous_[static_cast<std::size_t>(i)]) {
      position += whole_turns(last.position[i] - position);
    }
    const double moved = position - last.position[i];
    const double apart = std::abs(moved - 0.5 * (before + now) * last.age);
    const double fastest = std::max(std::abs(before), std::abs(now));
    const bool near = std::abs(moved) <= kFaster * last.age * limit + kResolution;
    const bool as_measured = apart <= kApart * fastest * last.age + kResolution;
    const double change = now - before;
    const bool smooth = std::abs(change) <= (kJolt + kJoltRate * last.age) * limit;
    const double beyond = (moved - before * last.age) * std::copysign(1, change);
    const bool blow = kBlow * beyond >= std::abs(change) * last.age;  // the position moved with it
    if (blind_ ? !near : !(near || as_measured) || !(smooth || (as_measured && blow))) return false;
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

}  // namespace dashpot::controller
