#include <dashpot/apps/design_arm.hpp>
#include <dashpot/apps/number_list.hpp>
#include <dashpot/controller/dynamics.hpp>

#include <Eigen/Core>
#include <optional>

namespace dashpot::apps {
namespace {

using controller::RobotModel;

RobotModel read_model(const ArmOptions& options) try {
  return RobotModel::from_urdf_file(options.urdf, options.base, options.tip);
} catch (const controller::InvalidModel& error) {
  throw InputError("", error.what());
}

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

}  // namespace

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
  if (damping) entry.impedance.task_damping = Eigen::MatrixXd(damping->asDiagonal());
  return entry;
}

}  // namespace dashpot::apps
