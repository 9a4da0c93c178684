#pragma once
#include <dashpot/analysis/spectrum.hpp>
#include <dashpot/controller/status.hpp>
#include <dashpot/controller/types.hpp>

namespace dashpot::controller {

/// What one tick saw and did: plain data to copy to another thread.
struct Snapshot {
  std::int64_t time = 0;       ///< ns, of the state
  std::uint64_t tick = 0;      ///< counted from 1
  std::uint64_t restarts = 0;  ///< how often the springs started afresh, the first time included
  Status status = Status::kOk;
  Mode mode = Mode::kJoint;       ///< of the set-point in force
  double joint_weight = 0;        ///< share of the joint springs, 0 to 1
  double task_weight = 0;         ///< share of the Cartesian springs, 0 to 1
  JointVector position;           ///< q, n, rad
  JointVector velocity;           ///< qd, n, rad/s
  JointVector torque;             ///< put out, n, N m
  JointVector law_torque;         ///< what the law asked for before the limits, n, N m
  JointVector setpoint_position;  ///< where the joint springs are fixed at this tick; the rest
                                  ///< posture in mode kCartesian, n, rad
  JointVector setpoint_velocity;  ///< n, rad/s
  Pose tip;                       ///< p_BT_B, R_BT
  Pose setpoint_tip;              ///< where the Cartesian springs are fixed at this tick; the tip's
                                  ///< own pose while none is in force
  Vector6 setpoint_twist = Vector6::Zero();  ///< its velocity, m/s and rad/s
  JointVector joint_error;                   ///< setpoint_position - position, n, rad
  Vector6 tip_error = Vector6::Zero();       ///< m, and rotation vector from tip to set-point, rad
  Vector6 tip_wrench = Vector6::Zero();      ///< of the Cartesian springs, dampers and feed-forward
};

/// One vibration mode of the closed loop; the terms are those of analysis::Mode.
struct VibrationMode {
  std::array<analysis::Complex, 2> eigenvalues{};  ///< 1/s
  double natural_frequency = 0;                    ///< rad/s
  double damping_ratio = 0;
  double damped_frequency = 0;  ///< rad/s
  analysis::ModeKind kind = analysis::ModeKind::kUnderdamped;
  analysis::ComplexVector<kMaxJoints> shape;  ///< n, u^H M u = 1
  double backward_error = 0;
  double error_bound = 0;              ///< 1/s, proved; infinite if there is none
  double natural_frequency_bound = 0;  ///< rad/s
  double damping_ratio_bound = 0;
};

/// Vibration modes of the robot with the springs and dampers of one tick.
struct Vibration {
  std::int64_t time = 0;   ///< ns, of the state it belongs to
  std::uint64_t tick = 0;  ///< 0: none yet
  JointVector position;    ///< q it belongs to, n, rad
  analysis::Status status = analysis::Status::kOk;
  int zero_modes = 0;
  int count = 0;  ///< of modes
  std::array<VibrationMode, kMaxJoints> modes;
};

}  // namespace dashpot::controller
