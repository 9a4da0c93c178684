#include <dashpot/controller/dynamics.hpp>
#include <dashpot/controller/input_error.hpp>
#include <dashpot/controller/plugin/hosted_controller.hpp>
#include <dashpot/controller/plugin/plugin_data.hpp>
#include <dashpot/controller/posture.hpp>
#include <dashpot/controller/setpoint_check.hpp>
#include <dashpot/controller/settings_check.hpp>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdio>
#include <cstring>
#include <exception>
#include <memory>
#include <string>

using namespace dashpot::controller;  // NOLINT(google-build-using-namespace): the C functions

namespace {

// In storage of fixed size: nothing to allocate, nothing to destroy when a thread ends.
thread_local std::array<char, 2048> last_error{};

std::int32_t refuse(const SetpointFault& fault) noexcept {
  std::array<char, 128> text{};
  std::snprintf(text.data(), text.size(), "%s %s", fault.key, fault.reason);
  return finish(DASHPOT_WRONG_VALUE, text.data());
}

}  // namespace

namespace dashpot::controller {

std::int32_t finish(std::int32_t code, const char* text) noexcept {
  std::snprintf(last_error.data(), last_error.size(), "%s", code == DASHPOT_OK ? "" : text);
  return code;
}

std::int32_t finish(std::int32_t code) noexcept {
  return finish(code, dashpot_status_text(code));
}

std::int32_t warn(const char* text) noexcept {
  const std::size_t length = std::strlen(last_error.data());
  std::snprintf(last_error.data() + length, last_error.size() - length, "%s%s",
                length == 0 ? "" : "; ", text);
  return DASHPOT_OK;
}

void warn_of_gains(const HostedController& controller, const Gains& gains) noexcept {
  try {
    for (const std::string& doubt : doubtful_gains(controller.model, gains)) warn(doubt.c_str());
  } catch (...) {  // out of memory
    return;
  }
}

VerdictText describe(Judgement& judgement, const GainJudge::Verdict& verdict, const Gains& gains,
                     bool here, const char* became) noexcept {
  VerdictText text{};
  const char* const mode = verdict.mode == Mode::kJoint ? "joint" : "task";
  const char* const where = here ? "here" : "at best, wherever the robot is";
  if (verdict.dropped) {
    std::snprintf(
        text.data(), text.size(),
        "with the %s gains, whose damping counts with the payload, the sampled loop has a "
        "gain margin of %.3g %s once the payload is dropped; %.3g is needed: choose less "
        "stiffness or a smaller ratio",
        mode, verdict.margin, where, std::min(GainJudge::kDropped, judgement.wanted()));
  } else {
    std::snprintf(text.data(), text.size(),
                  "with the %s gains the sampled loop has a gain margin of %.3g %s, "
                  "limits.gain_margin asks for %.3g",
                  mode, verdict.margin, where, judgement.wanted());
  }
  try {
    const std::string missing = judgement.missing(verdict, gains);
    const std::size_t length = std::strlen(text.data());
    std::snprintf(text.data() + length, text.size() - length, "%s%s%s", became,
                  missing.empty() ? "" : ": ", missing.c_str());
  } catch (...) {  // the verdict alone has to do
  }
  return text;
}

std::int32_t read_gains(const dashpot_gains* given, int n, Gains& wanted) noexcept {
  const std::int32_t problem = to_gains(given, n, wanted);
  if (problem != DASHPOT_OK) return finish(problem);
  for (const Mode mode : {Mode::kJoint, Mode::kCartesian}) {
    const SetpointFault fault = check_gains(wanted, mode, n);
    if (fault) return refuse(fault);
  }
  return DASHPOT_OK;
}

}  // namespace dashpot::controller

