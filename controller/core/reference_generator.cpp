#include <dashpot/controller/core/reference_generator.hpp>
#include <dashpot/controller/core/thresholds.hpp>

#include <algorithm>
#include <cmath>
#include <numbers>

namespace dashpot::controller {

using Eigen::Quaterniond;

ReferenceGenerator::ReferenceGenerator(const RobotModel& model, const Settings& settings)
    : settings_(settings),
      references_(settings.motion, settings.period),
      clamp_{settings.limits.linear_error, settings.limits.angular_error},
      turn_(JointVector::Zero(model.dof())),
      goal_(turn_) {
  for (Eigen::Index i = 0; i < turn_.size(); ++i) {
    const Joint& joint = model.joints()[static_cast<std::size_t>(i)];
    if (joint.type == JointType::kContinuous) turn_[i] = 2 * std::numbers::pi;
  }
}

void ReferenceGenerator::limit_tip_speed(const TipSpeed& speed) noexcept {
  tip_speed_ = speed;
  references_.tip.limit_speed(std::min(settings_.motion.linear_velocity, speed.linear),
                              std::min(settings_.motion.angular_velocity, speed.angular));
}

void ReferenceGenerator::carry(const Pose& from, const Pose& to) noexcept {
  const TipReference& tip = references_.tip;
  const Pose moved = carried({tip.position(), tip.rotation().toRotationMatrix()}, from, to);
  references_.tip.relocate(moved.position, Quaterniond(moved.rotation).normalized());
}

void ReferenceGenerator::start_new_springs(const GainBlend& gains, const Sensed& sensed) noexcept {
  const Impedance &now = gains.now(), &then = gains.target();
  const DynamicsResult& robot = sensed.robot;
  for (int i = 0; i < static_cast<int>(goal_.size()); ++i) {
    if (now.joint_stiffness(i, i) == 0 && then.joint_stiffness(i, i) > 0) {
      references_.joint.relocate(i, sensed.q[i]);
    }
    if (now.null_stiffness[i] == 0 && then.null_stiffness[i] > 0) {
      references_.posture.relocate(i, sensed.q[i]);
    }
  }
  const Quaterniond tip(robot.R_BT);
  Vector6 e;
  e << references_.tip.position() - robot.p_BT_B,
      short_turn(references_.tip.rotation() * tip.conjugate());
  const Vector6 left = without_new_springs(e, now.base, now.tool, then.base, then.tool, robot.R_BT);
  if (left == e) return;
  references_.tip.relocate(robot.p_BT_B + left.head<3>(), quaternion(left.tail<3>()) * tip);
}

void ReferenceGenerator::set_goal(const SetpointHistory& setpoints, bool new_gains,
                                  const Sensed& now) noexcept {
  const Setpoint& wanted = setpoints.setpoint();
  const Impedance& impedance = setpoints.gains().now();
  if (new_gains) start_new_springs(setpoints.gains(), now);
  const bool joint = wanted.mode == Mode::kJoint;
  JointReference& path = joint ? references_.joint : references_.posture;
  if ((joint ? impedance.joint_weight : impedance.task_weight) == 0) {
    path.start(now.q);
    if (!joint) {
      references_.tip.start(now.robot.p_BT_B, Quaterniond(now.robot.R_BT).normalized());
    }
  }
  const JointVector& from = path.position();
  const bool any = wanted.joint_position.size() == goal_.size();
  goal_ = any ? wanted.joint_position : from;
  for (Eigen::Index i = 0; any && i < goal_.size(); ++i) {  // a continuous joint: the short way
    if (turn_[i] > 0) goal_[i] += turn_[i] * std::nearbyint((from[i] - goal_[i]) / turn_[i]);
  }
}

void ReferenceGenerator::step(const SetpointHistory& setpoints, bool hold, const Sensed& now,
                              const NullSpace& null_space) noexcept {
  const Impedance& impedance = setpoints.gains().now();
  const DynamicsResult& robot = now.robot;
  const bool joint = setpoints.setpoint().mode == Mode::kJoint;
  if (impedance.joint_weight > 0) {
    if (joint && !hold) {
      references_.joint.step(goal_, joint_share(robot.J));
    } else {
      references_.joint.halt();
    }
  }
  if (impedance.task_weight == 0) return;
  if (joint || hold) {
    references_.tip.halt();
    references_.posture.halt();
    return;
  }
  const Pose goal = setpoints.tip_goal();
  const Quaterniond tip(robot.R_BT);
  references_.tip.step(goal.position, Quaterniond(goal.rotation).normalized(),
                       {robot.p_BT_B, tip, robot.R_BT, impedance.base, impedance.tool, clamp_},
                       tip_share(null_space));
  references_.posture.step(goal_);
}

bool ReferenceGenerator::still(const Impedance& impedance) const noexcept {
  return (impedance.joint_weight == 0 || references_.joint.velocity().isZero(0)) &&
         (impedance.task_weight == 0 ||
          (references_.posture.velocity().isZero(0) && references_.tip.velocity().isZero(0)));
}

double ReferenceGenerator::tip_share(const NullSpace& null_space) noexcept {
  const double speed = references_.tip.speed();
  if (speed == 0) return tip_share_ = 1;
  const JointVector qd = null_space.joint_velocity(references_.tip.point_velocity());
  double share = 0;
  for (Eigen::Index i = 0; i < qd.size(); ++i) {
    share = std::max(share, std::abs(qd[i]) / settings_.limits.velocity[i]);
  }
  const double now = share > kShareOfJointLimit * speed ? kShareOfJointLimit * speed / share : 1;
  return tip_share_ = std::min(now, tip_share_ + settings_.period / kShareRise);
}

double ReferenceGenerator::joint_share(const Jacobian& J) const noexcept {
  const bool any = std::isfinite(tip_speed_.linear) || std::isfinite(tip_speed_.angular);
  const double speed = references_.joint.speed();
  if (!any || speed == 0) return 1;
  const Vector6 V = twist(J, references_.joint.point_velocity());
  const double share =
      std::max(V.head<3>().norm() / tip_speed_.linear, V.tail<3>().norm() / tip_speed_.angular);
  return share > speed ? speed / share : 1;
}

}  // namespace dashpot::controller
