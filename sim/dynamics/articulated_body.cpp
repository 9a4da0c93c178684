#include <dashpot/sim/dynamics/articulated_body.hpp>

#include <Eigen/Geometry>
#include <cmath>

namespace dashpot::sim {
namespace {

using Eigen::Matrix3d;
using Eigen::Vector3d;

Vector6 spatial(const Vector3d& linear, const Vector3d& angular) noexcept {
  Vector6 result;
  result.head<3>() = linear;
  result.tail<3>() = angular;
  return result;
}

/// v x m: the rate of a motion m that is fixed in a body moving with v.
Vector6 cross_motion(const Vector6& v, const Vector6& m) noexcept {
  const Vector3d linear = v.head<3>(), angular = v.tail<3>();
  return spatial(angular.cross(m.head<3>()) + linear.cross(m.tail<3>()),
                 angular.cross(m.tail<3>()));
}

/// v x* f: the rate of a force or momentum f that is fixed in a body moving with v.
Vector6 cross_force(const Vector6& v, const Vector6& f) noexcept {
  const Vector3d linear = v.head<3>(), angular = v.tail<3>();
  return spatial(angular.cross(f.head<3>()),
                 angular.cross(f.tail<3>()) + linear.cross(f.head<3>()));
}

/// A force at a point, seen from the origin.
Vector6 force_at(const Vector3d& point, const Vector3d& force) noexcept {
  return spatial(force, point.cross(force));
}

/// [m 1, -m [c]; m [c], I_c + m (c.c 1 - c c')] for a body with its centre at c.
void spatial_inertia(double m, const Vector3d& c, const Matrix3d& about_center,
                     Matrix6& I) noexcept {
  const Vector3d mc = m * c;
  I.topLeftCorner<3, 3>() = m * Matrix3d::Identity();
  I.bottomLeftCorner<3, 3>() << 0, -mc.z(), mc.y(),  //
      mc.z(), 0, -mc.x(),                            //
      -mc.y(), mc.x(), 0;
  I.topRightCorner<3, 3>() << 0, mc.z(), -mc.y(),  //
      -mc.z(), 0, mc.x(),                          //
      mc.y(), -mc.x(), 0;
  I.bottomRightCorner<3, 3>() = about_center - mc * c.transpose();
  I.bottomRightCorner<3, 3>().diagonal().array() += mc.dot(c);
}

/// R Rz(angle)
void turn_about_z(double angle, Matrix3d& R) noexcept {
  const double c = std::cos(angle), s = std::sin(angle);
  const Vector3d x = c * R.col(0) + s * R.col(1);
  R.col(1) = c * R.col(1) - s * R.col(0);
  R.col(0) = x;
}

}  // namespace

ArticulatedBody::ArticulatedBody(const Robot& robot) : robot_(&robot), bodies_{}, qd_{} {}

void ArticulatedBody::move_to(const double* q, const double* qd) noexcept {
  const Joint* const joints = robot_->joints().data();
  const int n = robot_->dof();
  for (int i = 0; i < n; ++i) {
    const Joint& joint = joints[i];
    Body& body = bodies_[static_cast<std::size_t>(i)];
    qd_[static_cast<std::size_t>(i)] = qd[i];
    if (i == 0) {
      body.rotation = joint.origin.rotation;
      body.position = joint.origin.position;
    } else {
      const Body& parent = (&body)[-1];
      body.rotation.noalias() = parent.rotation * joint.origin.rotation;
      body.position.noalias() = parent.position + parent.rotation * joint.origin.position;
    }
    const Vector3d z = body.rotation.col(2);
    if (joint.prismatic) {
      body.position += q[i] * z;
      body.axis = spatial(z, Vector3d::Zero());
    } else {
      turn_about_z(q[i], body.rotation);
      body.axis = spatial(body.position.cross(z), z);
    }

    body.velocity = body.axis * qd[i];
    if (i > 0) {
      const Vector6& carried = (&body)[-1].velocity;
      body.rate = cross_motion(carried, body.velocity);
      body.velocity += carried;
    } else {
      body.rate.setZero();
    }

    const Matrix3d turned = body.rotation * joint.inertia.about_center;
    const Matrix3d about_center = turned * body.rotation.transpose();
    body.center = body.position + body.rotation * joint.inertia.center;
    spatial_inertia(joint.inertia.mass, body.center, about_center, body.inertia);
    const Vector6 momentum = body.inertia * body.velocity;
    body.bias = cross_force(body.velocity, momentum);
  }
}

void ArticulatedBody::push_tip(const Vector6& wrench) noexcept {
  push_tip(Vector3d(wrench.head<3>()));
  bodies_[static_cast<std::size_t>(robot_->dof() - 1)].bias.tail<3>() -= wrench.tail<3>();
}

void ArticulatedBody::push_tip(const Vector3d& force) noexcept {
  bodies_[static_cast<std::size_t>(robot_->dof() - 1)].bias -= force_at(tip_position(), force);
}

void ArticulatedBody::accelerations(const double* tau, double* qdd) noexcept {
  const Joint* const joints = robot_->joints().data();
  const int n = robot_->dof();
  for (int i = n - 1; i >= 0; --i) {
    Body& body = bodies_[static_cast<std::size_t>(i)];
    body.reaction.noalias() = body.inertia * body.axis;
    body.gain = 1 / (body.axis.dot(body.reaction) + joints[i].drive_inertia_on_link());
    body.excess = tau[i] - body.axis.dot(body.bias);
    if (i == 0) break;
    Body& parent = (&body)[-1];
    const Vector6 scaled = body.gain * body.reaction;
    body.inertia.noalias() -= scaled * body.reaction.transpose();
    parent.bias += body.bias + scaled * body.excess;
    parent.bias.noalias() += body.inertia * body.rate;
    parent.inertia += body.inertia;
  }
  // Seen from a frame that falls freely.
  Vector6 acceleration = spatial(-robot_->gravity(), Vector3d::Zero());
  for (int i = 0; i < n; ++i) {
    const Body& body = bodies_[static_cast<std::size_t>(i)];
    acceleration += body.rate;
    qdd[i] = body.gain * (body.excess - body.reaction.dot(acceleration));
    acceleration += body.axis * qdd[i];
  }
}

Vector3d ArticulatedBody::tip_position() const noexcept {
  const Body& last = bodies_[static_cast<std::size_t>(robot_->dof() - 1)];
  return last.position + last.rotation * robot_->tip().position;
}

Pose ArticulatedBody::tip_pose() const noexcept {
  const Body& last = bodies_[static_cast<std::size_t>(robot_->dof() - 1)];
  return {tip_position(), last.rotation * robot_->tip().rotation};
}

Vector6 ArticulatedBody::tip_twist() const noexcept {
  Vector6 twist = bodies_[static_cast<std::size_t>(robot_->dof() - 1)].velocity;
  twist.head<3>() += twist.tail<3>().cross(tip_position());
  return twist;
}

double ArticulatedBody::kinetic_energy() const noexcept {
  double energy = 0;
  for (std::size_t i = 0; i < robot_->joints().size(); ++i) {
    const Body& body = bodies_[i];
    const Joint& joint = robot_->joints()[i];
    const Vector3d omega = body.velocity.tail<3>();
    const Vector3d v = Vector3d(body.velocity.head<3>()) + omega.cross(body.center);
    const Vector3d local = body.rotation.transpose() * omega;
    energy += 0.5 * (joint.inertia.mass * v.squaredNorm() +
                     local.dot(joint.inertia.about_center * local) +
                     joint.drive_inertia_on_link() * qd_[i] * qd_[i]);
  }
  return energy;
}

double ArticulatedBody::gravity_energy() const noexcept {
  double energy = 0;
  for (std::size_t i = 0; i < robot_->joints().size(); ++i) {
    energy -= robot_->joints()[i].inertia.mass * robot_->gravity().dot(bodies_[i].center);
  }
  return energy;
}

void ArticulatedBody::weight(double* tau) const noexcept {
  Vector6 weight = Vector6::Zero();
  for (int i = robot_->dof() - 1; i >= 0; --i) {
    const Body& body = bodies_[static_cast<std::size_t>(i)];
    const double mass = robot_->joints()[static_cast<std::size_t>(i)].inertia.mass;
    weight += force_at(body.center, Vector3d(mass * robot_->gravity()));
    tau[i] = -body.axis.dot(weight);
  }
}

}  // namespace dashpot::sim