namespace {

/// Judges gains at q, or at any posture if `q` has no entries. Returns DASHPOT_OK or why not.
std::int32_t judge(dashpot_controller& controller, const Gains& gains, const JointVector& q,
                   double* margin) noexcept {
  Judgement& judgement = controller.judgement;
  GainJudge::Verdict verdict{0, Mode::kJoint};
  try {
    verdict = judgement.judge(gains, q);
  } catch (...) {
    return finish(DASHPOT_UNSTABLE_GAINS, "the gains could not be judged");
  }
  if (margin != nullptr) *margin = verdict.margin;
  if (judgement.enough(verdict)) return finish(DASHPOT_OK);
  return finish(DASHPOT_UNSTABLE_GAINS, describe(judgement, verdict, gains, q.size() != 0).data());
}

/// Returns the controller that `make` makes; null, with the error set, if it throws.
template <class Make>
dashpot_controller* make_controller(const Make& make) noexcept try {
  dashpot_controller* const controller = make();
  finish(DASHPOT_OK);
  return controller;
} catch (const std::exception& error) {
  finish(DASHPOT_WRONG_VALUE, error.what());
  return nullptr;
} catch (...) {
  finish(DASHPOT_WRONG_VALUE, "unknown failure");
  return nullptr;
}

/// Reads `position`, if it is n finite numbers.
std::int32_t read_joints(const dashpot_controller* controller, const double* given,
                         JointVector& values) noexcept {
  if (controller == nullptr || given == nullptr) return finish(DASHPOT_NULL_ARGUMENT);
  values = Eigen::Map<const Eigen::VectorXd>(given, controller->n);
  return values.allFinite() ? DASHPOT_OK : finish(DASHPOT_WRONG_VALUE);
}

/// Returns DASHPOT_OK if the arm can be at q, and otherwise why not.
std::int32_t check_place(const dashpot_controller& controller, const JointVector& q) noexcept {
  constexpr double kOutside = 0.1;  // rad (m), as at the start
  if (!q.allFinite()) return finish(DASHPOT_WRONG_VALUE);
  try {
    const std::string outside = outside_limits(controller.model, q, kOutside);
    return outside.empty() ? DASHPOT_OK : finish(DASHPOT_WRONG_VALUE, outside.c_str());
  } catch (...) {
    return finish(DASHPOT_WRONG_VALUE, "unknown failure");
  }
}

template <class Struct>
std::int32_t check_result(const dashpot_controller* controller, const Struct* result) noexcept {
  if (controller == nullptr || result == nullptr) return DASHPOT_NULL_ARGUMENT;
  return result->struct_size == sizeof(Struct) ? DASHPOT_OK : DASHPOT_WRONG_STRUCT_SIZE;
}

}  // namespace

dashpot_controller* dashpot::controller::create_controller(const Config& config) {
  auto controller = std::make_unique<dashpot_controller>(config);
  const std::int32_t code =
      judge(*controller, controller->request.setpoint.gains, JointVector(), nullptr);
  if (code != DASHPOT_OK) throw InputError("gains", dashpot_last_error());
  return controller.release();
}

