#pragma once
#include <dashpot/controller/types.hpp>

#include <limits>
#include <vector>

namespace dashpot::controller {

/// What is added to the springs and dampers. Each that is off costs nothing.
struct FeedForward {
  bool gravity = true;  ///< off where the robot compensates gravity itself
  /// C(q, qd) qd, as measured. With it the loop is M qdd + D qd + K e = external torque, that of
  /// the modes, at any speed; but its energy then changes by -qd' (D - 1/2 dM/dt) qd, so that it is
  /// passive only as long as D - 1/2 dM/dt is positive semidefinite. Without it the change is
  /// -qd' D qd: passive at any speed, see docs/energy.md.
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
                            ///< period, at most kMostSmoothing of them
  double gain_time = 0.5;   ///< a change of gains, wrench or mode takes this long, s
};

inline constexpr double kMostSmoothing = 256;  ///< periods

/// A plane that the tip must not cross, in B's axes. The side to which `normal` points is free.
struct Wall {
  Eigen::Vector3d point = Eigen::Vector3d::Zero();    ///< of the plane, m
  Eigen::Vector3d normal = Eigen::Vector3d::UnitZ();  ///< of length 1

  /// Returns how far a point is in front of the wall, m; negative beyond it.
  double distance(const Eigen::Vector3d& p) const noexcept { return normal.dot(p - point); }
};

/// Bounds that the torque and the robot keep to. See SafetyFilter and MotionWatch, which hold them.
struct Limits {
  JointVector torque;           ///< n, N m, positive
  JointVector torque_rate;      ///< n, N m/s, positive
  JointVector velocity;         ///< n, rad/s, positive
  double tip_velocity = 1.5;    ///< of the tip's origin, m/s, positive
  JointVector position_lower;   ///< n, rad; -infinity if there is none
  JointVector position_upper;   ///< n, rad; infinity if there is none
  JointVector position_margin;  ///< repulsion begins this far before a position limit, n, rad
  /// Its torque at the limit, as a fraction of the torque limit; less where that would make it
  /// vibrate, or push a joint back faster than a tenth of its velocity limit.
  double repulsion = 0.5;
  JointVector return_velocity;  ///< with which a joint outside its limits returns, n, rad/s; 0: not
  /// The Cartesian springs are drawn out no further than this, m and rad, however far away the goal
  /// is: beyond it they pull no harder, and their path waits for the robot (see TipReference). A
  /// path that is to brake within this is no faster than sqrt(acceleration times it).
  double linear_error = 0.3;
  double angular_error = 1.0;
  /// Of the safe output "damp", n, N m s/rad, positive; less where the sampled loop would not bear
  /// it.
  JointVector damping;
  /// Most power of all that exceeds the weight, W; infinity: any. More is scaled down evenly.
  double power = std::numeric_limits<double>::infinity();
  /// External torque of a joint (n, N m) that counts as a collision; infinity: none does. It is
  /// estimated from the motion, and so contains the friction that the model does not know.
  JointVector external_torque;
  /// The same of the force in RobotState::external_wrench, N.
  double external_force = std::numeric_limits<double>::infinity();
  std::vector<Wall> walls;  ///< at most kMaxWalls
  /// Gains are refused if the sampled loop is unstable with them grown by this factor or less; 1
  /// accepts all. See GainJudge.
  double gain_margin = 2;
};

inline constexpr std::size_t kMaxWalls = 8;

/// When input is too old to act on.
struct Watchdog {
  double setpoint_hold = 0.5;  ///< a set-point older than this: hold, s; 0: never
  double setpoint_damp = 2.0;  ///< older than this: damp, s; 0: never
  double longest_gap = 0.01;   ///< between two good states, s; a longer one is a fault
  /// States are checked against each other over about so long, s: positions against velocities, and
  /// for two fifths of it whether they change at all; 0: not
  double feedback = 0.5;
  double release_after = 0;  ///< faults are released after a rest of so long, s; 0: never
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
  /// not timed: kWorkPerSecond units of analysis::Work are a second, as ./run bench has it: 5.05 us
  /// for a tick of 7 joints with 130,000 instructions. And so that ticks are even, it is at most
  /// kEvenWork (n / 7)^3 share / 10 % for n joints, about ten ticks in which modes are followed.
  double share = 0.1;
  static constexpr double kWorkPerSecond = 2.5e10;
  static constexpr double kEvenWork = 1e6;
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

}  // namespace dashpot::controller
