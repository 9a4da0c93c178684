#pragma once
#include <dashpot/controller/types.hpp>

#include <stdexcept>
#include <string>
#include <utility>

namespace dashpot::controller {

class RobotModel;

/// What is added to the springs and dampers. Each that is off costs nothing.
struct FeedForward {
  bool gravity = true;  ///< off where the robot compensates gravity itself
  /// C(q, qd) qd, as measured. With it the loop is M qdd + D qd + K e = external torque, that of
  /// the modes, at any speed; but its energy then changes by -qd' (D - 1/2 dM/dt) qd, so that it is
  /// passive only as long as D - 1/2 dM/dt is positive semidefinite. Without it the change is
  /// -qd' D qd: passive at any speed, see README.
  bool coriolis = true;
  bool friction = false;     ///< the model's viscous and Coulomb friction, at the velocity of the
                             ///< moving set-point: it adds no feedback
  bool acceleration = true;  ///< M times the acceleration of the moving set-point
  bool wrench = true;        ///< J' times the wrench of the set-point
};

/// Terms of the task-space law that most controllers leave out.
struct TaskTerms {
  bool geometric_stiffness = false;  ///< K_G, from RobotState::external_wrench, in the analysis
  bool jacobian_rate = false;        ///< J' C_C Jdot, in the analysis
};

/// How fast set-points and gains may move. The path to a new set-point accelerates at these limits
/// and brakes at half of them.
struct Motion {
  JointVector velocity;               ///< of the joint set-point, n, rad/s, positive
  JointVector acceleration;           ///< n, rad/s^2, positive
  double linear_velocity = 0.5;       ///< of the tip, m/s
  double linear_acceleration = 2.0;   ///< m/s^2
  double angular_velocity = 1.5;      ///< rad/s
  double angular_acceleration = 6.0;  ///< rad/s^2
  double smoothing = 0.03;  ///< acceleration of a path changes over this time, s; at least one
                            ///< period, at most 256
  double gain_time = 0.5;   ///< a change of gains, wrench or mode takes this long, s
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
  /// The Cartesian springs are drawn out no farther than this, m and rad, however far away the goal
  /// is: beyond it they pull no harder, and their path waits for the robot (see TipPath). A path
  /// that is to brake within this is no faster than sqrt(acceleration times it).
  double linear_error = 0.3;
  double angular_error = 1.0;
  JointVector damping;  ///< of the safe output "damp", n, N m s/rad, positive
};

/// When input is too old to act on.
struct Watchdog {
  double setpoint_hold = 0.5;  ///< a set-point older than this: hold, s; 0: never
  double setpoint_damp = 2.0;  ///< older than this: damp, s; 0: never
  double longest_gap = 0.01;   ///< between two states, s
};

/// The vibration analysis beside the law.
struct Analysis {
  enum class Where : std::uint8_t {
    kOff,
    kInline,      ///< within the tick
    kBackground,  ///< on a thread of its own, one tick later or when it gets round to it
  } where = Where::kInline;
  int every = 1;  ///< ticks between two analyses, at least 1
  /// Of a period that the analysis within a tick may take, above 0 and at most 1: what needs more
  /// goes on on a thread of its own, and says so (analysis::Status::kUnfinished). It is counted,
  /// not timed: kWorkPerSecond units of analysis::Work are a second.
  double share = 0.1;
  static constexpr double kWorkPerSecond = 1e10;
  double soft_frequency = kSoftFrequency;  ///< modes below this are called soft, rad/s
  bool shapes = true;                      ///< with eigenvectors

  /// The modes of the loop as it runs, beside the continuous ones; see SampledAnalysis.
  struct Sampled {
    double interval = 0;               ///< between two analyses, s; 0: none
    int delay = 0;                     ///< ticks from a torque to its effect, beyond the hold
    double cutoff = 0;                 ///< of the drives' first-order low-pass, Hz; 0: none
    bool difference_velocity = false;  ///< the robot reports (q_k - q_k-1) / period for velocity
  } sampled;
};

/// Everything that is set once. Defaults stand here; those that depend on the robot are filled in
/// by `default_settings`.
struct Settings {
  double period = 0.001;  ///< of the control loop, s
  FeedForward feed_forward;
  TaskTerms task_terms;
  /// Whether the joints' viscous friction, as the model has it, is taken off the damping that holds
  /// a ratio. Only where it is measured: if the robot has less, its modes have less than the ratio.
  bool subtract_friction = false;
  Motion motion;
  Limits limits;
  Watchdog watchdog;
  Analysis analysis;
  Setpoint initial;  ///< mode and gains from the start; its positions are ignored: the
                     ///< controller starts by holding where the robot is
};

/// Thrown at set-up; `key` names the setting, such as "limits.torque" or
/// "initial.gains.task_stiffness".
class InvalidSettings : public std::invalid_argument {
 public:
  InvalidSettings(std::string key, const std::string& reason)
      : std::invalid_argument(key + ": " + reason), key_(std::move(key)) {}
  const std::string& key() const noexcept { return key_; }

 private:
  std::string key_;
};

/// Settings for a robot. Limits of torque, velocity and position are those of its URDF (100 N m,
/// 2 rad/s and none where the URDF has none), torque changes by at most 1000 N m/s (fully within 10
/// ms where that is slower), set-points move at a quarter of the velocity limits. Gains suit the
/// robot's inertia: 1.5 Hz and a damping ratio of 0.7 for each joint alone in the middle of its
/// range, and 2 N m s/rad, 40 N s/m at the tip, or less where its inertia is too small for that
/// anywhere, with stiffness 10/s times that.
Settings default_settings(const RobotModel& model);

/// Throws InvalidSettings, with key, value and unit, unless all sizes are n, all numbers are finite
/// and in their ranges, and all gains are symmetric positive semidefinite.
void validate(const Settings& settings, int n);

}  // namespace dashpot::controller
