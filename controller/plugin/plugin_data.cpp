#include <dashpot/controller/plugin/plugin_data.hpp>

#include <algorithm>

namespace dashpot::controller {
namespace {

using RowMajor = Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor>;
using RowMajor3 = Eigen::Matrix<double, 3, 3, Eigen::RowMajor>;

Eigen::Map<const Eigen::VectorXd> vector(const double* data, int size) noexcept {
  return {data, size};
}

Eigen::Map<const RowMajor> square(const double* data, int size) noexcept {
  return {data, size, size};
}

template <class Vector>
void put(const Vector& from, double* to) noexcept {
  std::copy_n(from.data(), from.size(), to);
}

void put(const Pose& from, double* position, double* rotation) noexcept {
  put(from.position, position);
  Eigen::Map<RowMajor3>(rotation, 3, 3) = from.rotation;
}

/// Row by row.
template <class Matrix>
void put_rows(const Matrix& from, double* to) noexcept {
  Eigen::Map<RowMajor>(to, from.rows(), from.cols()) = from;
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

/// A damping ratio above zero stands in place of a damping matrix.
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
  if (given->directions != nullptr) {
    for (std::size_t i = 0; i < 6; ++i) gains.directions[i] = given->directions[i] != 0;
  }
  return DASHPOT_OK;
}

void to_c(const DynamicsResult& dynamics, dashpot_dynamics& out) noexcept {
  out = {};
  out.struct_size = sizeof out;
  out.joints = static_cast<std::uint32_t>(dynamics.gravity.size());
  put_rows(dynamics.M, out.mass);
  put(dynamics.coriolis, out.coriolis);
  put(dynamics.gravity, out.gravity);
  put_rows(dynamics.J, out.jacobian);
  put(dynamics.Jdot_qd, out.jacobian_dot_qd);
  put({dynamics.p_BT_B, dynamics.R_BT}, out.tip_position, out.tip_rotation);
}

void to_c(const analysis::System<kMaxJoints>& system, dashpot_closed_loop& out) noexcept {
  out = {};
  out.struct_size = sizeof out;
  out.joints = static_cast<std::uint32_t>(system.mass.rows());
  put_rows(system.mass, out.mass);
  put_rows(system.damping, out.damping);
  put_rows(system.stiffness, out.stiffness);
}

void to_c(const Snapshot& snapshot, dashpot_snapshot& out) noexcept {
  out = {};
  out.struct_size = sizeof out;
  out.joints = static_cast<std::uint32_t>(snapshot.torque.size());
  out.time = snapshot.time;
  out.tick = snapshot.tick;
  out.restarts = snapshot.restarts;
  out.status = static_cast<std::int32_t>(snapshot.status);
  out.fault = static_cast<std::int32_t>(snapshot.fault);
  out.mode = static_cast<std::int32_t>(snapshot.mode);
  put(snapshot.position, out.position);
  put(snapshot.velocity, out.velocity);
  put(snapshot.torque, out.torque);
  put(snapshot.reference_position, out.reference_joint_position);
  put(snapshot.tip, out.tip_position, out.tip_rotation);
  put(snapshot.reference_tip, out.reference_tip_position, out.reference_tip_rotation);
  put(snapshot.law_torque, out.law_torque);
  put(snapshot.tip_error, out.tip_error);
  put(snapshot.tip_wrench, out.tip_wrench);
  out.joint_damping_ratio = snapshot.joint_damping_ratio;
  out.task_damping_ratio = snapshot.task_damping_ratio;
  out.damping_level = snapshot.damping_level;
  out.payload_mass = snapshot.payload.mass;
  put(snapshot.payload.center, out.payload_center);
  put_rows(snapshot.payload.inertia, out.payload_inertia);
  put(snapshot.tool, out.tool_position, out.tool_rotation);
}

void to_c(const Vibration& vibration, dashpot_modes& out) noexcept {
  out = {};
  out.struct_size = sizeof out;
  out.joints = static_cast<std::uint32_t>(vibration.position.size());
  out.time = vibration.time;
  out.tick = vibration.tick;
  put(vibration.position, out.position);
  out.status = static_cast<std::int32_t>(vibration.status);
  out.zero_modes = static_cast<std::uint32_t>(vibration.zero_modes);
  out.count = static_cast<std::uint32_t>(vibration.count);
  out.origin = static_cast<std::int32_t>(vibration.origin);
  const VibrationCounters& counters = vibration.counters;
  out.tracked = counters.tracked;
  out.reused = counters.reused;
  out.direct = counters.direct;
  out.unchanged = counters.unchanged;
  out.no_springs = counters.no_springs;
  out.failed = counters.failed;
  out.missed = counters.missed;
  out.no_zero_modes = counters.no_zero_modes;
  out.no_wrench = counters.no_wrench;
  out.no_shapes = counters.no_shapes;
  out.at_rest = counters.at_rest;
  for (std::uint32_t i = 0; i < out.count; ++i) {
    const VibrationMode& from = vibration.modes[i];
    dashpot_mode& to = out.modes[i];
    to.natural_frequency = from.natural_frequency;
    to.natural_frequency_bound = from.natural_frequency_bound;
    to.damping_ratio = from.damping_ratio;
    to.damping_ratio_bound = from.damping_ratio_bound;
    to.damped_frequency = from.damped_frequency;
    for (std::size_t k = 0; k < 2; ++k) {
      to.eigenvalues[k][0] = from.eigenvalues[k].real();
      to.eigenvalues[k][1] = from.eigenvalues[k].imag();
    }
    to.eigenvalue_bound = from.error_bound;
    to.kind = static_cast<std::int32_t>(from.kind);
    to.label = from.label;
    for (Eigen::Index k = 0; k < from.shape.size(); ++k) {
      to.shape_real[k] = from.shape[k].real();
      to.shape_imag[k] = from.shape[k].imag();
    }
  }
}

void to_c(const SampledVibration& vibration, dashpot_sampled_modes& out) noexcept {
  out = {};
  out.struct_size = sizeof out;
  out.joints = static_cast<std::uint32_t>(vibration.position.size());
  out.time = vibration.time;
  out.tick = vibration.tick;
  put(vibration.position, out.position);
  out.spectral_radius = vibration.spectral_radius;
  out.gain_margin = vibration.gain_margin;
  out.assumes = vibration.assumes;
  out.status = static_cast<std::int32_t>(vibration.status);
  out.count = static_cast<std::uint32_t>(vibration.count);
  for (std::uint32_t i = 0; i < out.count; ++i) {
    const SampledVibrationMode& from = vibration.modes[i];
    out.modes[i] = {from.continuous_frequency,
                    from.continuous_ratio,
                    from.natural_frequency,
                    from.damping_ratio,
                    from.damped_frequency,
                    static_cast<std::int32_t>(from.kind),
                    0};
  }
}

}  // namespace dashpot::controller
