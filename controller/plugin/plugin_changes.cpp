// Changes of a running loop by the other thread: gains, payload, tool, tip speed.
#include <dashpot/controller/plugin/hosted_controller.hpp>
#include <dashpot/controller/setpoint_check.hpp>

#include <array>
#include <cmath>
#include <cstdio>
#include <exception>

using namespace dashpot::controller;  // NOLINT(google-build-using-namespace): the C functions

namespace {

using RowMajor3 = Eigen::Matrix<double, 3, 3, Eigen::RowMajor>;

/// Throws InvalidModel unless a body can be so.
Attachment read(const dashpot_payload& given, const Pose& tool_now) {
  const Payload payload{given.mass, Eigen::Map<const Eigen::Vector3d>(given.center),
                        Eigen::Map<const RowMajor3>(given.inertia)};
  Pose tool = tool_now;
  if (given.tool_position != nullptr) {
    tool.position = Eigen::Map<const Eigen::Vector3d>(given.tool_position);
  }
  if (given.tool_rotation != nullptr) {
    tool.rotation = Eigen::Map<const RowMajor3>(given.tool_rotation);
  }
  return {payload, tool};
}

/// Returns DASHPOT_OK if the torque limits hold the arm's weight at q, or exceed it less than
/// before, and otherwise why not.
std::int32_t check_weight(const dashpot_controller& controller, const Attachment& attachment,
                          const JointVector& q) noexcept {
  if (!controller.settings.feed_forward.gravity || q.size() == 0) return finish(DASHPOT_OK);
  const JointVector then = weight_of(controller, attachment, q);
  const JointVector now = weight_of(controller, controller.request.attachment, q);
  const JointVector& limit = controller.settings.limits.torque;
  for (int i = 0; i < controller.n; ++i) {
    if (std::abs(then[i]) <= limit[i] || std::abs(then[i]) < std::abs(now[i])) continue;
    std::array<char, 256> text{};
    std::snprintf(text.data(), text.size(),
                  "payload: joint %d would need %.4g to hold the weight here, limits.torque allows "
                  "%.4g",
                  i + 1, std::abs(then[i]), limit[i]);
    return finish(DASHPOT_WRONG_VALUE, text.data());
  }
  return finish(DASHPOT_OK);
}

/// Judges a change as a whole. Returns DASHPOT_OK, perhaps with a warning, or why not.
std::int32_t judge_change(dashpot_controller& controller, const Gains& gains,
                          const Attachment& attachment, const JointVector& q) noexcept {
  Judgement& judgement = controller.judgement;
  try {
    const Judgement::Change change =
        judgement.change(controller.request.setpoint.gains, gains, q, attachment);
    if (judgement.enough(change.verdict)) return finish(DASHPOT_OK);
    std::array<char, 64> became{};
    if (change.taken) {
      std::snprintf(became.data(), became.size(), "; taken because it was %.3g before",
                    change.before);
    }
    const VerdictText text =
        describe(judgement, change.verdict, gains, q.size() != 0, became.data());
    return change.taken ? warn(text.data()) : finish(DASHPOT_UNSTABLE_GAINS, text.data());
  } catch (...) {
    return finish(DASHPOT_UNSTABLE_GAINS, "the gains could not be judged");
  }
}

}  // namespace

extern "C" {

int32_t dashpot_set_gains(dashpot_controller* controller, const dashpot_gains* gains) {
  if (controller == nullptr) return finish(DASHPOT_NULL_ARGUMENT);
  Request& request = controller->request;
  Gains wanted = request.setpoint.gains;
  std::int32_t code = read_gains(gains, controller->n, wanted);
  if (code != DASHPOT_OK) return code;
  finish(DASHPOT_OK);
  if (!same_gains(wanted, request.setpoint.gains)) {
    JointVector q;
    controller->judgement.where(q);
    code = judge_change(*controller, wanted, request.attachment, q);
    if (code != DASHPOT_OK) return code;
    warn_of_gains(*controller, wanted);
  }
  request.setpoint.gains = wanted;
  ++request.gain_changes;
  controller->requests.write(request);
  return code;
}

int32_t dashpot_set_payload(dashpot_controller* controller, const dashpot_payload* payload) {
  if (controller == nullptr || payload == nullptr) return finish(DASHPOT_NULL_ARGUMENT);
  if (payload->struct_size != sizeof *payload) return finish(DASHPOT_WRONG_STRUCT_SIZE);
  try {
    Request& request = controller->request;
    const Attachment wanted = read(*payload, request.attachment.tool);
    Gains gains = request.setpoint.gains;
    std::int32_t code = DASHPOT_OK;
    if (payload->gains != nullptr) code = read_gains(payload->gains, controller->n, gains);
    if (code != DASHPOT_OK) return code;
    controller->model.with(wanted);  // throws if a joint has no inertia
    JointVector q;
    controller->judgement.where(q);
    code = check_weight(*controller, wanted, q);
    if (code == DASHPOT_OK) code = judge_change(*controller, gains, wanted, q);
    if (code != DASHPOT_OK) return code;
    if (payload->gains != nullptr) warn_of_gains(*controller, gains);
    request.setpoint.tip_pose =
        carried(request.setpoint.tip_pose, request.attachment.tool, wanted.tool);
    request.setpoint.gains = gains;
    request.attachment = wanted;
    ++request.attachments;
    if (payload->gains != nullptr) ++request.gain_changes;
    controller->requests.write(request);
    return code;
  } catch (const std::exception& error) {
    return finish(DASHPOT_WRONG_VALUE, error.what());
  }
}

int32_t dashpot_limit_tip_speed(dashpot_controller* controller, double linear, double angular,
                                double limit) {
  if (controller == nullptr) return finish(DASHPOT_NULL_ARGUMENT);
  const Settings& settings = controller->settings;
  const std::array<double, 3> given{linear, angular, limit};
  const std::array<double, 3> most{settings.motion.linear_velocity,
                                   settings.motion.angular_velocity, settings.limits.tip_velocity};
  constexpr std::array kNames{"motion.linear_velocity", "motion.angular_velocity",
                              "limits.tip_velocity"};
  for (std::size_t i = 0; i < given.size(); ++i) {
    if (given[i] >= TipSpeed::kLeast && (given[i] <= most[i] || std::isinf(given[i]))) continue;
    std::array<char, 128> text{};
    std::snprintf(text.data(), text.size(),
                  "%s %.4g: must be at least %g and at most %.4g, as the configuration says",
                  kNames[i], given[i], TipSpeed::kLeast, most[i]);
    return finish(DASHPOT_WRONG_VALUE, text.data());
  }
  controller->request.tip_speed = {linear, angular, limit};
  ++controller->request.tip_speeds;
  controller->requests.write(controller->request);
  return finish(DASHPOT_OK);
}

}  // extern "C"
