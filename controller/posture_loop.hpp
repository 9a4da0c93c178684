#pragma once
#include <dashpot/analysis/sampled_loop.hpp>
#include <dashpot/controller/elastic_joints.hpp>
#include <dashpot/controller/law/designed_damping.hpp>
#include <dashpot/controller/settings.hpp>
#include <dashpot/controller/tick_status.hpp>

#include <cstdint>
#include <string>
#include <vector>

namespace dashpot::controller {

/// When the torques of a controller act on an arm, and which past states they use. Omitted effects,
/// and values that a model lacks, are named by loop_assumptions.
struct LoopTiming {
  double period = 0;  ///< of the control loop, s; zero: the loop is taken for continuous
  int delay = 0;      ///< ticks from a torque to its effect, beyond the hold
  double cutoff = 0;  ///< of a first-order low-pass on the torque, Hz; 0: none
  bool difference_velocity = false;  ///< the controller uses (q_k - q_k-1) / period as velocity
  /// Time of the integral of the springs of task or joints, s: their pull adds up to a torque or
  /// wrench that grows by pull / integral_time (see Integral::time). 0: none.
  double integral_time = 0;
  /// False: the torque against gravity comes as late as all torque. True: gravity is compensated
  /// without delay, such as by the robot itself.
  bool ideal_gravity = false;
};

/// Returns the timing that settings describe. Gravity that the controller does not compensate is
/// left to the robot, without delay.
LoopTiming timing_of(const Settings& settings);

/// Gives settings this timing; without a period they keep theirs.
void set_timing(const LoopTiming& timing, Settings& settings);

/// Returns the loop with this timing, without its gravity where that is ideal.
analysis::SampledLoop timed(const LoopTiming& timing, analysis::SampledLoop loop);

/// Returns what a closed loop leaves out that an arm may have, as a sum of powers of two, one for
/// each of assumption_names; it is the same in all commands. `model` is null if only matrices are
/// known.
std::uint32_t assumption_bits(const LoopTiming& timing, const RobotModel* model);

/// Returns the short names that docs/concepts.md explains: "gravity ideal", "rotors unknown".
std::vector<std::string> assumption_names(std::uint32_t bits);

/// Returns the names of what a loop leaves out.
inline std::vector<std::string> loop_assumptions(const LoopTiming& timing,
                                                 const RobotModel* model) {
  return assumption_names(assumption_bits(timing, model));
}

/// Motions slower than this, rad/s, do not count in a gain margin: they are self-motions fed by the
/// compensation of gravity through a zero-order hold, and do not vibrate.
inline constexpr double kSlowestVibration = 1;

/// Returns dg/dq (n x n, N m/rad) of the gravity torque g(q), by central differences, with a
/// relative error of 1e-9. Allocates.
Eigen::MatrixXd gravity_gradient(const DynamicsKernel& kernel, const JointVector& q);

/// Returns the springs and dampers of an environment, and of a load that adds `load_stiffness`.
PassivePart passive_part(const Jacobian& J, const Environment& environment,
                         const JointMatrix& load_stiffness) noexcept;

/// Returns K_I (n x n, N m/(rad s)): the torque of the integral of these springs grows by -K_I q,
/// K_I = (K_q + J' K_C J) / time. No entries if the time is zero: there is no integral.
JointMatrix integral_stiffness(const DynamicsResult& robot, const Impedance& impedance,
                               double time) noexcept;

/// Returns the integral of springs with this K_I (n x n, N m/(rad s), symmetric positive
/// semidefinite; see integral_stiffness) as states of the loop, as many as its rank: with K_I = F
/// F',
///     w_k+1 = w_k + T F' q_k,   and the torque -F w_k.
/// None if K_I has no entries.
analysis::ControllerMemory integral_memory(const Eigen::MatrixXd& K_I, double period);

/// Returns the rates, 1/s, at which the slow modes of the integral decay, the slowest first; a
/// negative one grows.
std::vector<double> integral_decays(const analysis::SampledSpectrum& sampled, double period);

/// An arm as a sampled loop has it: all of the loop but the springs and dampers of the controller.
class SampledArm {
 public:
  SampledArm(const RobotModel& model, const LoopTiming& timing);

