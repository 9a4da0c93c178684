#pragma once
#include <dashpot/controller/robot_types.hpp>

#include <limits>
#include <vector>

namespace dashpot::controller {

/// Terms that are added to springs and dampers. A term that is off costs nothing.
struct FeedForward {
  bool gravity = true;  ///< off where the robot compensates gravity itself
  /// C(q, qd) qd, at the measured state. With it the loop is M qdd + D qd + K e = external torque
  /// at any speed, the loop whose modes are analysed. But the energy of the loop then changes by
  /// -qd' (D - 1/2 dM/dt) qd, so that the loop is passive only as long as D - 1/2 dM/dt is positive
  /// semidefinite. Without this term the energy changes by -qd' D qd, and the loop is passive at
  /// any speed; see docs/energy.md.
  bool coriolis = true;
  bool friction = false;     ///< the model's viscous and Coulomb friction
  bool acceleration = true;  ///< M times the acceleration of the reference
  bool wrench = true;        ///< J' times the wrench of the set-point

  /// The velocity at which friction is compensated.
  enum class FrictionAt : std::uint8_t {
    kReference,  ///< the reference's: it adds no feedback
    kMeasured,   ///< the joints' own: a feedback that takes damping away, see `friction_share`
  } friction_at = FrictionAt::kReference;
  /// At the measured velocity v the torque is friction_share (viscous v + coulomb tanh(v /
  /// friction_rise)). With a share of at most 1 it gives no more power than the friction of the
  /// model takes, whatever the velocity, and none at rest. Its slope at rest, friction_share
  /// (viscous + coulomb / friction_rise), is taken from the damping in the modes, where Coulomb
  /// friction does not count.
  double friction_share = 0.8;
  double friction_rise = 0.1;  ///< rad/s (m/s)
};

/// Integral action: springs that are held away from their reference pull harder and harder. It adds
/// joint torques t and a wrench f (at the tip, in B's axes), which grow within their bounds by
///     dt/dt = K_q (q_d - q) / time,    df/dt = K_C e / time.
/// SpringIntegral says when they stand still, and when they fade.
struct Integral {
  double time = 0;  ///< about the time constant of the slow modes that it makes, s; 0: no integral
  double force = 10;   ///< |f| of the force, N
  double moment = 1;   ///< |f| of the moment, N m
  JointVector torque;  ///< |t_i|, n, N m
};

/// Where the energy comes from that growing stiffness, moving references and feed-forward put in.
struct Energy {
  enum class From : std::uint8_t {
    kFree,  ///< from the motors, without a bound
    kTank,  ///< from what is stored, and what dampers took out: see EnergyTank
  } from = From::kFree;
  double store = 10;  ///< that the controller may give beyond what it took, J
};

/// How the wrench f that the world exerts on the tip, RobotState::external_wrench, moves with the
/// arm, for the analysis. closed_loop.hpp says which stiffness each of them adds.
enum class Load : std::uint8_t {
  kIgnored,       ///< the springs are at rest
  kBaseWrench,    ///< f is constant in B's axes: a weight at the tip, a steady push
  kToolWrench,    ///< f is constant in T's axes: a grinder, a jet
  kJointTorques,  ///< J' f is constant: torques at the joints
};

/// Terms of the task-space law that most controllers leave out.
struct TaskTerms {
  Load load = Load::kIgnored;
  bool jacobian_rate = false;  ///< J' C_C Jdot, in the analysis
};

/// Springs and dampers that act on the arm in addition to the controller's: of a contact, of a
/// cable, of the drives. They count in the modes. GainJudge and the design of damping for a ratio
/// ignore them. Entries are not negative.
struct Environment {
  Vector6 tip_stiffness = Vector6::Zero();  ///< in B's axes, N/m, N m/rad
  Vector6 tip_damping = Vector6::Zero();    ///< N s/m, N m s/rad
  JointVector joint_stiffness;              ///< n, N m/rad
  JointVector joint_damping;                ///< n, N m s/rad

  bool none() const noexcept {
    return tip_stiffness.isZero(0) && tip_damping.isZero(0) && joint_stiffness.isZero(0) &&
           joint_damping.isZero(0);
  }
};

/// Limits of how fast references and gains change. On the way to a new set-point the reference
/// accelerates at these limits and brakes at half of them.
struct Motion {
  JointVector velocity;               ///< of the joint reference, n, rad/s, positive
  JointVector acceleration;           ///< n, rad/s^2, positive
  double linear_velocity = 0.5;       ///< of the tip reference, m/s
  double linear_acceleration = 2.0;   ///< m/s^2
  double angular_velocity = 1.5;      ///< rad/s
  double angular_acceleration = 6.0;  ///< rad/s^2
  double smoothing = 0.03;  ///< time over which the reference's acceleration changes, s; at most
                            ///< kMostSmoothing periods; less than a period counts as one
  double gain_time = 0.5;   ///< duration of a change of gains, wrench or mode, s
};

inline constexpr double kMostSmoothing = 256;  ///< periods

/// A plane that the tip must not cross, in B's axes. The side to which `normal` points is free.
struct Wall {
  Eigen::Vector3d point = Eigen::Vector3d::Zero();    ///< of the plane, m
  Eigen::Vector3d normal = Eigen::Vector3d::UnitZ();  ///< of length 1

