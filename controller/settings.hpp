#pragma once
#include <dashpot/controller/types.hpp>

namespace dashpot::controller {

/// What is added to the springs and dampers. Each that is off costs nothing.
struct FeedForward {
  bool gravity = true;       ///< off where the robot compensates gravity itself
  bool coriolis = true;      ///< C(q, qd) qd
  bool friction = false;     ///< viscous and Coulomb friction of the model's parameters
  bool acceleration = true;  ///< M times the acceleration of the moving set-point
  bool wrench = true;        ///< J' times the wrench of the set-point
};

/// Terms of the task-space law that most controllers leave out.
struct TaskTerms {
  bool geometric_stiffness = false;  ///< K_G, from RobotState::external_wrench, in the analysis
  bool jacobian_rate = false;        ///< J' C_C Jdot, in the analysis
};

/// How fast set-points and gains may move.
struct Motion {
  JointVector velocity;               ///< n, rad/s, positive
  JointVector acceleration;           ///< n, rad/s^2, positive
  double linear_velocity = 0.5;       ///< of the tip, m/s
  double linear_acceleration = 2.0;   ///< m/s^2
  double angular_velocity = 1.5;      ///< rad/s
  double angular_acceleration = 6.0;  ///< rad/s^2
  double gain_time = 0.5;             ///< a change of gains or of mode takes this long, s
};

/// Bounds that the torque and the robot keep to.
struct Limits {
  JointVector torque;            ///< n, N m, positive
  JointVector torque_rate;       ///< n, N m/s, positive
  JointVector velocity;          ///< n, rad/s, positive
  JointVector position_lower;    ///< n, rad; -infinity if there is none
  JointVector position_upper;    ///< n, rad; infinity if there is none
  double position_margin = 0.1;  ///< repulsion begins this far before a position limit, rad
  double repulsion = 0.5;        ///< its torque at the limit, as a fraction of the torque limit
};

/// When input is too old to act on.
struct Watchdog {
  double setpoint_hold = 0.5;  ///< a set-point older than this: hold, s; 0: never
  double setpoint_damp = 2.0;  ///< older than this: damp, s; 0: never
  double longest_gap = 0.01;   ///< between two states, s
};

/// The vibration analysis beside the law.
struct Analysis {
  enum class Where : std::uint8_t { kOff, kInline } where = Where::kInline;
  int every = 10;               ///< ticks between two analyses, at least 1
  double soft_frequency = 0.1;  ///< modes below this have no meaningful damping ratio, rad/s
};

/// Everything that is set once. Defaults stand here; those that depend on the robot are filled in
/// by `default_settings`.
struct Settings {
  double period = 0.001;  ///< of the control loop, s
  FeedForward feed_forward;
  TaskTerms task_terms;
  Motion motion;
  Limits limits;
  Watchdog watchdog;
  Analysis analysis;
  Setpoint initial;  ///< mode and gains from the start; its positions are ignored: the
                     ///< controller starts by holding where the robot is
};

}  // namespace dashpot::controller