  /// Attaches something else to the tip link.
  void attach(const Attachment& attachment) noexcept { kernel_.attach(attachment); }
  const DynamicsKernel& kernel() const noexcept { return kernel_; }
  const LoopTiming& timing() const noexcept { return timing_; }
  const analysis::Gears& gears() const noexcept { return gears_; }
  const JointVector& friction() const noexcept { return friction_; }  ///< viscous, n, N m s/rad
  std::uint32_t assumes() const noexcept { return assumes_; }         ///< see assumption_bits

  /// Returns the loop at the posture `q` (n, rad), in joint coordinates, with what the world adds,
  /// and with the integral of the springs, see integral_stiffness.
  analysis::SampledLoop at(const JointVector& q, const PassivePart* outside = nullptr,
                           const JointMatrix& K_I = {}) const;

 private:
  DynamicsKernel kernel_;
  LoopTiming timing_;
  analysis::Gears gears_;
  JointVector friction_;
  std::uint32_t assumes_;
};

/// Returns the design of damping for ratios of springs, lowered until the sampled loop of the
/// settings, without gravity and gears, keeps Limits::gain_margin and a reserve.
DesignedDamping designed_damping(const RobotModel& model, const Settings& settings);

/// Returns N (n x n), which projects joint velocities on those that leave the tip at rest;
/// `weights` is W of the weighted projector, n, or without entries I.
JointMatrix null_projector(const DynamicsResult& robot, NullProjector projector,
                           const JointVector& weights = {}) noexcept;

/// Returns a system whose size is not bounded by the type.
analysis::System<> unbounded(const analysis::System<kMaxJoints>& system);

/// A loop at a posture, in the coordinates of its gears: M q'' + C q' + K q = f, and how it is
/// sampled.
struct LoopAt {
  analysis::System<> system;
  analysis::SampledLoop sampled;
};

/// Returns the gain margin of a loop, at most `enough`; 0 if it cannot be analysed.
double margin_up_to(const analysis::System<kMaxJoints>& system, const analysis::SampledLoop& loop,
                    double enough);

/// The closed loop that gains make at any posture, with the robot at rest there, while no loop
/// runs: the matrices of Controller::closed_loop once the gains are active, sampled as the settings
/// say.
class PostureLoop {
 public:
  /// Copies the model. The settings have to be valid. Ignores all limits but the gain margin, and
  /// all of `analysis` but the sampled loop.
  PostureLoop(const RobotModel& model, const Settings& settings);

  /// Attaches something else to the tip link.
  void attach(const Attachment& attachment) noexcept { arm_.attach(attachment); }
  /// Sets `system` to M q'' + C q' + K q = f at the posture `q` (n, rad): mass, damping, stiffness
  /// and its factor, in joint coordinates or in the coordinates of analysis::Gears, as
  /// Controller::closed_loop. The gains must have passed check_gains in this mode. The springs hold
  /// `external_wrench` (6, in B's axes, N and N m) there, which matters with TaskTerms::load only.
  /// Returns kOk, or, for an impossible q or wrench, kStateWrongSize, kStateNotFinite or
  /// kWrenchNotFinite, and then leaves `system` as it is.
  Status closed_loop(const JointVector& q, const Gains& gains, Mode mode,
                     analysis::System<kMaxJoints>& system,
                     const Vector6& external_wrench = Vector6::Zero());
  /// Returns the sampled loop of the last closed_loop, in its coordinates.
  analysis::SampledLoop sampled() const;
  /// Returns system and sampled loop. Throws std::invalid_argument where closed_loop fails.
  LoopAt at(const JointVector& q, const Gains& gains, Mode mode,
            const Vector6& external_wrench = Vector6::Zero());
  /// Returns what the sampled loop leaves of the ratios of the last closed_loop.
  const analysis::DampingLevel& level() const noexcept { return level_; }
  const SampledArm& arm() const noexcept { return arm_; }

 private:
  SampledArm arm_;
  Settings settings_;
  JointVector friction_left_;
  DesignedDamping damping_;
  // The latest closed_loop:
  analysis::DampingLevel level_;
  JointVector q_;
  PassivePart outside_;
  JointMatrix integral_;
};

}  // namespace dashpot::controller
