#pragma once
#include <dashpot/sim/joint_types.hpp>
#include <dashpot/sim/robot.hpp>

#include <array>

namespace dashpot::sim {

/// Forward dynamics of a serial chain: M(q) qdd + C(q, qd) qd + g(q) = tau + J' w, solved for qdd
/// by the articulated-body algorithm (R. Featherstone, Rigid Body Dynamics Algorithms, 2008,
/// table 7.1) in O(n). All spatial vectors are taken at the base's origin in the base's axes,
/// linear part first: then velocities, forces and inertias of different bodies simply add up. A
/// motion is (velocity of the body's point at the origin, angular velocity), a force (force,
/// moment).
///
/// Use, with q, qd, tau and qdd of n entries:
///     ArticulatedBody chain(robot);
///     chain.move_to(q, qd);          // kinematics
///     chain.push_tip(w);             // as often as needed
///     chain.accelerations(tau, qdd);
/// Nothing allocates. The robot must outlive it.
class ArticulatedBody {
 public:
  explicit ArticulatedBody(const Robot& robot);
  explicit ArticulatedBody(Robot&&) = delete;

  /// Poses, velocities, inertias and bias forces of all bodies; forgets the wrenches at the tip.
  void move_to(const double* q, const double* qd) noexcept;
  /// A wrench that the world exerts on the tip link: force (N) at the tip's origin and moment (N
  /// m), in the base's axes.
  void push_tip(const Vector6& wrench) noexcept;
  /// Adds a force (N) at the tip's origin.
  void push_tip(const Eigen::Vector3d& force) noexcept;
  /// qdd (rad/s^2). Not finite if a joint moves no inertia. Call it once after move_to.
  void accelerations(const double* tau, double* qdd) noexcept;

  // Results of move_to:
  /// Returns the pose of the tip in the base.
  Pose tip_pose() const noexcept;
  /// p_BT_B, m
  Eigen::Vector3d tip_position() const noexcept;
  /// Velocity and angular velocity of the tip in the base, m/s and rad/s.
  Vector6 tip_twist() const noexcept;
  /// g(q), n, N m: the torques that hold the weight.
  void weight(double* tau) const noexcept;
  /// (qd' M qd) / 2 with the armatures of joints whose gears are rigid, J
  double kinetic_energy() const noexcept;
  /// -sum of m g.c, zero with all masses at the base's origin, J
  double gravity_energy() const noexcept;

 private:
  struct Body {
    Eigen::Matrix3d rotation;  // of the body's frame in the base
    Eigen::Vector3d position;
    Eigen::Vector3d center;  // of mass, in the base
    Vector6 axis;            // S: velocity of the body per velocity of its joint
    Vector6 velocity;
    Vector6 rate;      // c: acceleration by velocities alone
    Matrix6 inertia;   // I, then articulated
    Vector6 bias;      // p: force that keeps the acceleration zero, then articulated
    Vector6 reaction;  // U = I S
    double gain;       // 1 / (S' I S + drive_inertia_on_link)
    double excess;     // u: remaining generalized force, which accelerates the joint
  };

  const Robot* robot_;
  std::array<Body, kMaxJoints> bodies_;
  std::array<double, kMaxJoints> qd_;
};

}  // namespace dashpot::sim
