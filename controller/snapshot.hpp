#pragma once
#include <dashpot/analysis/mode.hpp>
#include <dashpot/analysis/solver_status.hpp>
#include <dashpot/controller/robot_types.hpp>
#include <dashpot/controller/tick_status.hpp>

#include <limits>

namespace dashpot::controller {

/// What one tick measured and put out: plain data to copy to another thread. With a status whose
/// safe output is "ramp", position and velocity are the measured ones if they are numbers, and
/// everything computed from them belongs to the last good state.
struct Snapshot {
  std::int64_t time = 0;       ///< ns, of the state
  std::uint64_t tick = 0;      ///< counted from 1
  std::uint64_t restarts = 0;  ///< how often the springs restarted, the first time included
  Status status = Status::kOk;
  Status fault = Status::kOk;      ///< the latched fault; kOk: none
  Mode mode = Mode::kJoint;        ///< of the current set-point
  double joint_weight = 0;         ///< share of the joint springs, 0 to 1
  double task_weight = 0;          ///< share of the Cartesian springs, 0 to 1
  JointVector position;            ///< q, n, rad
  JointVector velocity;            ///< qd, n, rad/s
  JointVector torque;              ///< put out, n, N m
  JointVector law_torque;          ///< of the law, or of "damp", before the limits, n, N m
  JointVector reference_position;  ///< where the joint springs are fixed at this tick; the posture
                                   ///< in mode kCartesian; position while there are no springs, n,
                                   ///< rad
  JointVector reference_velocity;  ///< n, rad/s
  Pose tip;                        ///< p_BT_B, R_BT
  Pose reference_tip;  ///< where the Cartesian springs are fixed at this tick; the tip's
                       ///< own pose while no such spring is active
  Vector6 reference_twist = Vector6::Zero();  ///< velocity of reference_tip, m/s and rad/s
  JointVector joint_error;                    ///< reference_position - position, n, rad
  Vector6 tip_error = Vector6::Zero();   ///< from tip to reference: m, and rotation vector, rad
  Vector6 tip_wrench = Vector6::Zero();  ///< of the Cartesian springs, dampers and feed-forward,
                                         ///< and of their integral
  /// What the integral of the springs has stored: t (n, N m) and f, see Integral.
  JointVector integral_torque;
  Vector6 integral_wrench = Vector6::Zero();
  /// Damping ratios for which the damping of the active springs is designed; 0: it is given.
  double joint_damping_ratio = 0, task_damping_ratio = 0;
  /// Smallest share of its damping ratio that the sampled loop leaves a mode, of the ratios above
  /// and of the null space's: above 0, and 1 if the loop keeps its margin with all ratios.
  double damping_level = 1;
  double energy_store = std::numeric_limits<double>::infinity();  ///< S of EnergyTank, J; infinite
                                                                  ///< without a tank
  double spring_share = 1;  ///< of the springs' torque that the energy in the tank allows
  Payload payload;          ///< at this tick, on its way to the argument of Controller::attach
  Pose tool;                ///< likewise: T in the tip link
};

/// One vibration mode of the closed loop; analysis::Mode explains the terms.
struct VibrationMode {
  /// Number of the mode, which it keeps as long as it can be followed. No other mode has this
  /// number meanwhile.
  std::int32_t label = 0;
  analysis::ModeKind kind = analysis::ModeKind::kUnderdamped;
  std::array<analysis::Complex, 2> eigenvalues{};  ///< 1/s
  double natural_frequency = 0;                    ///< rad/s
  double damping_ratio = 0;
  double damped_frequency = 0;         ///< rad/s
  double error_bound = 0;              ///< 1/s, proved; infinite if there is none
  double natural_frequency_bound = 0;  ///< rad/s
  double damping_ratio_bound = 0;
  /// Mode shape u of the first eigenvalue, n, u^H M u = 1; empty if Analysis::shapes is off.
  analysis::ComplexVector<kMaxJoints> shape;
};

/// What the analysis did since the start or the last reset, as numbers of ticks.
struct VibrationCounters {
  // Each tick that is to be analysed counts once in these:
  std::uint64_t tracked = 0;     ///< the last modes were refined
  std::uint64_t reused = 0;      ///< the last modes, because the system is the same to the last bit
  std::uint64_t direct = 0;      ///< the modes were solved directly
  std::uint64_t unchanged = 0;   ///< joints and gains did not move at all, so nothing was computed
  std::uint64_t no_springs = 0;  ///< nothing vibrates, so nothing was solved
  std::uint64_t failed = 0;      ///< there are no modes; Vibration::status says why
  std::uint64_t missed = 0;      ///< the background thread was busy with an earlier task
  // What some of these ticks could leave out:
  std::uint64_t no_zero_modes = 0;  ///< springs resist every motion: no zero modes to keep apart
  std::uint64_t no_wrench = 0;      ///< a load is on, but no external wrench
  std::uint64_t no_shapes = 0;      ///< the settings ask for no shapes
  std::uint64_t at_rest = 0;        ///< J' C_C Jdot is on, but the robot stands still
};

/// Vibration modes of the robot with the springs and dampers of one tick.
struct Vibration {
  std::int64_t time = 0;   ///< of the state that the modes belong to, ns
  std::uint64_t tick = 0;  ///< of that state; 0: no modes yet
  JointVector position;    ///< of that state, n, rad
  analysis::Status status = analysis::Status::kOk;
  analysis::SpectrumOrigin origin = analysis::SpectrumOrigin::kDirect;
  int zero_modes = 0;
  int count = 0;                                ///< of modes
  std::array<VibrationMode, kMaxJoints> modes;  ///< by falling natural frequency
  VibrationCounters counters;
  std::int64_t work = 0;  ///< done within the last tick, in units of analysis::Work
};

/// A mode of the continuous loop, and the same mode in the sampled loop; analysis::SampledMode
/// explains the terms.
struct SampledVibrationMode {
  analysis::ModeKind kind = analysis::ModeKind::kUnderdamped;
  double continuous_frequency = 0;  ///< natural frequency of the continuous loop, rad/s
  double continuous_ratio = 0;
  double natural_frequency = 0;  ///< of the sampled loop, rad/s; NaN if there is none
  double damping_ratio = 0;
  double damped_frequency = 0;  ///< rad/s
};

/// The sampled loop with the springs and dampers of one tick.
struct SampledVibration {
  std::int64_t time = 0;                            ///< of the state analysed, ns
  std::uint64_t tick = 0;                           ///< of that state; 0: no result yet
  JointVector position;                             ///< of that state, n, rad
  analysis::Status status = analysis::Status::kOk;  ///< of the continuous spectrum
  /// The loop is stable below 1; NaN if it could not be analysed.
  double spectral_radius = std::numeric_limits<double>::quiet_NaN();
  /// All gains can grow by this factor before the loop is unstable; NaN if it could not be
  /// analysed.
  double gain_margin = std::numeric_limits<double>::quiet_NaN();
  std::uint32_t assumes = 0;                           ///< see assumption_bits
  int count = 0;                                       ///< of modes
  std::array<SampledVibrationMode, kMaxJoints> modes;  ///< by falling continuous frequency
  /// Eigenvalues that the integral of the springs makes, 1/s, SampledSpectrum::memory
  int integral_count = 0;
  std::array<analysis::Complex, kMaxJoints> integrals{};
  std::uint64_t resets = 0;  ///< of the controller before `tick`
};

}  // namespace dashpot::controller