extern "C" {

dashpot_controller* dashpot_create(const char* config_path) {
  if (config_path == nullptr) {
    finish(DASHPOT_NULL_ARGUMENT);
    return nullptr;
  }
  return make_controller([&] {
    try {
      return create_controller(load_config(config_path));
    } catch (const InputError& error) {
      throw error.in_file(config_path);
    }
  });
}

dashpot_controller* dashpot_create_from_text(const char* text, const char* directory) {
  if (text == nullptr) {
    finish(DASHPOT_NULL_ARGUMENT);
    return nullptr;
  }
  return make_controller([&] {
    return create_controller(
        read_config(dashpot::text::parse_yaml(text), directory == nullptr ? "" : directory));
  });
}

void dashpot_destroy(dashpot_controller* controller) {
  delete controller;
}

const char* dashpot_last_error() {
  return last_error.data();
}

uint32_t dashpot_joints(const dashpot_controller* controller) {
  return controller == nullptr ? 0 : static_cast<std::uint32_t>(controller->n);
}

const char* dashpot_joint_name(const dashpot_controller* controller, uint32_t joint) {
  return joint < dashpot_joints(controller) ? controller->joints[joint].name.c_str() : nullptr;
}

double dashpot_period(const dashpot_controller* controller) {
  return controller == nullptr ? 0 : controller->settings.period;
}

int32_t dashpot_update(dashpot_controller* controller, const dashpot_state* state,
                       const dashpot_setpoint* setpoint, dashpot_output* output) {
  const std::int32_t problem = check_result(controller, output);
  if (problem != DASHPOT_OK) return problem;
  if (output->torque == nullptr) return DASHPOT_NULL_ARGUMENT;
  if (output->joints != dashpot_joints(controller)) return DASHPOT_WRONG_JOINTS;
  JointVector torque;
  const Status status = controller->update(state, setpoint, torque);
  Eigen::Map<Eigen::VectorXd>(output->torque, controller->n) = torque;
  return static_cast<std::int32_t>(status);
}

int32_t dashpot_start(dashpot_controller* controller, const double* position,
                      const double* torque) {
  if (controller == nullptr || position == nullptr) return finish(DASHPOT_NULL_ARGUMENT);
  const JointVector q = Eigen::Map<const Eigen::VectorXd>(position, controller->n);
  JointVector acting;
  if (torque != nullptr) acting = Eigen::Map<const Eigen::VectorXd>(torque, controller->n);
  if (!q.allFinite() || !acting.allFinite()) return finish(DASHPOT_WRONG_VALUE);
  const bool holds = controller->settings.feed_forward.gravity;
  const JointVector held = holds ? weight_of(*controller, controller->request.attachment, q)
                                 : JointVector(JointVector::Zero(controller->n));
  std::string slow;
  try {
    const std::string fault = start_fault(controller->model, controller->settings, q,
                                          holds ? acting : JointVector(), held);
    if (!fault.empty()) return finish(DASHPOT_WRONG_VALUE, fault.c_str());
    slow = slow_stop(controller->model, controller->settings, q);
  } catch (const std::exception& error) {
    return finish(DASHPOT_WRONG_VALUE, error.what());
  }
  const std::int32_t code = judge(*controller, controller->request.setpoint.gains, q, nullptr);
  if (code != DASHPOT_OK) return code;
  controller->judgement.locate(q);
  controller->reset(torque != nullptr ? acting : held);
  warn_of_gains(*controller, controller->request.setpoint.gains);
  return slow.empty() ? DASHPOT_OK : warn(slow.c_str());
}

int32_t dashpot_release(dashpot_controller* controller) {
  if (controller == nullptr) return finish(DASHPOT_NULL_ARGUMENT);
  ++controller->request.releases;
  controller->requests.write(controller->request);
  return finish(DASHPOT_OK);
}

int32_t dashpot_reset(dashpot_controller* controller, const double* torque) {
  if (controller == nullptr) return DASHPOT_NULL_ARGUMENT;
  JointVector acting;
  for (int i = 0; torque != nullptr && i < controller->n; ++i) {
    if (!std::isfinite(torque[i])) return DASHPOT_WRONG_VALUE;
  }
  if (torque != nullptr) acting = Eigen::Map<const Eigen::VectorXd>(torque, controller->n);
  controller->reset(acting);
  return DASHPOT_OK;
}

int32_t dashpot_stop(dashpot_controller* controller) {
  if (controller == nullptr) return DASHPOT_NULL_ARGUMENT;
  controller->stop();
  return DASHPOT_OK;
}

int32_t dashpot_set_setpoint(dashpot_controller* controller, const dashpot_setpoint* setpoint) {
  if (controller == nullptr) return finish(DASHPOT_NULL_ARGUMENT);
  Request& request = controller->request;
  Setpoint wanted = request.setpoint;
  const std::int32_t problem = to_setpoint(setpoint, controller->n, 0, wanted);
  if (problem != DASHPOT_OK) return finish(problem);
  const SetpointFault fault = check_setpoint(wanted, controller->settings.limits, true);
  if (fault) return refuse(fault);
  request.setpoint = wanted;
  request.on_arrival = setpoint->time == DASHPOT_ON_ARRIVAL;
  ++request.setpoints;
  controller->requests.write(request);
  return finish(DASHPOT_OK);
}

int32_t dashpot_judge_gains(dashpot_controller* controller, const dashpot_gains* gains,
                            const double* position, double* margin) {
  if (controller == nullptr) return finish(DASHPOT_NULL_ARGUMENT);
  Gains wanted = controller->settings.initial.gains;
  const std::int32_t problem = read_gains(gains, controller->n, wanted);
  if (problem != DASHPOT_OK) return problem;
  JointVector q;
  if (position != nullptr) {
    q = Eigen::Map<const Eigen::VectorXd>(position, controller->n);
  } else if (!controller->judgement.where(q)) {
    return finish(DASHPOT_NOTHING_YET);
  }
  const std::int32_t place = position == nullptr ? DASHPOT_OK : check_place(*controller, q);
  return place != DASHPOT_OK ? place : judge(*controller, wanted, q, margin);
}

int32_t dashpot_evaluate(const dashpot_controller* controller, const double* position,
                         const double* velocity, dashpot_dynamics* dynamics) {
  std::int32_t problem = check_result(controller, dynamics);
  if (problem != DASHPOT_OK) return finish(problem);
  JointVector q, qd = JointVector::Zero(controller->n);
  problem = read_joints(controller, position, q);
  if (problem == DASHPOT_OK && velocity != nullptr) problem = read_joints(controller, velocity, qd);
  if (problem != DASHPOT_OK) return problem;
  DynamicsResult at;
  controller->kernel.evaluate(q, qd, at);
  to_c(at, *dynamics);
  return finish(DASHPOT_OK);
}

int32_t dashpot_analyze(const dashpot_controller* controller, const double* position, int32_t mode,
                        const dashpot_gains* gains, dashpot_closed_loop* loop,
                        dashpot_modes* modes) {
  JointVector q;
  std::int32_t problem = read_joints(controller, position, q);
  if (problem != DASHPOT_OK) return problem;
  if (loop != nullptr) problem = check_result(controller, loop);
  if (modes != nullptr && problem == DASHPOT_OK) problem = check_result(controller, modes);
  if (problem != DASHPOT_OK) return finish(problem);
  if (mode != DASHPOT_MODE_JOINT && mode != DASHPOT_MODE_CARTESIAN) {
    return finish(DASHPOT_WRONG_VALUE);
  }
  Gains wanted = controller->settings.initial.gains;
  if (gains != nullptr) problem = read_gains(gains, controller->n, wanted);
  if (problem != DASHPOT_OK) return problem;
  problem = check_place(*controller, q);
  if (problem != DASHPOT_OK) return problem;
  try {
    VibrationTask task;
    Vibration found;
    const Status status = controller->at_posture(q, wanted, static_cast<Mode>(mode), task, found);
    if (status != Status::kOk) return finish(DASHPOT_WRONG_VALUE, to_text(status));
    if (loop != nullptr) to_c(task.system, *loop);
    if (modes != nullptr) to_c(found, *modes);
    return finish(DASHPOT_OK);
  } catch (const std::exception& error) {
    return finish(DASHPOT_WRONG_VALUE, error.what());
  } catch (...) {
    return finish(DASHPOT_WRONG_VALUE, "unknown failure");
  }
}

int32_t dashpot_read_snapshot(dashpot_controller* controller, dashpot_snapshot* snapshot) {
  const std::int32_t problem = check_result(controller, snapshot);
  if (problem != DASHPOT_OK) return finish(problem);
  controller->snapshots.fetch();
  if (controller->snapshots.value().tick == 0) return finish(DASHPOT_NOTHING_YET);
  to_c(controller->snapshots.value(), *snapshot);
  return finish(DASHPOT_OK);
}

int32_t dashpot_read_modes(dashpot_controller* controller, dashpot_modes* modes) {
  const std::int32_t problem = check_result(controller, modes);
  if (problem != DASHPOT_OK) return finish(problem);
  controller->vibrations.fetch();
  if (controller->vibrations.value().tick == 0) return finish(DASHPOT_NOTHING_YET);
  to_c(controller->vibrations.value(), *modes);
  return finish(DASHPOT_OK);
}

int32_t dashpot_read_sampled_modes(dashpot_controller* controller, dashpot_sampled_modes* modes) {
  const std::int32_t problem = check_result(controller, modes);
  if (problem != DASHPOT_OK) return finish(problem);
  const SampledVibration* found = controller->sampled();
  if (found == nullptr) return finish(DASHPOT_NOTHING_YET);
  to_c(*found, *modes);
  return finish(DASHPOT_OK);
}

const char* dashpot_status_text(int32_t status) {
  switch (status) {
    case DASHPOT_NULL_ARGUMENT:
      return "a required pointer is NULL";
    case DASHPOT_WRONG_STRUCT_SIZE:
      return "struct_size does not match this version of plugin.h";
    case DASHPOT_WRONG_JOINTS:
      return "joints is not the robot's number of joints";
    case DASHPOT_WRONG_VALUE:
      return "a value is not possible";
    case DASHPOT_NOTHING_YET:
      return "nothing to read so far";
    case DASHPOT_UNSTABLE_GAINS:
      return "the sampled loop would have less than the gain margin";
    default:
      break;
  }
  if (status < DASHPOT_OK || status > DASHPOT_NOT_FINITE) return "unknown status";
  return to_text(static_cast<Status>(status));
}

int32_t dashpot_needs_brakes(const dashpot_controller* controller) {
  return controller != nullptr && controller->needs_brakes() ? 1 : 0;
}

const char* dashpot_kind_text(int32_t kind) {
  if (kind < DASHPOT_UNDERDAMPED || kind > DASHPOT_SOFT) return "unknown kind";
  return to_text(static_cast<dashpot::analysis::ModeKind>(kind));
}

const dashpot_plugin* dashpot_plugin_interface(uint32_t version) {
  static const dashpot_plugin functions = {sizeof(dashpot_plugin),
                                           DASHPOT_PLUGIN_VERSION,
                                           dashpot_create,
                                           dashpot_create_from_text,
                                           dashpot_destroy,
                                           dashpot_last_error,
                                           dashpot_joints,
                                           dashpot_joint_name,
                                           dashpot_period,
                                           dashpot_update,
                                           dashpot_start,
                                           dashpot_reset,
                                           dashpot_stop,
                                           dashpot_release,
                                           dashpot_set_setpoint,
                                           dashpot_set_gains,
                                           dashpot_judge_gains,
                                           dashpot_set_payload,
                                           dashpot_limit_tip_speed,
                                           dashpot_evaluate,
                                           dashpot_analyze,
                                           dashpot_read_snapshot,
                                           dashpot_read_modes,
                                           dashpot_read_sampled_modes,
                                           dashpot_status_text,
                                           dashpot_needs_brakes,
                                           dashpot_kind_text};
  return version == DASHPOT_PLUGIN_VERSION ? &functions : nullptr;
}

}  // extern "C"
