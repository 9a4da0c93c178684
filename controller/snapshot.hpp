#pragma once
#include <dashpot/analysis/mode.hpp>
#include <dashpot/analysis/status.hpp>
#include <dashpot/controller/status.hpp>
#include <dashpot/controller/types.hpp>

#include <limits>

namespace dashpot::controller {

/// What one tick saw and did: plain data to copy to another thread. With a status whose safe output
/// is "ramp", position and velocity are those measured, where they are numbers, and what follows
/// from them is still that of the last good state.
struct Snapshot {
  std::int64_t time = 0;       ///< ns, of the state
  std::uint64_t tick = 0;      ///< counted from 1
  std::uint64_t restarts = 0;  ///< how often the springs restarted, the first time included
  Status status = Status::kOk;
  Status fault = Status::kOk;      ///< that latched, and was not released; kOk: none
  Mode mode = Mode::kJoint;        ///< of the set-point in force
  double joint_weight = 0;         ///< share of the joint springs, 0 to 1
  double task_weight = 0;          ///< share of the Cartesian springs, 0 to 1
  JointVector position;            ///< q, n, rad
  JointVector velocity;            ///< qd, n, rad/s
  JointVector torque;              ///< put out, n, N m
  JointVector law_torque;          ///< what the law asked for before the limits, n, N m
  JointVector reference_position;  ///< where the joint springs are fixed at this tick; the rest
                                   ///< posture in mode kCartesian, n, rad
  JointVector reference_velocity;  ///< n, rad/s
  Pose tip;                        ///< p_BT_B, R_BT
  Pose reference_tip;  ///< where the Cartesian springs are fixed at this tick; the tip's
                       ///< own pose while none is in force
  Vector6 reference_twist = Vector6::Zero();  ///< its velocity, m/s and rad/s
  JointVector joint_error;                    ///< reference_position - position, n, rad
  Vector6 tip_error = Vector6::Zero();        ///< m, and rotation vector from tip to set-point, rad
  Vector6 tip_wrench = Vector6::Zero();  ///< of the Cartesian springs, dampers and feed-forward
};

/// One vibration mode of the closed loop; the terms are those of analysis::Mode.
struct VibrationMode {
  /// Number that the mode keeps as long as it can be followed; no other mode gets it meanwhile.
  std::int32_t label = 0;
  analysis::ModeKind kind = analysis::ModeKind::kUnderdamped;
  std::array<analysis::Complex, 2> eigenvalues{};  ///< 1/s
  double natural_frequency = 0;                    ///< rad/s
  double damping_ratio = 0;
  double damped_frequency = 0;         ///< rad/s
  double error_bound = 0;              ///< 1/s, proved; infinite if there is none
  double natural_frequency_bound = 0;  ///< rad/s
  double damping_ratio_bound = 0;
  /// Of the first eigenvalue, n, u^H M u = 1; empty if Analysis::shapes is off.
  analysis::ComplexVector<kMaxJoints> shape;
};

/// What the analysis did since the start or the last reset, in ticks, ...
struct VibrationCounters {
  // ... each of which counts once here, ...
  std::uint64_t tracked = 0;     ///< the modes before were refined
  std::uint64_t reused = 0;      ///< the modes before still hold within bounds that say so
  std::uint64_t direct = 0;      ///< solved directly
  std::uint64_t unchanged = 0;   ///< joints and gains did not move at all: nothing was computed
  std::uint64_t no_springs = 0;  ///< nothing vibrates: nothing was solved
  std::uint64_t failed = 0;      ///< no modes: Vibration::status says why
  std::uint64_t missed = 0;      ///< the background thread was busy with an earlier one
  // ... and what some of them could leave out.
  std::uint64_t no_zero_modes = 0;  ///< springs hold every motion: nothing to keep apart
  /// Of the tracked: the undamped modes decouple the damping, and elastic coordinates are followed
  /// alone
  std::uint64_t proportional = 0;
  std::uint64_t no_wrench = 0;  ///< K_G is on, but there is no external wrench
  std::uint64_t no_shapes = 0;  ///< nobody asks for shapes
  std::uint64_t at_rest = 0;    ///< J' C_C Jdot is on, but the robot stands still
};

/// Vibration modes of the robot with the springs and dampers of one tick.
struct Vibration {
  std::int64_t time = 0;   ///< ns, of the state it belongs to
  std::uint64_t tick = 0;  ///< 0: none yet
  JointVector position;    ///< q it belongs to, n, rad
  analysis::Status status = analysis::Status::kOk;
  analysis::SpectrumOrigin origin = analysis::SpectrumOrigin::kDirect;
  int zero_modes = 0;
  int count = 0;                                ///< of modes
  std::array<VibrationMode, kMaxJoints> modes;  ///< by falling natural frequency
  VibrationCounters counters;
  std::int64_t work = 0;  ///< done within the last tick, in units of analysis::Work
};

/// A mode of the continuous loop, and what becomes of it in the loop as it is sampled; the terms
/// are those of analysis::SampledMode.
struct SampledVibrationMode {
  analysis::ModeKind kind = analysis::ModeKind::kUnderdamped;
  double continuous_frequency = 0;  ///< natural, rad/s
  double continuous_ratio = 0;
  double natural_frequency = 0;  ///< rad/s; NaN where there is none
  double damping_ratio = 0;
  double damped_frequency = 0;  ///< rad/s
};

/// The sampled loop with the springs and dampers of one tick.
struct SampledVibration {
  std::int64_t time = 0;                            ///< ns, of the state it belongs to
  std::uint64_t tick = 0;                           ///< 0: none yet
  JointVector position;                             ///< q it belongs to, n, rad
  analysis::Status status = analysis::Status::kOk;  ///< of the continuous spectrum
  /// The loop is stable below 1; NaN if it could not be analysed.
  double spectral_radius = std::numeric_limits<double>::quiet_NaN();
  /// All gains can grow by this factor before it is unstable; NaN likewise.
  double gain_margin = std::numeric_limits<double>::quiet_NaN();
  int count = 0;                                       ///< of modes
  std::array<SampledVibrationMode, kMaxJoints> modes;  ///< by falling continuous frequency
  std::uint64_t resets = 0;                            ///< of the controller before that tick
};

}  // namespace dashpot::controller
