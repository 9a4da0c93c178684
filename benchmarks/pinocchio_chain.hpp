#pragma once
// Pinocchio's algorithms on one of our robots, from its headers alone: compiled here, with the
// project's options, and with a model made from KDL's chain instead of Pinocchio's reader of URDFs.
#include <dashpot/controller/dynamics.hpp>
#include <dashpot/controller/kdl_chain.hpp>

#include <pinocchio/algorithm/crba.hpp>
#include <pinocchio/algorithm/frames.hpp>
#include <pinocchio/algorithm/jacobian.hpp>
#include <pinocchio/algorithm/kinematics.hpp>
#include <pinocchio/algorithm/rnea.hpp>

#include <string>

namespace dashpot::bench {

class PinocchioChain {
 public:
  using Vector = Eigen::VectorXd;

  explicit PinocchioChain(const controller::RobotModel& robot)
      : model_(model_of(robot)),
        data_(model_),
        tip_(model_.getFrameId("tip")),
        zero_(Vector::Zero(model_.nv)),
        J_(Eigen::MatrixXd::Zero(6, model_.nv)),
        dJ_(J_) {}

  void mass(const Vector& q) { pinocchio::crba(model_, data_, q, pinocchio::Convention::LOCAL); }
  /// Coriolis and gravity together.
  void bias(const Vector& q, const Vector& qd) {
    pinocchio::nonLinearEffects(model_, data_, q, qd);
  }
  void gravity(const Vector& q) { pinocchio::computeGeneralizedGravity(model_, data_, q); }
  void pose(const Vector& q) {
    pinocchio::forwardKinematics(model_, data_, q);
    pinocchio::updateFramePlacement(model_, data_, tip_);
  }
  void jacobian(const Vector& q) {
    pinocchio::computeJointJacobians(model_, data_, q);
    pinocchio::getFrameJacobian(model_, data_, tip_, pinocchio::LOCAL_WORLD_ALIGNED, J_);
  }
  /// The whole matrix Jdot, and J.
  void jacobian_rate(const Vector& q, const Vector& qd) {
    pinocchio::computeJointJacobiansTimeVariation(model_, data_, q, qd);
    pinocchio::getFrameJacobianTimeVariation(model_, data_, tip_, pinocchio::LOCAL_WORLD_ALIGNED,
                                             dJ_);
  }
  /// Jdot qd, with the pose.
  void bias_acceleration(const Vector& q, const Vector& qd) {
    pinocchio::forwardKinematics(model_, data_, q, qd, zero_);
    pinocchio::updateFramePlacement(model_, data_, tip_);
    acceleration_ = pinocchio::getFrameClassicalAcceleration(model_, data_, tip_,
                                                             pinocchio::LOCAL_WORLD_ALIGNED);
  }
  /// What DynamicsKernel computes. crba in the world's axes leaves J behind.
  void all(const Vector& q, const Vector& qd) {
    pinocchio::crba(model_, data_, q, pinocchio::Convention::WORLD);
    bias(q, qd);
    gravity(q);
    bias_acceleration(q, qd);
    pinocchio::getFrameJacobian(model_, data_, tip_, pinocchio::LOCAL_WORLD_ALIGNED, J_);
  }

  /// Returns the result of the last all().
  controller::DynamicsResult result() const {
    controller::DynamicsResult result;
    const Eigen::MatrixXd upper = data_.M;
    result.M = upper.selfadjointView<Eigen::Upper>();
    result.gravity = data_.g;
    result.coriolis = data_.nle - data_.g;
    result.J = J_;
    result.Jdot_qd = acceleration_.toVector();
    result.p_BT_B = data_.oMf[tip_].translation();
    result.R_BT = data_.oMf[tip_].rotation();
    return result;
  }

 private:
  static Eigen::Vector3d vector(const KDL::Vector& v) { return {v.x(), v.y(), v.z()}; }
  static pinocchio::SE3 pose_of(const KDL::Frame& frame) {
    Eigen::Matrix3d R;
    for (int i = 0; i < 3; ++i) {
      for (int j = 0; j < 3; ++j) R(i, j) = frame.M(i, j);
    }
    return {R, vector(frame.p)};
  }

  static pinocchio::Model model_of(const controller::RobotModel& robot) {
    pinocchio::Model model;
    model.gravity.linear() = robot.gravity();
    pinocchio::JointIndex last = 0;
    pinocchio::SE3 at = pinocchio::SE3::Identity();  // of the segment's root in the last joint
    const KDL::Chain chain = controller::kdl_chain(robot);
    for (const KDL::Segment& segment : chain.segments) {
      const KDL::Joint& joint = segment.getJoint();
      if (joint.getType() != KDL::Joint::None) {  // its axis becomes z, which is fastest
        const Eigen::Quaterniond turn =
            Eigen::Quaterniond::FromTwoVectors(Eigen::Vector3d::UnitZ(), vector(joint.JointAxis()));
        const pinocchio::SE3 frame(turn.toRotationMatrix(), vector(joint.JointOrigin()));
        last = model.addJoint(last, pinocchio::JointModelRZ(), at * frame,
                              "joint" + std::to_string(model.njoints));
        model.armature[model.nv - 1] = joint.getInertia();
        at = frame.inverse();
      }
      at = at * pose_of(segment.pose(0));
      const KDL::RigidBodyInertia& body = segment.getInertia();
      if (body.getMass() > 0 && last > 0) {
        const Eigen::Vector3d center = vector(body.getCOG());
        Eigen::Matrix3d I;
        for (int i = 0; i < 9; ++i) I(i / 3, i % 3) = body.getRotationalInertia().data[i];
        I -= body.getMass() *
             (center.squaredNorm() * Eigen::Matrix3d::Identity() - center * center.transpose());
        model.appendBodyToJoint(last, pinocchio::Inertia(body.getMass(), center, I), at);
      }
    }
    model.addFrame(pinocchio::Frame("tip", last, 0, at, pinocchio::OP_FRAME));
    return model;
  }

  pinocchio::Model model_;
  pinocchio::Data data_;
  pinocchio::FrameIndex tip_;
  Vector zero_;
  Eigen::MatrixXd J_, dJ_;
  pinocchio::Motion acceleration_;
};

}  // namespace dashpot::bench
