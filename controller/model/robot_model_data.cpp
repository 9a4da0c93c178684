// What a RobotModel shows of its data.
#include <dashpot/controller/model/rigid_bodies.hpp>
#include <dashpot/controller/model/robot_model_data.hpp>

namespace dashpot::controller {

const std::string& RobotModel::name() const noexcept {
  return data_->name;
}
const std::string& RobotModel::base() const noexcept {
  return data_->base;
}
const std::string& RobotModel::tip() const noexcept {
  return data_->tip;
}
int RobotModel::dof() const noexcept {
  return static_cast<int>(data_->joints.size());
}
const std::vector<Joint>& RobotModel::joints() const noexcept {
  return data_->joints;
}
const std::vector<std::string>& RobotModel::warnings() const noexcept {
  return data_->warnings;
}
const Eigen::Vector3d& RobotModel::gravity() const noexcept {
  return data_->gravity;
}

JointVector RobotModel::joint_values(double Joint::*property) const {
  JointVector values(dof());
  for (int i = 0; i < dof(); ++i) values[i] = data_->joints[static_cast<std::size_t>(i)].*property;
  return values;
}

int RobotModel::elastic_joints() const noexcept {
  int count = 0;
  for (const Joint& joint : joints()) count += joint.elastic() ? 1 : 0;
  return count;
}
PositionSensor RobotModel::position_sensor() const noexcept {
  return data_->position_sensor;
}

const Attachment& RobotModel::attachment() const noexcept {
  return data_->attachment;
}

void RobotModel::Data::attach(const Attachment& given) {
  attachment = given;
  const Payload payload = given.payload();
  const Eigen::Matrix3d& I = payload.inertia;
  const KDL::RigidBodyInertia body(
      payload.mass, to_kdl(payload.center),
      KDL::RotationalInertia(I(0, 0), I(1, 1), I(2, 2), I(0, 1), I(0, 2), I(1, 2)));
  const unsigned end = chain.getNrOfSegments() - 1;
  chain.getSegment(end - 1).setInertia(last_body + tip_link * body);
  const KDL::Frame tool(to_kdl(given.tool.rotation), to_kdl(given.tool.position));
  chain.getSegment(end) =
      KDL::Segment("tool", KDL::Joint("tool", KDL::Joint::None), tip_link * tool);
}

}  // namespace dashpot::controller
