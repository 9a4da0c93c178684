#include <dashpot/controller/core/faults.hpp>
#include <dashpot/controller/posture.hpp>
#include <dashpot/controller/posture_loop.hpp>
#include <dashpot/controller/safety/brake.hpp>
#include <dashpot/controller/settings_check.hpp>
#include <dashpot/text/printable.hpp>

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

namespace {

constexpr double kGearMargin = 2;  // of gain: a brake leaves a gear's mode half of its damping
constexpr double kEdge = 0.2;      // times the brake's T: edges of velocity intervals are this hard
constexpr double kLongestBrakeTime = 1e3;  // s: no T is stable
constexpr double kSearched = 1e3;          // times: range of the search for a boundary
constexpr int kBrakePostures = 16;

}  // namespace

double gears_stopping_time(const RobotModel& model, const Settings& settings, double wanted) {
  const SampledArm arm(model, timing_of(settings));
  if (!arm.gears().any()) return 0;
  const PostureSequence postures(settings.limits.position_lower, settings.limits.position_upper);
  const JointVector rest = JointVector::Zero(model.dof());
  DynamicsResult robot;
  double T = kEdge * wanted;
  for (int k = 0; k < kBrakePostures && T <= kLongestBrakeTime; ++k) {
    arm.kernel().evaluate(postures.at(k), rest, robot);
    const analysis::SampledLoop loop = with_gears(arm.at(postures.at(k)));
    for (double margin = 0; margin == 0 && T <= kLongestBrakeTime;) {
      analysis::System<kMaxJoints> system(model.dof());
      system.mass = robot.M;
      system.damping = robot.M * (kGearMargin / T);
      system.damping.diagonal() += arm.friction();
      arm.gears().extend(system);
      margin = margin_up_to(system, loop, 1);
      T = margin > 0 ? T / margin : kSearched * T;
    }
  }
  if (T <= 1.01 * wanted) return T;
  const std::string gears_keys = "(robot.gear_stiffness, gear_damping, position_sensor)";
  throw InvalidSettings(
      "limits.stopping_time",
      "is " + text::number(settings.limits.stopping_time, 3) + " s, but with elastic gears " +
          gears_keys +
          (T > kLongestBrakeTime ? " no brake is stable: their damping is too small"
                                 : " a brake keeps a gain margin of 2 from " + text::number(T, 3) +
                                       " s on: set that"));
}

}  // namespace dashpot::controller
