// What a RobotModel shows of its data.
#include <dashpot/controller/kdl_chain.hpp>
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
const Eigen::Vector3d& RobotModel::gravity() const noexcept {
  return data_->gravity;
}

JointVector RobotModel::joint_values(double Joint::*property) const {
  JointVector values(dof());
  for (int i = 0; i < dof(); ++i) values[i] = data_->joints[static_cast<std::size_t>(i)].*property;
  return values;
}

const KDL::Chain& kdl_chain(const RobotModel& model) noexcept {
  return model.data().chain;
}

}  // namespace dashpot::controller
