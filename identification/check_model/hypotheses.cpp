#include <dashpot/controller/kdl_chain.hpp>
#include <dashpot/identification/check_model/hypotheses.hpp>

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

std::vector<MatrixXd> body_columns(const controller::RobotModel& model, const WeakForm& form,
                                   std::size_t count) {
  constexpr std::array<std::array<int, 2>, 6> kEntries{
      {{0, 0}, {1, 1}, {2, 2}, {0, 1}, {0, 2}, {1, 2}}};
  controller::DynamicsKernel kernel(model);
  kernel.attach({});
  const MatrixXd bare = sum_of(form.torques(kernel, model.dof()));
  std::vector<MatrixXd> columns;
  for (std::size_t i = 0; i < count; ++i) {
    controller::Attachment unit;
    if (i == 0) {
      unit.mass = 1;
    } else if (i < 4) {
      unit.first_moment[static_cast<Index>(i) - 1] = 1;
    } else {
      const auto [row, col] = kEntries[i - 4];
      unit.inertia(row, col) = unit.inertia(col, row) = 1;
    }
    kernel.attach(unit);
    columns.emplace_back(sum_of(form.torques(kernel, model.dof())) - bare);
  }
  return columns;
}

std::vector<Hypothesis> list_hypotheses(const controller::RobotDescription& robot,
                                        const controller::RobotModel& model, const WeakForm& form,
                                        const MatrixXd& model_torque) {
  std::vector<Hypothesis> all;
  const int n = model.dof();
  const MatrixXd acceleration = form.acceleration();
  for (int j = 0; j < n; ++j) {
    const controller::Joint& joint = model.joints()[static_cast<std::size_t>(j)];
    const auto row_alone = [&](const MatrixXd& of) {
      MatrixXd column = MatrixXd::Zero(n, form.count());
      column.row(j) = of.row(j);
      return column;
    };
    const bool slides = joint.type == controller::JointType::kPrismatic;
    all.push_back(
        {j, {row_alone(acceleration)}, "its reflected inertia is", slides ? "kg" : "kg m^2", 1});
    all.push_back({j, {row_alone(model_torque)}, "its torque reads", "%", 100});
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
      all.push_back({j, {own / link.mass}, "the mass of link " + name + " is", "kg", 1});
    }
    columns.erase(columns.begin());
    all.push_back({j, std::move(columns), "the centre of mass of link " + name + " is", "", 1});
  }
  return all;
}

}  // namespace dashpot::identification
