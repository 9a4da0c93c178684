#pragma once
// A sim::Robot in MuJoCo: another engine's dynamics, integrator, dry friction and stops.

#include <dashpot/sim/arm.hpp>

#include <memory>
#include <utility>

namespace dashpot::testing {

struct MujocoOptions {
  double step = 2.5e-4;    ///< largest of the integrator, s
  double link_factor = 1;  ///< masses and moments of inertia of the links over the robot's
  sim::Inertia payload;    ///< rigid at the tip, in its axes, beside the robot's
  int delay = 0;           ///< calls of step() from a torque to its effect
  /// A spring of MuJoCo's own, N/m, along a direction of length 1 in the base's axes, at rest where
  /// the arm is made: a tendon between the tip and a point ten metres away.
  std::pair<double, Eigen::Vector3d> tendon{0, Eigen::Vector3d::UnitZ()};
};

/// A robot with its reflected inertias, friction, payload and gravity, in the world of a sim::Arm:
/// whether friction acts, a wall at the tip, wrenches on the tip. With `stops` MuJoCo's own stops
/// act at the position limits. Coulomb friction is MuJoCo's `frictionloss`: a joint that it holds
/// stands still, while a joint of sim::Arm creeps.
class MujocoArm {
 public:
  using JointVector = sim::JointVector;

  /// Whether this build has MuJoCo.
  static bool available() noexcept;
  /// Starts at q with the velocity qd, or at rest. Throws sim::InvalidScene for `loads`, and
  /// std::runtime_error with MuJoCo's words, or in a build without it.
  static std::unique_ptr<MujocoArm> make(const sim::Robot& robot, const sim::ArmOptions& world,
                                         const MujocoOptions& options, const JointVector& q,
                                         const JointVector& qd = {});
  virtual ~MujocoArm() = default;

  /// Number of coordinates. An elastic joint has two, one after the other: the drive, and the
  /// link's deflection from it, whose torque is the gear's own.
  virtual int dof() const = 0;
  virtual double time() const = 0;  ///< since the start, s
  virtual JointVector position() const = 0;
  virtual JointVector velocity() const = 0;
  virtual sim::Pose tip_pose() const = 0;
  virtual sim::Vector6 tip_twist() const = 0;  ///< linear, then angular, in the base's axes
  virtual double kinetic_energy() const = 0;   ///< J
  /// Returns the acceleration that a torque causes now.
  virtual JointVector acceleration(const JointVector& torque) = 0;

  /// Continues at q with the velocity qd.
  virtual void place(const JointVector& q, const JointVector& qd) = 0;
  /// Moves for so long with a torque. Throws std::runtime_error if the motion diverges.
  virtual void step(const JointVector& torque, double seconds) = 0;
  /// A force (N, in the base's axes) acts from now on at a point of a joint's body (m, in the
  /// body's frame; see sim::Joint); zero ends it.
  virtual void push(int joint, const Eigen::Vector3d& point, const Eigen::Vector3d& force) = 0;
};

}  // namespace dashpot::testing
