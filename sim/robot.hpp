#pragma once
#include <dashpot/sim/dynamics/inertia.hpp>
#include <dashpot/sim/joint_types.hpp>

#include <cmath>
#include <limits>
#include <stdexcept>
#include <string>
#include <vector>

namespace dashpot::sim {

/// Thrown at set-up; the message is one line that names the file, the element and the reason.
class InvalidRobot : public std::invalid_argument {
 public:
  using std::invalid_argument::invalid_argument;
};

/// One joint with the rigid body that it moves. The body's frame stands on the joint with its z
/// axis along the joint's axis. The parent's frame is the body's frame of the previous joint, or
/// the frame of the base link.
struct Joint {
  std::string name;
  bool prismatic = false;
  Pose origin;       ///< of the body's frame in the parent's, at position 0
  Inertia inertia;   ///< in the body's frame; all links rigidly attached are in it
  double lower = 0;  ///< position limits, rad or m; infinite if there are none
  double upper = 0;
  double effort = 0;    ///< largest torque, N m or N; infinite if there is none
  double velocity = 0;  ///< largest velocity, rad/s or m/s; for information, nothing enforces it
  double reflected_inertia = 0;  ///< of the drive, kg m^2 or kg
  double viscous_friction = 0;   ///< coefficient, N m s/rad or N s/m
  double coulomb_friction = 0;   ///< torque or force, N m or N
  /// Stiffness of the gear between drive and link, N m/rad or N/m; infinite: rigid.
  double gear_stiffness = std::numeric_limits<double>::infinity();
  double gear_damping = 0;  ///< of an elastic gear, N m s/rad or N s/m

  bool elastic() const noexcept { return std::isfinite(gear_stiffness); }
  /// Returns the part of the drive's inertia that is rigid with the link, kg m^2 or kg.
  double drive_inertia_on_link() const noexcept { return elastic() ? 0 : reflected_inertia; }
};

/// Values that the file does not have, or that override its values. An empty vector: as in the
/// file.
struct RobotParameters {
  JointVector reflected_inertia;         ///< n, kg m^2; files have none, so empty is zero
  JointVector viscous_friction;          ///< n, N m s/rad
  JointVector coulomb_friction;          ///< n, N m
  JointVector gear_stiffness;            ///< n, N m/rad; infinite, and empty: rigid
  JointVector gear_damping;              ///< n, N m s/rad; empty: zero
  Inertia payload;                       ///< rigid at the tip, in the tip's axes
  Eigen::Vector3d gravity{0, 0, -9.81};  ///< m/s^2, in the axes of the file's root link
  bool accept_inertias = false;          ///< links may have principal moments below zero
};

/// A serial chain of 1 to 16 revolute, continuous or prismatic joints from a base link to a tip
/// link. The base link stands still. Fixed joints are merged. Links that hang off
/// the chain count, rigid at their zero position. Links between the root and the base only turn
/// gravity.
class Robot {
 public:
  /// Reads a URDF file. Throws InvalidRobot.
  static Robot from_file(const std::string& path, const std::string& base, const std::string& tip,
                         const RobotParameters& parameters = {});
  /// Reads a URDF text in the same way; `name` stands for the file in messages.
  static Robot from_text(const std::string& urdf, const std::string& base, const std::string& tip,
                         const RobotParameters& parameters = {}, const std::string& name = "urdf");

  /// Returns n.
  int dof() const noexcept { return static_cast<int>(joints_.size()); }
  /// Returns n and the number of elastic gears, at most kMaxJoints.
  int coordinates() const noexcept;
  const std::vector<Joint>& joints() const noexcept { return joints_; }
  /// Returns the pose of the tip link in the frame of the last joint's body.
  const Pose& tip() const noexcept { return tip_; }
  /// Attaches this body to the tip, in the tip's axes, beside the payload.
  void carry(const Inertia& load) noexcept { joints_.back().inertia = last_ + tip_ * load; }
  /// Returns the gravity, m/s^2, in the axes of the base link.
  const Eigen::Vector3d& gravity() const noexcept { return gravity_; }

 private:
  Robot() = default;

  std::vector<Joint> joints_;
  Inertia last_;  // of the last body, with the payload
  Pose tip_;
  Eigen::Vector3d gravity_ = Eigen::Vector3d::Zero();
};

}  // namespace dashpot::sim