  /// Returns how far a point is in front of the wall, m; negative beyond it.
  double distance(const Eigen::Vector3d& p) const noexcept { return normal.dot(p - point); }
};

/// Limits of torque and motion. SafetyFilter and MotionWatch enforce them.
struct Limits {
  JointVector torque;          ///< n, N m, positive
  JointVector torque_rate;     ///< n, N m/s, positive
  JointVector velocity;        ///< n, rad/s, positive
  double tip_velocity = 1.5;   ///< of the tip's origin, m/s, positive
  JointVector position_lower;  ///< n, rad; -infinity if there is none
  JointVector position_upper;  ///< n, rad; infinity if there is none
  /// Time constant with which the brake stops the arm, s: at a fault, and, five times as fast,
  /// before a joint exceeds its limits of velocity and position. It is longer if the sampled loop
  /// does not tolerate such a hard brake. See Brake.
  double stopping_time = 0.05;
  /// Error clamp: the Cartesian springs are extended no further than this, m and rad, however far
  /// away the goal is. Beyond it they pull no harder, and the reference waits for the robot (see
  /// TipReference). So that it can brake within the clamp, a reference moves at most with
  /// sqrt(acceleration * clamp).
  double linear_error = 0.3;
  double angular_error = 1.0;
  /// Largest power of the torque in excess of the weight, W; infinity: any. A larger power is
  /// scaled down, in all joints alike.
  double power = std::numeric_limits<double>::infinity();
  /// External torque of a joint (n, N m) that counts as a collision; infinity: none does. The
  /// torque is estimated from the motion, and so contains friction that the model does not know.
  JointVector external_torque;
  /// Force in RobotState::external_wrench that counts as a collision, N; infinity: none does.
  double external_force = std::numeric_limits<double>::infinity();
  std::vector<Wall> walls;  ///< at most kMaxWalls
  /// Hosts refuse gains with which the sampled loop would be unstable, or would become so with all
  /// gains multiplied by a factor of up to this; 1 accepts all gains. See GainJudge. Controller
  /// itself takes any gains, and lowers damping ratios with which the loop does not keep this
  /// margin; 1 lowers none. See DesignedDamping.
  double gain_margin = 2;
  /// Whether settings beyond the model's limits, and lengths, angles and times that no arm needs,
  /// are accepted. See validate.
  bool beyond_model = false;
};

inline constexpr std::size_t kMaxWalls = 8;

/// Times after which input is too old to act on.
struct Watchdog {
  double setpoint_hold = 0.5;  ///< age of a set-point from which on the output is hold, s; 0: never
  double setpoint_damp = 2.0;  ///< age from which on the output is damp, s; 0: never
  double longest_gap = 0.01;   ///< longest time between two good states, s; a longer gap is a fault
  /// Time over which states are checked against each other, s; 0: no check. Positions are compared
  /// with velocities over about this time. A state that does not change at all is noticed after two
  /// fifths of it.
  double feedback = 0.5;
  /// The torque that acts at the start may differ from the weight by this share of the weight's
  /// largest entry, beside friction; infinity: by any amount. See start_fault.
  double start_torque = 0.25;
  double release_after = 0;  ///< time at rest after which faults are released, s; 0: never
};

/// The vibration analysis beside the law.
struct Analysis {
  enum class Where : std::uint8_t {
    kOff,
    kInline,      ///< within the tick
    kBackground,  ///< on a thread of its own, one tick later or when the thread has time
  } where = Where::kInline;
  int every = 1;  ///< ticks between two analyses, at least 1
  /// Share of a period that the analysis within a tick may take, above 0 and at most 1. A task that
  /// needs more continues on a thread of its own, and the status is analysis::Status::kUnfinished
  /// meanwhile. Work is counted, not timed: kWorkPerSecond units of analysis::Work are a second to
  /// 15 %, by ./run bench: 4.80 us for a tick of 7 joints with 104,559 instructions. So that ticks
  /// are even, the work is at most kEvenWork (n / 7)^3 share / 10 % for n joints, the work of about
  /// ten ticks in which modes are tracked; fewer than 7 joints get the bound of 7. An elastic joint
  /// counts as two.
  double share = 0.1;
  static constexpr double kWorkPerSecond = 2.5e10;
  static constexpr double kEvenWork = 1e6;
  double soft_frequency = kSoftFrequency;  ///< modes below this are called soft, rad/s
  bool shapes = true;                      ///< whether eigenvectors are computed

  /// Analysis of the sampled loop, beside the continuous one; see SampledAnalysis.
  struct Sampled {
    static constexpr int kMostDelay = 20;  ///< ticks
    double interval = 0;                   ///< time between two analyses, s; 0: no analysis
    int delay = 0;                         ///< ticks from a torque to its effect, beyond the
                                           ///< zero-order hold
    double cutoff = 0;                     ///< of the drives' first-order low-pass, Hz; 0: none
    bool difference_velocity = false;  ///< the robot reports (q_k - q_k-1) / period for velocity
  } sampled;
};

/// Everything that is set once. Defaults stand here; `default_settings` fills in the defaults that
/// depend on the robot.
struct Settings {
  double period = 0.001;  ///< of the control loop, s
  FeedForward feed_forward;
  Integral integral;
  Energy energy;
  TaskTerms task_terms;
  JointVector null_weights;  ///< W of NullProjector::kWeighted, n, positive
  Environment environment;
  /// Whether the joints' viscous friction in the model is subtracted from damping that is designed
  /// for a ratio. Only for friction that was measured, because modes have less than the ratio if
  /// the robot has less friction.
  bool subtract_friction = false;
  Motion motion;
  Limits limits;
  Watchdog watchdog;
  Analysis analysis;
  Setpoint initial;  ///< mode and gains at the start; its positions are ignored, because the
                     ///< controller starts by keeping the robot where it is
};

}  // namespace dashpot::controller
