#include <dashpot/controller/core/faults.hpp>
#include <dashpot/controller/core/thresholds.hpp>

#include <algorithm>
#include <cmath>

namespace dashpot::controller {

void Faults::reset() noexcept {
  motion_watch_.reset();
  release();
  restarts_ = 0;
  blind_ticks_ = 0;
}

Status Faults::watch(Status seen, const Sensed& now, bool still, Brake* brake) noexcept {
  restarts_ = std::max(0.0, restarts_ - now.dt);
  // A motion that was not observed, or whose velocities have another source now, gained no energy.
  const bool brakes =
      brake != nullptr && seen == Status::kOk && now.dt <= settings_.watchdog.longest_gap;
  Status found = worse(seen, motion_watch_.check({now.dt, now.q, now.qd, now.robot,
                                                  now.external_wrench, still, brakes}));
  if (restarts_ > kMostRestarts) found = worse(found, Status::kTooManyRestarts);
  if (brake_fails(found, brake)) found = fault_ = Status::kBrakeDoubted;
  if (latches(found)) {
    latch(found);
    rest_ = 0;
  } else if (fault_ != Status::kOk && rested(now)) {
    release();
  }
  return fault_ == Status::kOk ? Status::kOk : worse(found, Status::kFaultLatched);
}

void Faults::applied(Status status, const Sensed& now, double lost,
                     const JointVector& torque) noexcept {
  const bool blind = status >= Status::kStateNotFinite;
  blind_ticks_ = blind ? blind_ticks_ + 1 : 0;
  if (blind) rest_ = 0;
  if (std::max(lost, this->blind()) > settings_.watchdog.longest_gap) latch(status);
  if (now.any) motion_watch_.applied(torque, now.weight);
}

Faults::Aim Faults::aim() const noexcept {
  const bool means_nothing = motion_watch_.sees_frozen();  // a frozen velocity
  if (means_nothing || fault_ == Status::kBrakeDoubted) return Aim::kFloat;
  // For other faults positions may be wrong, or an obstacle may be in the way.
  const bool returns = fault_ == Status::kPositionLimit || fault_ == Status::kVelocityLimit ||
                       fault_ == Status::kTipSpeedLimit;
  return returns ? Aim::kReturn : Aim::kStop;
}

void Faults::latch(Status fault) noexcept {
  if (fault_ != Status::kOk) return;
  fault_ = fault;
  motion_watch_.forget_swings();  // later ones are caused by the brake
}

bool Faults::rested(const Sensed& now) noexcept {
  const double wanted = settings_.watchdog.release_after;
  if (wanted == 0) return false;
  rest_ = now.dt > settings_.watchdog.longest_gap ? 0 : rest_ + now.dt;
  for (Eigen::Index i = 0; i < now.qd.size(); ++i) {
    if (std::abs(now.qd[i]) > kAtRest * settings_.limits.velocity[i]) rest_ = 0;
  }
  return rest_ >= wanted;
}

bool Faults::brake_fails(Status found, Brake* brake) noexcept {
  if (fault_ == Status::kBrakeDoubted) return true;
  if (brake == nullptr || motion_watch_.sees_frozen()) return false;
  if (found == Status::kBrakeDoubted || brake->feeds()) return true;
  if (fault_ == Status::kOk || found != Status::kInstability) return false;
  motion_watch_.forget_swings();
  const bool softer = brake->soften();  // it shakes the arm: make it as soft as possible
  while (brake->soften()) continue;
  return !softer;
}

}  // namespace dashpot::controller
