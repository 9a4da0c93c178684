#include <dashpot/controller/plugin/plugin_data.hpp>
#include <dashpot/controller/plugin_fields.hpp>

#include <algorithm>

namespace dashpot::controller {
namespace {

using RowMajor = Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor>;

Eigen::Map<const Eigen::VectorXd> vector(const double* data, int size) noexcept {
  return {data, size};
}

Eigen::Map<const RowMajor> square(const double* data, int size) noexcept {
  return {data, size, size};
}

/// Copies fields into the fields of C structs, matrices row by row.
struct ToC {
  template <class From, class To>
  void operator()(const From& from, To& to) const noexcept {
    if constexpr (std::is_array_v<To>) {
      Eigen::Map<RowMajor>(to, from.rows(), from.cols()) = from;
    } else {
      to = static_cast<To>(from);
    }
  }
  void shape(const VibrationMode& from, dashpot_mode& to) const noexcept {
    for (std::size_t k = 0; k < 2; ++k) {
      to.eigenvalues[k][0] = from.eigenvalues[k].real();
      to.eigenvalues[k][1] = from.eigenvalues[k].imag();
    }
    for (Eigen::Index k = 0; k < from.shape.size(); ++k) {
      to.shape_real[k] = from.shape[k].real();
      to.shape_imag[k] = from.shape[k].imag();
    }
  }
};

template <class Struct>
void start(Eigen::Index joints, Struct& out) noexcept {
  out = {};
  out.struct_size = sizeof out;
  out.joints = static_cast<std::uint32_t>(joints);
}

template <class Struct>
std::int32_t check(const Struct* given, int n) noexcept {
  if (given == nullptr) return DASHPOT_NULL_ARGUMENT;
  if (given->struct_size != sizeof(Struct)) return DASHPOT_WRONG_STRUCT_SIZE;
  if (given->joints != static_cast<std::uint32_t>(n)) return DASHPOT_WRONG_JOINTS;
  return DASHPOT_OK;
}

// The enumerators of plugin.h are the controller's.
static_assert(DASHPOT_OK == static_cast<int>(Status::kOk));
static_assert(DASHPOT_TORQUE_LIMITED == static_cast<int>(Status::kTorqueLimited));
static_assert(DASHPOT_NEAR_JOINT_LIMIT == static_cast<int>(Status::kNearJointLimit));
static_assert(DASHPOT_LITTLE_MARGIN == static_cast<int>(Status::kLittleMargin));
static_assert(DASHPOT_WRENCH_NOT_FINITE == static_cast<int>(Status::kWrenchNotFinite));
static_assert(DASHPOT_SETPOINT_REJECTED == static_cast<int>(Status::kSetpointRejected));
static_assert(DASHPOT_WEIGHT_NOT_HELD == static_cast<int>(Status::kWeightNotHeld));
static_assert(DASHPOT_SETPOINT_STALE == static_cast<int>(Status::kSetpointStale));
static_assert(DASHPOT_SETPOINT_LOST == static_cast<int>(Status::kSetpointLost));
static_assert(DASHPOT_FAULT_LATCHED == static_cast<int>(Status::kFaultLatched));
static_assert(DASHPOT_TOO_MANY_RESTARTS == static_cast<int>(Status::kTooManyRestarts));
static_assert(DASHPOT_TIME_GAP == static_cast<int>(Status::kTimeGap));
static_assert(DASHPOT_WRONG_RATE == static_cast<int>(Status::kWrongRate));
static_assert(DASHPOT_COLLISION == static_cast<int>(Status::kCollision));
static_assert(DASHPOT_INSTABILITY == static_cast<int>(Status::kInstability));
static_assert(DASHPOT_TIP_SPEED_LIMIT == static_cast<int>(Status::kTipSpeedLimit));
static_assert(DASHPOT_VELOCITY_LIMIT == static_cast<int>(Status::kVelocityLimit));
static_assert(DASHPOT_WALL == static_cast<int>(Status::kWall));
static_assert(DASHPOT_POSITION_LIMIT == static_cast<int>(Status::kPositionLimit));
static_assert(DASHPOT_STATE_FROZEN == static_cast<int>(Status::kStateFrozen));
static_assert(DASHPOT_STATE_CONTRADICTORY == static_cast<int>(Status::kStateContradictory));
static_assert(DASHPOT_TIME_BACKWARD == static_cast<int>(Status::kTimeBackward));
static_assert(DASHPOT_BRAKE_DOUBTED == static_cast<int>(Status::kBrakeDoubted));
static_assert(DASHPOT_STATE_NOT_FINITE == static_cast<int>(Status::kStateNotFinite));
static_assert(DASHPOT_STATE_WRONG_SIZE == static_cast<int>(Status::kStateWrongSize));
static_assert(DASHPOT_STATE_JUMP == static_cast<int>(Status::kStateJump));
static_assert(DASHPOT_NOT_FINITE == static_cast<int>(Status::kNotFinite));
static_assert(DASHPOT_MODE_JOINT == static_cast<int>(Mode::kJoint));
static_assert(DASHPOT_MODE_CARTESIAN == static_cast<int>(Mode::kCartesian));
static_assert(DASHPOT_UNDERDAMPED == static_cast<int>(analysis::ModeKind::kUnderdamped));
static_assert(DASHPOT_CRITICAL == static_cast<int>(analysis::ModeKind::kCritical));
static_assert(DASHPOT_OVERDAMPED == static_cast<int>(analysis::ModeKind::kOverdamped));
static_assert(DASHPOT_UNDAMPED == static_cast<int>(analysis::ModeKind::kUndamped));
static_assert(DASHPOT_UNSTABLE == static_cast<int>(analysis::ModeKind::kUnstable));
static_assert(DASHPOT_SOFT == static_cast<int>(analysis::ModeKind::kSoft));
static_assert(DASHPOT_ALTERNATING == static_cast<int>(analysis::ModeKind::kAlternating));
static_assert(DASHPOT_TRACKED == static_cast<int>(analysis::SpectrumOrigin::kTracked));
static_assert(DASHPOT_REUSED == static_cast<int>(analysis::SpectrumOrigin::kReused));
static_assert(DASHPOT_DIRECT == static_cast<int>(analysis::SpectrumOrigin::kDirect));
static_assert(DASHPOT_MAX_JOINTS == kMaxJoints);

bool ratio_fits(const double* damping, const double* ratio) noexcept {
  return ratio == nullptr || *ratio == 0 || damping == nullptr;
}

void take_ratio(const double* damping, const double* given, double& ratio) noexcept {
  if (given != nullptr) {
    ratio = *given;
  } else if (damping != nullptr) {
    ratio = 0;
  }
}

}  // namespace

RobotState to_state(const dashpot_state* given, int n, std::int64_t time) noexcept {
  RobotState state;
  state.time = time;
  if (check(given, n) != DASHPOT_OK || given->position == nullptr || given->velocity == nullptr) {
    return state;
  }
  state.time = given->time;
  state.position = vector(given->position, n);
  state.velocity = vector(given->velocity, n);
  if (given->external_wrench != nullptr) state.external_wrench = vector(given->external_wrench, 6);
  return state;
}

std::int32_t to_setpoint(const dashpot_setpoint* given, int n, std::int64_t now,
                         Setpoint& setpoint) noexcept {
  const std::int32_t problem = check(given, n);
  if (problem != DASHPOT_OK) return problem;
  const bool cartesian = given->mode == DASHPOT_MODE_CARTESIAN;
  if (!cartesian && given->mode != DASHPOT_MODE_JOINT) return DASHPOT_WRONG_VALUE;
  if (cartesian ? given->tip_position == nullptr || given->tip_rotation == nullptr
                : given->joint_position == nullptr) {
    return DASHPOT_NULL_ARGUMENT;
  }
  setpoint.time = given->time == DASHPOT_ON_ARRIVAL ? now : given->time;
  setpoint.mode = cartesian ? Mode::kCartesian : Mode::kJoint;
  setpoint.joint_position.resize(given->joint_position == nullptr ? 0 : n);
  if (given->joint_position != nullptr) setpoint.joint_position = vector(given->joint_position, n);
  setpoint.tip_pose = {};
  if (cartesian) {
    setpoint.tip_pose = {vector(given->tip_position, 3), square(given->tip_rotation, 3)};
  }
  setpoint.wrench.setZero();
  if (given->wrench != nullptr) setpoint.wrench = vector(given->wrench, 6);
  return DASHPOT_OK;
}

std::int32_t to_gains(const dashpot_gains* given, int n, Gains& gains) noexcept {
  const std::int32_t problem = check(given, n);
  if (problem != DASHPOT_OK) return problem;
  if (given->frame != nullptr && *given->frame != DASHPOT_FRAME_BASE &&
      *given->frame != DASHPOT_FRAME_TOOL) {
    return DASHPOT_WRONG_VALUE;
  }
  if (given->null_projector != nullptr &&
      (*given->null_projector < 0 || *given->null_projector > DASHPOT_PROJECTOR_NONE)) {
    return DASHPOT_WRONG_VALUE;
  }
  if (!ratio_fits(given->task_damping, given->task_damping_ratio) ||
      !ratio_fits(given->joint_damping, given->joint_damping_ratio) ||
      !ratio_fits(given->null_damping, given->null_damping_ratio)) {
    return DASHPOT_WRONG_VALUE;
  }
  take_ratio(given->task_damping, given->task_damping_ratio, gains.task_damping_ratio);
  take_ratio(given->joint_damping, given->joint_damping_ratio, gains.joint_damping_ratio);
  take_ratio(given->null_damping, given->null_damping_ratio, gains.null_damping_ratio);
  if (given->joint_stiffness != nullptr) gains.joint_stiffness = square(given->joint_stiffness, n);
  if (given->joint_damping != nullptr) gains.joint_damping = square(given->joint_damping, n);
  if (given->task_stiffness != nullptr) gains.task_stiffness = square(given->task_stiffness, 6);
  if (given->task_damping != nullptr) gains.task_damping = square(given->task_damping, 6);
  if (given->null_stiffness != nullptr) gains.null_stiffness = vector(given->null_stiffness, n);
  if (given->null_damping != nullptr) gains.null_damping = vector(given->null_damping, n);
  if (given->frame != nullptr) {
    gains.frame = *given->frame == DASHPOT_FRAME_TOOL ? Frame::kTool : Frame::kBase;
  }
  if (given->null_projector != nullptr) {
    gains.null_projector = static_cast<NullProjector>(*given->null_projector);
  }
  if (given->directions != nullptr) {
    for (std::size_t i = 0; i < 6; ++i) gains.directions[i] = given->directions[i] != 0;
  }
  return DASHPOT_OK;
}

void to_c(const DynamicsResult& dynamics, dashpot_dynamics& out) noexcept {
  start(dynamics.gravity.size(), out);
  constexpr ToC kCopy;
  kCopy(dynamics.M, out.mass);
  kCopy(dynamics.coriolis, out.coriolis);
  kCopy(dynamics.gravity, out.gravity);
  kCopy(dynamics.J, out.jacobian);
  kCopy(dynamics.Jdot_qd, out.jacobian_dot_qd);
  kCopy(dynamics.p_BT_B, out.tip_position);
  kCopy(dynamics.R_BT, out.tip_rotation);
}

void to_c(const analysis::System<kMaxJoints>& system, dashpot_closed_loop& out) noexcept {
  start(system.mass.rows(), out);
  constexpr ToC kCopy;
  kCopy(system.mass, out.mass);
  kCopy(system.damping, out.damping);
  kCopy(system.stiffness, out.stiffness);
}

void to_c(const Snapshot& snapshot, dashpot_snapshot& out) noexcept {
  start(snapshot.torque.size(), out);
  copy_fields(snapshot, out, ToC{});
}

void to_c(const Vibration& vibration, dashpot_modes& out) noexcept {
  start(vibration.position.size(), out);
  copy_fields(vibration, out, ToC{});
}

void to_c(const SampledVibration& vibration, dashpot_sampled_modes& out) noexcept {
  start(vibration.position.size(), out);
  copy_fields(vibration, out, ToC{});
}

}  // namespace dashpot::controller
