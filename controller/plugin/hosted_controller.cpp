#include <dashpot/controller/plugin/hosted_controller.hpp>
#include <dashpot/controller/plugin/plugin_data.hpp>
#include <dashpot/controller/posture_loop.hpp>

#include <algorithm>

namespace dashpot::controller {
namespace {

/// `time` plus `difference`, ns; past the end of the numbers it goes on from their beginning.
std::int64_t later(std::int64_t time, std::int64_t difference) noexcept {
  return static_cast<std::int64_t>(static_cast<std::uint64_t>(time) +
                                   static_cast<std::uint64_t>(difference));
}

}  // namespace

HostedController::HostedController(const Config& config)
    : joints(config.model.joints()),
      n(config.model.dof()),
      settings(config.settings),
      period(static_cast<std::int64_t>(std::min(1e9 * settings.period, 1e18))),
      model(config.model),
      kernel(config.model),
      judgement(config.model, config.settings),
      controller_(config.model, config.settings),
      setpoint_(settings.initial),
      tool_(config.model.attachment().tool) {
  request.setpoint = settings.initial;
  request.attachment = config.model.attachment();
}

JointVector weight_of(const HostedController& controller, const Attachment& attachment,
                      const JointVector& q) noexcept {
  DynamicsKernel kernel = controller.kernel;
  kernel.attach(attachment);
  DynamicsResult there;
  kernel.evaluate(q, JointVector::Zero(q.size()), there);
  return there.gravity;
}

Status HostedController::at_posture(const JointVector& q, const Gains& gains, Mode mode,
                                    VibrationTask& task, Vibration& found) const {
  PostureLoop loop(model, settings);
  loop.attach(judgement.attached());
  const Status status = loop.closed_loop(q, gains, mode, task.system);
  if (status != Status::kOk) return status;
  task.position = q;
  task.number = 1;
  VibrationSolver(settings.analysis).solve(task, found);
  found.counters = {};
  return Status::kOk;
}

Status HostedController::update(const dashpot_state* given, const dashpot_setpoint* wanted,
                                JointVector& torque) noexcept {
  const RobotState state = to_state(given, n, later(time_, period));
  time_ = state.time;
  const bool accepted = take_up(wanted, time_);
  stopped_ &= !has_setpoint_;
  const bool any = has_setpoint_ || (!stopped_ && stay(time_));
  Status status =
      any ? controller_.update(state, setpoint_, torque) : controller_.update(state, torque);
  located_ |= status < Status::kStateNotFinite;
  const bool latched = controller_.snapshot().fault != Status::kOk;
  if (latched_ && !latched) forget_setpoint();  // released after a rest
  latched_ = latched;
  if (status < Status::kStateNotFinite) judgement.locate(controller_.snapshot().position);
  if (!accepted) status = worse(status, Status::kSetpointRejected);
  snapshots.slot() = controller_.snapshot();
  snapshots.slot().status = status;
  snapshots.publish();
  const Vibration& found = controller_.vibration();
  if (found.tick != published_modes_ || found.status != published_status_) {
    published_modes_ = found.tick;
    published_status_ = found.status;
    vibrations.write(controller_.vibration());
  }
  return status;
}

void HostedController::reset(const JointVector& torque) noexcept {
  take_up(nullptr, time_);  // gains and attachment in it stay
  controller_.reset(torque);
  forget_setpoint();
  forgotten_ = latched_ = stopped_ = located_ = false;
  published_modes_ = 0;
  vibrations.write(controller_.vibration());  // empty
  snapshots.write(controller_.snapshot());    // of tick 0
}

void HostedController::stop() noexcept {
  take_up(nullptr, time_);
  controller_.stop();
  forget_setpoint();
  stopped_ = true;
}

void HostedController::forget_setpoint() noexcept {
  forgotten_ = (has_setpoint_ || forgotten_) && given_time_ != DASHPOT_ON_ARRIVAL;
  const Gains gains = setpoint_.gains;
  setpoint_ = settings.initial;
  setpoint_.gains = gains;
  has_setpoint_ = false;
}

void HostedController::take_up_tip(const Request& latest) noexcept {
  if (latest.attachments != attachments_) {
    controller_.attach(latest.attachment);
    setpoint_.tip_pose = carried(setpoint_.tip_pose, tool_, latest.attachment.tool);
    tool_ = latest.attachment.tool;
  }
  if (latest.tip_speeds != tip_speeds_) controller_.limit_tip_speed(latest.tip_speed);
  attachments_ = latest.attachments;
  tip_speeds_ = latest.tip_speeds;
}

bool HostedController::take_up(const dashpot_setpoint* wanted, std::int64_t now) noexcept {
  const std::int64_t last = setpoint_.time;
  const Pose tool = tool_;  // for the caller's set-point, which refers to the T of an earlier tick
  bool accepted = true;
  if (requests.fetch()) {
    const Request& latest = requests.value();
    take_up_tip(latest);
    if (latest.releases != releases_ && controller_.snapshot().fault != Status::kOk) {
      controller_.release();
      forget_setpoint();
      latched_ = false;
    }
    releases_ = latest.releases;
    if (latest.setpoints != setpoints_) {
      setpoint_ = latest.setpoint;
      if (latest.on_arrival) setpoint_.time = now;
      has_setpoint_ = true;
    } else if (latest.gain_changes != gain_changes_) {
      setpoint_.gains = latest.setpoint.gains;
    }
    setpoints_ = latest.setpoints;
    gain_changes_ = latest.gain_changes;
    if (setpoint_.time == last)
      setpoint_.time = later(last, 1);  // with an equal time it would be ignored
  }
  const bool old = wanted != nullptr && forgotten_ && wanted->struct_size == sizeof *wanted &&
                   wanted->time == given_time_;
  if (wanted != nullptr && !old) {
    accepted = to_setpoint(wanted, n, now, setpoint_) == DASHPOT_OK;
    if (accepted && !has_setpoint_ && setpoint_.time == last) setpoint_.time = later(last, 1);
    if (accepted) setpoint_.tip_pose = carried(setpoint_.tip_pose, tool, tool_);
    has_setpoint_ |= accepted;
    if (accepted) {
      given_time_ = wanted->time;
      forgotten_ = false;
    }
  }
  return accepted;
}

bool HostedController::stay(std::int64_t now) noexcept {
  if (!located_) return false;
  const Snapshot& snapshot = controller_.snapshot();
  setpoint_.time = now;
  setpoint_.mode = settings.initial.mode;
  if (setpoint_.mode == Mode::kCartesian) {
    setpoint_.joint_position.resize(0);
    setpoint_.tip_pose = carried(snapshot.reference_tip, snapshot.tool, tool_);
  } else {
    setpoint_.joint_position = snapshot.reference_position;
  }
  return !check_setpoint(setpoint_, settings.limits, true);
}

}  // namespace dashpot::controller
