#include <dashpot/apps/cli/number_list.hpp>
#include <dashpot/apps/design/design_arm.hpp>
#include <dashpot/controller/dynamics.hpp>

#include <Eigen/Core>
#include <optional>

namespace dashpot::apps {
namespace {

using controller::RobotModel;

/// So many numbers, or nothing if there is no text.
std::optional<Eigen::VectorXd> numbers(const std::string& option, const std::string& text,
                                       Eigen::Index count) {
  if (text.empty()) return std::nullopt;
  const Eigen::VectorXd values = parse_numbers(option, text);
  if (values.size() != count) {
    throw InputError(option,
                     std::to_string(values.size()) + " numbers, expected " + std::to_string(count));
  }
  return values;
}

/// As numbers_per_joint; nothing if there is no text.
std::optional<Eigen::VectorXd> per_joint(const std::string& option, const std::string& text,
                                         Eigen::Index n) {
  if (text.empty()) return std::nullopt;
  return numbers_per_joint(option, text, n);
}

controller::Payload read_payload(const std::string& text) {
  controller::Payload payload;
  if (text.empty()) return payload;
  const Eigen::VectorXd values = parse_numbers("--payload", text);
  if (values.size() != 1 && values.size() != 4) {
    throw InputError("--payload", "1 or 4 numbers are wanted: mass, or mass and its center");
  }
  if (values[0] < 0) throw InputError("--payload", "the mass is negative");
  payload.mass = values[0];
  if (values.size() == 4) payload.center = values.tail<3>();
  return payload;
}

RobotModel read_model(const ArmOptions& options) try {
  controller::ModelOptions model;
  const RobotModel plain = RobotModel::from_urdf_file(options.urdf, options.base, options.tip);
  const auto inertia = per_joint("--reflected-inertia", options.reflected_inertia, plain.dof());
  if (inertia) model.reflected_inertia = *inertia;
  if (options.viscous_friction != "urdf") {
    model.damping = per_joint("--viscous-friction", options.viscous_friction, plain.dof())
                        .value_or(Eigen::VectorXd::Zero(plain.dof()));
  }
  model.payload = read_payload(options.payload);
  return RobotModel::from_urdf_file(options.urdf, options.base, options.tip, model);
} catch (const controller::InvalidModel& error) {
  throw InputError("", error.what());
}

}  // namespace

bool ArmOptions::any() const {
  for (const auto* text : {&base, &tip, &q, &task_stiffness, &task_damping, &viscous_friction,
                           &null_damping, &reflected_inertia, &payload}) {
    if (!text->empty()) return true;
  }
  return false;
}

SystemEntry read_arm(const ArmOptions& options) {
  const RobotModel model = read_model(options);
  const Eigen::Index n = model.dof();
  const auto stiffness = numbers("--task-stiffness", options.task_stiffness, 6);
  if (!stiffness) throw InputError("--task-stiffness", "is needed with --urdf");
  const auto damping = numbers("--task-damping", options.task_damping, 6);
  const controller::JointVector q = numbers("--q", options.q, n).value_or(Eigen::VectorXd::Zero(n));
  const controller::DynamicsResult dynamics =
      controller::evaluate(model, q, controller::JointVector::Zero(n));
  SystemEntry entry;
  entry.impedance.mass = dynamics.M;
  entry.impedance.jacobian = dynamics.J;
  entry.impedance.task_stiffness = Eigen::MatrixXd(stiffness->asDiagonal());
  const Eigen::VectorXd friction = model.joint_values(&controller::Joint::damping);
  if (!friction.isZero(0)) {
    entry.friction = friction.asDiagonal();
    entry.impedance.damping = entry.friction;
  }
  if (const auto null = per_joint("--null-damping", options.null_damping, n)) {
    entry.add_null_damping(Eigen::MatrixXd(null->asDiagonal()));
  }
  if (damping) entry.impedance.task_damping = Eigen::MatrixXd(damping->asDiagonal());
  return entry;
}

}  // namespace dashpot::apps
