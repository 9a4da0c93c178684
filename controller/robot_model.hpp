#pragma once
#include <dashpot/controller/robot_types.hpp>

#include <array>
#include <limits>
#include <memory>
#include <stdexcept>
#include <string>
#include <vector>

namespace dashpot::controller {

/// The place where an arm with elastic joints measures its joint positions and velocities, on which
/// its springs and dampers act.
enum class PositionSensor : std::uint8_t {
  kMotor,  ///< on the motor's side of the gear, theta
  kLink,   ///< on the link's side, q
};

enum class JointType : std::uint8_t { kRevolute, kContinuous, kPrismatic };

/// Properties of a joint in a URDF. For a prismatic joint read m for rad and N for N m.
struct Joint {
  std::string name;
  JointType type = JointType::kRevolute;
  double lower = 0;             ///< rad; -infinity for a continuous joint
  double upper = 0;             ///< rad; infinity for a continuous joint
  double velocity = 0;          ///< limit, rad/s, not negative; infinity if there is none
  double effort = 0;            ///< limit, N m, not negative; infinity if there is none
  double viscous_friction = 0;  ///< viscous friction, N m s/rad
  double coulomb_friction = 0;  ///< Coulomb friction, N m
  /// Inertia of rotor and gear, as seen by the joint, and as it appears to who commands torques; kg
  /// m^2 (kg). See ModelOptions::torque_loop_inertia_ratio.
  double reflected_inertia = 0;
  double gear_stiffness = std::numeric_limits<double>::infinity();  ///< N m/rad; infinity: rigid
  double gear_damping = 0;  ///< N m s/rad, beside gear_stiffness
  // Limits that URDF has from version 1.2 on, positive; infinity if there is none.
  double acceleration = std::numeric_limits<double>::infinity();  ///< rad/s^2
  double deceleration = std::numeric_limits<double>::infinity();  ///< rad/s^2
  double jerk = std::numeric_limits<double>::infinity();          ///< rad/s^3

  bool elastic() const noexcept { return gear_stiffness < std::numeric_limits<double>::infinity(); }
};

/// What a URDF does not say, or says wrong. A vector without entries keeps the URDF's values.
struct ModelOptions {
  Eigen::Vector3d gravity{0, 0, -9.81};  ///< in axes of the URDF's root link, m/s^2
  /// Whether links off the chain (fingers, cameras) count, rigid at their zero position.
  bool include_off_chain = true;
  /// Whether inertias of links are accepted though no body can have them: with negative moments, or
  /// with one moment above the sum of the others. The mass matrix has to be positive definite even
  /// so.
  bool accept_inertias = false;
  /// Links whose inertias are accepted so, where not all are.
  std::vector<std::string> accept_inertias_of;
  JointVector reflected_inertia;  ///< n, kg m^2, which few URDFs have
  /// Name of published_drives, or of a drives file, whose reflected inertia takes the place of the
  /// URDF's; empty: none.
  std::string drives;
  bool drives_friction = false;  ///< the friction of `drives` takes the place of the URDF's
  JointVector viscous_friction;  ///< n, N m s/rad
  JointVector coulomb_friction;  ///< n, N m
  /// Stiffness of the gears, n, N m/rad, positive; infinity: rigid. An elastic joint needs a
  /// reflected inertia, which is then the inertia of a body of its own, on the motor's side. The
  /// friction of the joint acts there as well. At most kMaxJoints - n joints can be elastic.
  JointVector gear_stiffness;
  JointVector gear_damping;  ///< n, N m s/rad; of rigid joints it has no effect
  PositionSensor position_sensor = PositionSensor::kMotor;  ///< of elastic joints
  /// What a torque controller inside the drives leaves of the motors' inertia, n, above 0 and at
  /// most 1: reflected_inertia, given or of `drives`, times this is Joint::reflected_inertia. No
  /// entries: there is no such controller, or reflected_inertia is what it leaves.
  JointVector torque_loop_inertia_ratio;
  Payload payload;
  Pose tool;  ///< the tool's frame T in the tip link
};

struct Attachment;  // attachment.hpp

/// Thrown at set-up; what() is one line: "arm.urdf: joint 'elbow': mimics another joint".
class InvalidModel : public std::invalid_argument {
 public:
  using std::invalid_argument::invalid_argument;
};

/// A serial chain of 1 to 16 revolute, continuous or prismatic joints between two links of a URDF.
/// Fixed joints are merged into the link before them. Immutable; a copy shares the data.
///
/// B is the base link, which stands still wherever it is in the file's tree, because joints above
/// it keep their zero position. T is the tool's frame: the tip link, or ModelOptions::tool in it.
///
/// The mass matrix must be positive definite. Massless links are fine as long as each joint has a
/// reflected inertia or moves a mass further out.
class RobotModel {
 public:
  /// Both read a model and throw InvalidModel; `name` stands for the file in messages.
  static RobotModel from_urdf_file(const std::string& path, const std::string& base,
                                   const std::string& tip, const ModelOptions& options = {});
  static RobotModel from_urdf_text(const std::string& text, const std::string& base,
                                   const std::string& tip, const ModelOptions& options = {},
                                   const std::string& name = "URDF");

  /// Returns the robot's name in the URDF.
  const std::string& name() const noexcept;
  const std::string& base() const noexcept;
  const std::string& tip() const noexcept;

  /// Returns n, from 1 to kMaxJoints.
  int dof() const noexcept;
  /// Returns the n joints, from the base to the tip.
  const std::vector<Joint>& joints() const noexcept;
  /// Returns what is doubtful about the description though it was read, a line for each: "link
  /// 'hand': ...".
  const std::vector<std::string>& warnings() const noexcept;
  /// Returns one property of all n joints, as in `joint_values(&Joint::effort)`.
  JointVector joint_values(double Joint::*property) const;
  /// Returns the number of joints with a gear_stiffness.
  int elastic_joints() const noexcept;
  /// Returns what measures the positions of elastic joints.
  PositionSensor position_sensor() const noexcept;

  /// Returns what is attached to the tip link: ModelOptions::payload and tool, unless `with` put
  /// something else in their place.
  const Attachment& attachment() const noexcept;
  /// Returns the model with something else attached. Throws InvalidModel if a joint has no inertia
  /// without what was attached before.
  RobotModel with(const Attachment& attachment) const;
  /// Returns the model with other reflected inertia (n, kg m^2, not negative), as it appears to who
  /// commands torques. Throws InvalidModel if a joint has no inertia then.
  RobotModel with_reflected_inertia(const JointVector& inertia) const;

  /// Returns the acceleration of gravity in B's axes, m/s^2.
  const Eigen::Vector3d& gravity() const noexcept;

  /// Data of the model; kdl_chain.hpp returns its KDL::Chain.
  struct Data;
  const Data& data() const noexcept { return *data_; }

 private:
  explicit RobotModel(std::shared_ptr<const Data> data) : data_(std::move(data)) {}
  std::shared_ptr<const Data> data_;
};

/// Returns the text of the URDF at `path`, which must be a regular file. Throws InvalidModel if it
/// cannot be read.
std::string read_urdf_file(const std::string& path);

}  // namespace dashpot::controller
