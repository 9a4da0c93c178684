#include <dashpot/apps/loop/simulated_loop.hpp>
#include <dashpot/controller/attachment.hpp>
#include <dashpot/controller/tick_status.hpp>

#include <algorithm>
#include <cmath>
#include <cstdio>

namespace dashpot::apps {
namespace {

constexpr double kRepeat = 0.1;       // s between two repetitions of a set-point
constexpr double kSettling = 0.1;     // s, beyond the time in which the springs set in
constexpr double kGuidedSpeed = 0.2;  // at most this fraction of the velocity limits
constexpr double kShortestWay = 0.5;  // s
constexpr double kNanoseconds = 1e9;  // in a second

/// Smooth from 0 at 0 to 1 at 1, at rest at both ends; and its slope.
std::pair<double, double> ease(double s) {
  return {s * s * s * (10 + s * (-15 + 6 * s)), 30 * s * s * (1 - s) * (1 - s)};
}

/// The time that the hand takes from rest to start, s.
double guidance_time(const Scene& scene) {
  const JointVector way = (scene.start - scene.rest).cwiseAbs();
  if (way.isZero(0)) return 0;
  const JointVector speed = kGuidedSpeed * scene.arm->config.settings.limits.velocity;
  return std::max(kShortestWay, 1.875 * way.cwiseQuotient(speed).maxCoeff());
}

/// Ticks between two repetitions of a set-point.
std::int64_t repetition(const Scene& scene) {
  return std::max<std::int64_t>(1, std::llround(kRepeat / scene.plant.period));
}

}  // namespace

ClosedLoop::ClosedLoop(const Scene& scene, LoopController& controller)
    : scene_(scene),
      controller_(controller),
      arm_(scene.arm->robot, scene.arm->options),
      goal_(controller, repetition(scene)) {
  torque_ = JointVector::Zero(scene.dof());
  sim::PlantOptions options = scene.plant;
  begin();
  const bool outside = scene.outside_limits;
  guide(outside ? scene.start : scene.rest, scene.start, outside ? 0 : guidance_time(scene),
        scene.arm->config.settings.motion.gain_time + kSettling);
  options.initial_torque = torque_;
  plant_.emplace(arm_, options, scene.start, scene.velocity);
}

void ClosedLoop::begin() {
  const controller::Setpoint& first = scene_.steps.front().setpoint;
  std::string reason;
  const JointVector& rest = scene_.outside_limits ? scene_.start : scene_.rest;
  bool starts = controller_.start(rest, reason) == DASHPOT_OK;
  if (starts && !reason.empty()) std::fprintf(stderr, "warning: %s\n", reason.c_str());
  starts = starts && controller_.set_gains(first.gains, reason) == DASHPOT_OK;
  if (!starts) throw InputError("scenario.start", "the controller refuses it: " + reason);
  goal_.begin(first, scene_.arm->config.model.attachment());
}

void ClosedLoop::guide(const JointVector& from, const JointVector& to, double duration,
                       double settling) {
  const double period = scene_.plant.period;
  const auto count = [period](double seconds) {
    return static_cast<std::int64_t>(std::ceil(seconds / period));
  };
  const std::int64_t before = count(settling), way = count(duration);
  const std::int64_t ticks = before + way + (way > 0 ? before : 0);
  for (std::int64_t i = 0; i < ticks; ++i) {
    const double s =
        way == 0 ? 0
                 : std::clamp(static_cast<double>(i - before) / static_cast<double>(way), 0.0, 1.0);
    const auto [place, slope] = ease(s);
    const JointVector q = from + place * (to - from);
    const JointVector qd =
        way == 0 ? JointVector(0 * from)
                 : JointVector((slope / (static_cast<double>(way) * period)) * (to - from));
    const std::int64_t time = std::llround(kNanoseconds * period * static_cast<double>(i - ticks));
    const std::int32_t status = controller_.update(time, q, qd, goal_.told(time), torque_);
    goal_.note_status(status);
    if (status >= DASHPOT_SETPOINT_REJECTED && !scene_.outside_limits) {
      throw InputError("scenario.start",
                       std::string("the controller refuses it: ") +
                           controller::to_text(static_cast<controller::Status>(status)))
          .in_file(scene_.path);
    }
  }
}

const LoopFault* ClosedLoop::loop_fault() const noexcept {
  const double now = plant_->time() + 1e-6 * scene_.plant.period;
  for (const LoopFault& fault : scene_.loop_faults) {
    if (fault.begin <= now && now < fault.end) return &fault;
  }
  return nullptr;
}

std::int32_t ClosedLoop::control() noexcept {
  const LoopFault* const fault = loop_fault();
  const std::int64_t tick = ticks_++;
  if (fault != nullptr && (fault->every == 0 || tick % fault->every != 0)) return status_;
  const sim::Measurement& measured = plant_->measured();
  status_ = controller_.update(measured.time, measured.position, measured.velocity,
                               goal_.told(measured.time), torque_);
  goal_.note_status(status_);
  if (status_ < 0) torque_.setZero();  // a refused call leaves the robot to its host
  return status_;
}

sim::Status ClosedLoop::move() noexcept {
  const LoopFault* const fault = loop_fault();
  if (fault != nullptr && fault->moved_by.size() > 0) {
    carry(*fault);
    return sim::Status::kOk;
  }
  const sim::Status status = plant_->step(torque_);
  extremes_.kinetic_energy = std::max(extremes_.kinetic_energy, plant_->audit().stored.kinetic);
  if (const auto force = contact_force()) {
    extremes_.contact_force = std::max(extremes_.contact_force, force->norm());
  }
  const JointVector velocity = plant_->velocity();
  const JointVector& limit = scene_.arm->config.settings.limits.velocity;
  extremes_.speed_share =
      std::max(extremes_.speed_share, velocity.cwiseAbs().cwiseQuotient(limit).maxCoeff());
  extremes_.tip_speed =
      std::max(extremes_.tip_speed, arm_.tip_twist(plant_->position(), velocity).head<3>().norm());
  return status;
}

std::optional<Eigen::Vector3d> ClosedLoop::contact_force() noexcept {
  if (!scene_.arm->options.wall) return std::nullopt;
  return arm_.wall_force(plant_->state());
}

/// One period of a motion by hand, which begins and ends at rest.
void ClosedLoop::carry(const LoopFault& fault) noexcept {
  if (hand_ != &fault) taken_at_ = plant_->position();
  hand_ = &fault;
  const double duration = fault.end - fault.begin;
  const double s =
      std::clamp((plant_->time() + scene_.plant.period - fault.begin) / duration, 0.0, 1.0);
  const auto [place, slope] = ease(s);
  plant_->carry(taken_at_ + place * fault.moved_by, slope / duration * fault.moved_by);
}

void ClosedLoop::follow_scenario() noexcept {
  const auto& steps = scene_.steps;
  while (next_step_ < steps.size() && steps[next_step_].at <= plant_->time()) {
    controller::Setpoint setpoint = steps[next_step_++].setpoint;
    setpoint.tip_pose = controller::carried(
        setpoint.tip_pose, scene_.arm->config.model.attachment().tool, goal_.tool());
    goal_.hold(setpoint);
    due_steps_.store(next_step_, std::memory_order_release);
  }
  if (!leave_gains_) follow_gains();
}

void ClosedLoop::follow_gains() {
  const std::size_t due = due_steps_.load(std::memory_order_acquire);
  if (due == followed_steps_) return;
  const controller::Gains& wanted = scene_.steps[due - 1].setpoint.gains;
  LoopGoal::Change change{[&wanted](controller::Gains& gains) { gains = wanted; }, {}, {}, {}};
  for (; followed_steps_ < due; ++followed_steps_) {
    const auto& payload = scene_.steps[followed_steps_].payload;
    if (payload) change.payload = payload;
  }
  if (goal_.change(change, refusal_) != DASHPOT_OK) ++refused_steps_;
}

}  // namespace dashpot::apps
