#include <dashpot/controller/elastic_joints.hpp>

namespace dashpot::controller {

analysis::Gears elastic_joints(const RobotModel& model) {
  const Eigen::VectorXd friction = model.joint_values(&Joint::viscous_friction);
  return analysis::Gears({model.joint_values(&Joint::gear_stiffness),
                          model.joint_values(&Joint::gear_damping),
                          model.joint_values(&Joint::reflected_inertia), friction.asDiagonal(),
                          model.position_sensor() == PositionSensor::kLink});
}

}  // namespace dashpot::controller
