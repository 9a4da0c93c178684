#pragma once
// Plain data, input and output of the controller. Frames: B is the base link, T the tip (the
// tool's frame). p_BT_B is the position of T in B, expressed in B's axes; R_BT turns T's axes into
// B's. Twists and wrenches have the linear part first, are taken at the tip, in B's axes.

#include <dashpot/analysis/matrix_types.hpp>

#include <Eigen/Core>
#include <array>
#include <cstdint>
#include <limits>
#include <string_view>
#include <utility>

namespace dashpot::controller {

/// Largest number of joints of the controller.
inline constexpr int kMaxJoints = analysis::kMaxDof;

/// n entries, one for each joint, from the base to the tip; rad (m for a prismatic joint), rad/s,
/// N m, ...
using JointVector = analysis::Vector<kMaxJoints>;
/// n x n
using JointMatrix = analysis::Square<kMaxJoints>;
/// 6 x n: the tip's twist is J qd
using Jacobian = Eigen::Matrix<double, 6, Eigen::Dynamic, Eigen::ColMajor, 6, kMaxJoints>;
using Vector6 = Eigen::Matrix<double, 6, 1>;
using Matrix6 = Eigen::Matrix<double, 6, 6>;

/// Position and orientation of a frame in the base link: p_BT_B in m, and R_BT.
struct Pose {
  Eigen::Vector3d position = Eigen::Vector3d::Zero();
  Eigen::Matrix3d rotation = Eigen::Matrix3d::Identity();
};

/// Returns diag(R, R) diag(mask) diag(R, R)' a, the part of the vector a (in B's axes) in the
/// directions `mask` of the frame with the axes R.
inline Vector6 part_along(const Vector6& mask, const Eigen::Matrix3d& R,
                          const Vector6& a) noexcept {
  Vector6 result;
  result.head<3>() = R * mask.head<3>().cwiseProduct(R.transpose() * a.head<3>());
  result.tail<3>() = R * mask.tail<3>().cwiseProduct(R.transpose() * a.tail<3>());
  return result;
}

/// A body that the tip carries, in the axes of the tip link.
struct Payload {
  double mass = 0;                                    ///< kg
  Eigen::Vector3d center = Eigen::Vector3d::Zero();   ///< of mass, from the tip link's origin, m
  Eigen::Matrix3d inertia = Eigen::Matrix3d::Zero();  ///< about the centre of mass, kg m^2
};

/// Limits of the tip's speed, below the settings' limits; infinity: the limits of the settings.
struct TipSpeed {
  static constexpr double kLeast = 1e-4;  ///< m/s and rad/s: less is as good as none, or a mistake
  double linear = std::numeric_limits<double>::infinity();   ///< to which references take it, m/s
  double angular = std::numeric_limits<double>::infinity();  ///< likewise, rad/s
  double limit = std::numeric_limits<double>::infinity();    ///< Limits::tip_velocity, m/s
  bool operator==(const TipSpeed&) const = default;
};

/// What the robot reports at the beginning of a tick.
struct RobotState {
  std::int64_t time = 0;  ///< ns, of any clock that does not run backward
  JointVector position;   ///< rad or m
  JointVector velocity;   ///< rad/s or m/s
  /// Wrench that the world exerts on the tip, N and N m; known or estimated. Only K_G in the
  /// analysis and Limits::external_force use it. With Limits::external_force, a wrench that is not
  /// finite is a collision. Otherwise such a wrench is reported (Status::kWrenchNotFinite) and
  /// changes no torque.
  Vector6 external_wrench = Vector6::Zero();
};

/// Where the springs are fixed.
enum class Mode : std::uint8_t {
  kJoint,      ///< to a joint position
  kCartesian,  ///< to a pose of the tip; a redundant arm also to a posture
};

/// The projector N = I - X J through which springs and dampers of the null space act, see
/// NullSpace.
enum class NullProjector : std::uint8_t {
  kDynamic,    ///< X = M^-1 J' (J M^-1 J')^-1: nothing that acts there moves the tip
  kKinematic,  ///< X the pseudo-inverse J' (J J')^-1: a tip at rest under no load feels nothing
  kWeighted,   ///< X = W^-1 J' (J W^-1 J')^-1 with a constant diagonal W; kKinematic has W = I
  kNone,  ///< X = 0: joint springs in all directions beside the springs of the tip, on arms of any
          ///< joints
};
/// Their names, in the order of the enumerators.
inline constexpr std::array<std::pair<std::string_view, NullProjector>, 4> kNullProjectors = {
    {{"dynamic", NullProjector::kDynamic},
     {"kinematic", NullProjector::kKinematic},
     {"weighted", NullProjector::kWeighted},
     {"none", NullProjector::kNone}}};
inline constexpr std::string_view name_of(NullProjector projector) noexcept {
  return kNullProjectors[static_cast<std::size_t>(projector)].first;
}
/// Returns the projector of a name; kDynamic if there is no such name.
inline constexpr NullProjector null_projector_of(std::string_view name) noexcept {
  for (const auto& [of, projector] : kNullProjectors) {
    if (of == name) return projector;
  }
  return NullProjector::kDynamic;
}

/// The axes in which K_C, C_C and `directions` are given.
enum class Frame : std::uint8_t { kBase, kTool };

/// Natural frequency below which a damping ratio means nothing, rad/s, because one swing takes a
/// minute. The analysis calls slower modes soft unless it is set otherwise, and ratio damping gives
/// them less than their ratio.
inline constexpr double kSoftFrequency = 0.1;

inline constexpr double kLargestDampingRatio = 2;

/// Springs and dampers. All matrices are symmetric positive semidefinite.
struct Gains {
  JointMatrix joint_stiffness;  ///< n x n, N m/rad, of mode kJoint
  JointMatrix joint_damping;    ///< n x n, N m s/rad, of mode kJoint
  /// Damping ratio that every mode of mode kJoint is to have, 0 < ratio <= 2: the damping is then
  /// designed at every tick, and joint_damping acts only on joints without springs, for which there
  /// is nothing to design. 0: joint_damping acts.
  double joint_damping_ratio = 0;
  Matrix6 task_stiffness = Matrix6::Zero();  ///< K_C, N/m, N/rad and N m/rad
  Matrix6 task_damping = Matrix6::Zero();    ///< C_C, N s/m, N s/rad and N m s/rad
  /// Damping ratio that every mode of K_C is to have, 0 < ratio <= 2: C_C is then designed at every
  /// tick (see DesignedDamping), and task_damping acts only in selected directions without springs.
  /// 0: C_C is task_damping.
  double task_damping_ratio = 0;
  Frame frame = Frame::kBase;
  /// Selected directions: the task directions with springs and dampers, in the axes of `frame`. The
  /// others are as free as the self-motion of a redundant arm.
  std::array<bool, 6> directions{true, true, true, true, true, true};
  JointVector null_stiffness;  ///< n, N m/rad, toward the posture, within the free motions
  JointVector null_damping;    ///< n, N m s/rad, within the free motions
  /// Damping ratio that the free motions are to have with null_stiffness, 0 < ratio <= 2: their
  /// damping is then designed at every tick (see NullSpace::ratio_damping), and null_damping acts
  /// only if null_stiffness is zero. 0: null_damping acts. With NullProjector::kNone and a
  /// task_damping_ratio, all springs together have the task's ratio.
  double null_damping_ratio = 0;
  NullProjector null_projector = NullProjector::kDynamic;  ///< of the null space's springs, dampers
};

/// The user's command. It may change at any tick; the controller moves there smoothly. A set-point
/// is read if its time differs from the time of the last set-point.
struct Setpoint {
  std::int64_t time = 0;  ///< ns, when it was given, on the clock of RobotState::time
  Mode mode = Mode::kJoint;
  JointVector joint_position;  ///< goal of mode kJoint; posture of mode kCartesian
  /// Goal of mode kCartesian; refused there until a position is set.
  Pose tip_pose{Eigen::Vector3d::Constant(std::numeric_limits<double>::quiet_NaN()),
                Eigen::Matrix3d::Identity()};
  Vector6 wrench = Vector6::Zero();  ///< that the tip exerts in addition, N and N m
  Gains gains;
};

}  // namespace dashpot::controller
