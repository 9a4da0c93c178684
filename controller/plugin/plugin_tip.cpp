// What the other thread tells of the tip: what it carries, and how fast it may be.
#include <dashpot/controller/plugin/hosted_controller.hpp>

#include <array>
#include <cmath>
#include <cstdio>
#include <exception>

using namespace dashpot::controller;  // NOLINT(google-build-using-namespace): the C functions

namespace {

constexpr double kSlowestTip = 1e-4;  // m/s and rad/s: less is as good as none, or a mistake

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

/// Whether the torque limits hold the arm's weight at q. DASHPOT_OK or why not.
std::int32_t check_weight(const dashpot_controller& controller, const Attachment& attachment,
                          const JointVector& q) noexcept {
  if (!controller.settings.feed_forward.gravity || q.size() == 0) return finish(DASHPOT_OK);
  DynamicsKernel kernel = controller.kernel;
  kernel.attach(attachment);
  DynamicsResult there;
  kernel.evaluate(q, JointVector::Zero(q.size()), there);
  const JointVector& limit = controller.settings.limits.torque;
  for (int i = 0; i < controller.n; ++i) {
    if (std::abs(there.gravity[i]) <= limit[i]) continue;
    std::array<char, 256> text{};
    std::snprintf(text.data(), text.size(),
                  "payload: joint %d would need %.4g to hold the weight here, limits.torque allows "
                  "%.4g",
                  i + 1, std::abs(there.gravity[i]), limit[i]);
    return finish(DASHPOT_WRONG_VALUE, text.data());
  }
  return finish(DASHPOT_OK);
}

}  // namespace

extern "C" {

int32_t dashpot_set_payload(dashpot_controller* controller, const dashpot_payload* payload) {
  if (controller == nullptr || payload == nullptr) return finish(DASHPOT_NULL_ARGUMENT);
  if (payload->struct_size != sizeof *payload) return finish(DASHPOT_WRONG_STRUCT_SIZE);
  try {
    Request& request = controller->request;
    const Attachment wanted = read(*payload, request.attachment.tool);
    Judgement& judgement = controller->judgement;
    std::int32_t code = DASHPOT_OK;
    if (controller->undoable && wanted == controller->attachment_before) {
      judgement.attach(wanted);
    } else {
      controller->model.with(wanted);  // throws if a joint has no inertia
      JointVector q;
      judgement.where(q);
      code = check_weight(*controller, wanted, q);
      if (code != DASHPOT_OK) return code;
      code = finish(judgement, judgement.judge(request.setpoint.gains, q, wanted), q.size() != 0);
      if (code != DASHPOT_OK) return code;
    }
    controller->attachment_before = request.attachment;
    controller->undoable = false;
    request.setpoint.tip_pose =
        carried(request.setpoint.tip_pose, request.attachment.tool, wanted.tool);
    request.attachment = wanted;
    ++request.attachments;
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
    if (given[i] >= kSlowestTip && (given[i] <= most[i] || std::isinf(given[i]))) continue;
    std::array<char, 128> text{};
    std::snprintf(text.data(), text.size(),
                  "%s %.4g: must be at least %g and at most %.4g, as the configuration says",
                  kNames[i], given[i], kSlowestTip, most[i]);
    controller->undoable = controller->request.attachments > 0;
    return finish(DASHPOT_WRONG_VALUE, text.data());
  }
  controller->request.tip_speed = {linear, angular, limit};
  ++controller->request.tip_speeds;
  controller->requests.write(controller->request);
  return finish(DASHPOT_OK);
}

}  // extern "C"
