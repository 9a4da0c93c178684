#include <dashpot/controller/kdl_chain.hpp>
#include <dashpot/identification/check_model/hypotheses.hpp>

#include <Eigen/Geometry>

namespace dashpot::identification {
namespace {

using Eigen::Index;
using Eigen::MatrixXd;

MatrixXd sum_of(const WindowTorques& torques) {
  return torques.inertial + torques.gravity;
}

/// The chain from the base to the link that joint j moves; without anything attached.
controller::RobotModel part_of_arm(const controller::RobotDescription& robot,
                                   const controller::RobotModel& model, int joint) {
  controller::RobotDescription part = robot;
  controller::ModelOptions& options = part.options;
  options.payload = {};
  options.tool = {};
  options.drives.clear();
  options.drives_friction = false;
  options.accept_inertias = true;
  options.include_off_chain = true;  // which includes all beyond the link
  options.reflected_inertia =
      model.joint_values(&controller::Joint::reflected_inertia).head(joint + 1);
  options.viscous_friction = options.coulomb_friction = {};
  options.torque_loop_inertia_ratio = options.gear_stiffness = options.gear_damping = {};
  part.tip = kdl_chain(model).getSegment(static_cast<unsigned>(joint)).getName();
  return part.model();
}

controller::Attachment body_of(const KDL::RigidBodyInertia& body) {
  controller::Attachment attachment;
  attachment.mass = body.getMass();
  const KDL::Vector center = body.getCOG();
  for (int i = 0; i < 3; ++i) attachment.first_moment[i] = attachment.mass * center[i];
  const KDL::RotationalInertia inertia = body.getRotationalInertia();
  for (int i = 0; i < 9; ++i) attachment.inertia.data()[i] = inertia.data[i];
  return attachment;
}

}  // namespace

void add_to_body(controller::Attachment& body, Index i, double amount) {
  constexpr std::array<std::array<int, 2>, 6> kEntries{
      {{0, 0}, {1, 1}, {2, 2}, {0, 1}, {0, 2}, {1, 2}}};
  if (i == 0) {
    body.mass += amount;
  } else if (i < 4) {
    body.first_moment[i - 1] += amount;
  } else {
    const auto [row, col] = kEntries[static_cast<std::size_t>(i - 4)];
    body.inertia(row, col) += amount;
    if (row != col) body.inertia(col, row) += amount;
  }
}

std::vector<MatrixXd> body_columns(const controller::RobotModel& model, const WeakForm& form,
                                   std::size_t count) {
  controller::DynamicsKernel kernel(model);
  kernel.attach({});
  const MatrixXd bare = sum_of(form.torques(kernel, model.dof()));
  std::vector<MatrixXd> columns;
  for (std::size_t i = 0; i < count; ++i) {
    controller::Attachment unit;
    add_to_body(unit, static_cast<Index>(i), 1);
    kernel.attach(unit);
    columns.emplace_back(sum_of(form.torques(kernel, model.dof())) - bare);
  }
  return columns;
}

Eigen::Matrix<double, 3, 2> tilt_directions(const Eigen::Vector3d& gravity) {
  Eigen::Matrix<double, 3, 2> directions;
  directions.col(0) = gravity.unitOrthogonal() * gravity.norm();
  directions.col(1) = gravity.normalized().cross(directions.col(0));
  return directions;
}

std::vector<MatrixXd> tilt_columns(const controller::RobotDescription& robot,
                                   const WeakForm& form) {
  std::vector<MatrixXd> columns;
  const Eigen::Matrix<double, 3, 2> directions = tilt_directions(robot.options.gravity);
  for (Eigen::Index i = 0; i < 2; ++i) {
    controller::RobotDescription tilted = robot;
    tilted.options.gravity = directions.col(i);
    const controller::RobotModel model = tilted.model();
    columns.push_back(form.torques(controller::DynamicsKernel(model), model.dof()).gravity);
  }
  return columns;
}

std::vector<Hypothesis> list_hypotheses(const controller::RobotDescription& robot,
                                        const controller::RobotModel& model, const WeakForm& form,
                                        const MatrixXd& model_torque) {
  std::vector<Hypothesis> all;
  const int n = model.dof();
  if (!robot.options.gravity.isZero(0)) {
    all.push_back({0, tilt_columns(robot, form), "gravity is", "", 1, true});
  }
  for (int j = 0; j < n; ++j) {
    MatrixXd own_torque = MatrixXd::Zero(n, form.count());
    own_torque.row(j) = model_torque.row(j);
    all.push_back({j, {std::move(own_torque)}, "its torque reads", "%", 100});
    if (j + 1 == n) break;  // what the last link lacks is part of the payload
    const KDL::Segment& segment = kdl_chain(model).getSegment(static_cast<unsigned>(j));
    const controller::RobotModel part = part_of_arm(robot, model, j);
    std::vector<MatrixXd> columns = body_columns(part, form, 4);
    const controller::Attachment link = body_of(segment.getInertia());
    const std::string name = "'" + segment.getName() + "'";
    if (link.mass > 0) {
      controller::DynamicsKernel kernel(part);
      kernel.attach({});
      const MatrixXd bare = sum_of(form.torques(kernel, j + 1));
      kernel.attach(link);
      const MatrixXd own = sum_of(form.torques(kernel, j + 1)) - bare;
      all.push_back(
          {j, {own / link.mass}, "the mass of link " + name + " is", "kg", 1, false, true});
    }
    columns.erase(columns.begin());
    all.push_back({j, std::move(columns), "the centre of mass of link " + name + " is", "", 1});
  }
  return all;
}

}  // namespace dashpot::identification
