#pragma once
#include <dashpot/analysis/spectrum.hpp>
#include <dashpot/analysis/task_space.hpp>
#include <dashpot/controller/audit/audit_options.hpp>

#include <Eigen/Core>
#include <cstdint>
#include <functional>
#include <limits>
#include <optional>
#include <vector>

namespace dashpot::controller {

/// Three numbers of the loop that gains make at a posture.
struct PostureNumbers {
  /// Smallest damping ratio of the modes that are not soft. NaN if there is none.
  double smallest_ratio = std::numeric_limits<double>::quiet_NaN();
  /// Real part of the fastest eigenvalue of the continuous loop: of the eigenvalues with the
  /// smallest real part, 1/s; negative in a damped loop.
  double fastest_pole = std::numeric_limits<double>::quiet_NaN();
  /// Factor by which stiffness and damping may grow together, see analysis::gain_margin; motions
  /// slower than kSlowestVibration do not count. Infinite if a factor of 1e6 is not too much; NaN
  /// without a period, and where the eigenvalue iteration fails.
  double gain_margin = std::numeric_limits<double>::quiet_NaN();
  int zero_modes = 0;     ///< motions that no spring resists, soft ones included
  bool singular = false;  ///< there are more zero modes than joints beyond the task's directions
};

/// What the reflected inertia that the model lacks would change.
struct MissingRotors {
  /// Reflected inertia of the joints without (n, kg m^2; zero where none is needed) with which the
  /// loop has AuditOptions::margin, see enough_reflected_inertia. All zero if the loop has the
  /// margin as it is. None if nothing is missing, there is no period, or no inertia is enough.
  std::optional<JointVector> inertia;
  /// Rotors with which the arm is compared (n, kg m^2): published ones of such an arm, or
  /// `inertia`; no entries: none.
  JointVector compared;
  PostureNumbers numbers;          ///< with these rotors
  Eigen::VectorXd damping_ratios;  ///< with them, of the modes likest to those without
};

/// Returns the numbers of the continuous loop that a spectrum has.
PostureNumbers numbers_of(const analysis::Spectrum<>& spectrum);

/// A posture in full.
struct PostureAudit {
  JointVector q;                    ///< n, rad (m)
  PostureNumbers numbers;           ///< read from `spectrum`
  double smallest_ratio_bound = 0;  ///< proved bound of |computed - true|
  double fastest_pole_bound = 0;    ///< the same, 1/s
  /// Rates at which the slow modes of the integral decay in the sampled loop, 1/s, the slowest
  /// first; negative where they grow. None without an integral or a period.
  std::vector<double> integral_decays;
  analysis::Spectrum<> spectrum;  ///< as from analysis::analyze
  MissingRotors rotors;           ///< set by Audit::missing_rotors
};

/// How one number is distributed over postures. Each entry is the number at one of the postures
/// (nearest rank), so that it can be looked at there.
struct Distribution {
  double median = 0, p05 = 0, p95 = 0;
  double worst = 0;     ///< least ratio, fastest pole or least margin
  JointVector worst_q;  ///< n, rad (m); no entries if no posture has the number
  /// Largest of the proved bounds of the four entries; NaN for the gain margin, which has none.
  double bound = 0;
};

/// Many postures in short. Postures without a number (NaN) do not count in its distribution.
struct WorkspaceAudit {
  std::int64_t samples = 0;
  std::int64_t singular = 0;
  Distribution smallest_ratio;
  Distribution fastest_pole;  ///< 1/s
  Distribution gain_margin;   ///< entries are NaN without a period
};

/// Damping matrices for the stiffness of an audit.
struct DampingSuggestion {
  double ratio = 0;  ///< the ratio wanted
  /// Damping that gives every mode the ratio at one posture, see analysis::design_damping: 6 x 6 in
  /// the axes of AuditOptions::gains.frame, or n x n in mode kJoint. Positive semidefinite.
  Eigen::MatrixXd damping;
  /// Diagonal of `damping`, which makes the nearest diagonal matrix (Frobenius norm); 6, or n in
  /// mode kJoint.
  Eigen::VectorXd diagonal;
  double smallest_ratio = 0, diagonal_smallest_ratio = 0;  ///< what these give at the posture
};

/// Finds what gains really do on an arm: the modes of  M q'' + C q' + K q = 0  with
///     mode kCartesian: K = J' K_C J + N' K_0 N,  C = J' C_C J + N' C_0 N + viscous friction,
///     mode kJoint:     K = K_q,                  C = C_q + viscous friction,
/// at rest, where the springs are at rest. The gain margin counts an integral of the springs as
/// well; ratios and poles are those without it. M has the reflected inertia and the payload of the
/// model, and viscous friction is the model's. Gravity is compensated exactly in the modes, and in
/// the gain margin as late as LoopTiming says. With elastic joints the loop has the coordinates of
/// analysis::Gears.
///
/// An Audit does not change: several threads may use one at once.
class Audit {
 public:
  /// Throws std::invalid_argument, with the member's name and the reason, for gains and ranges of
  /// another size, or gains that are not finite or not symmetric, for stiffness that is not
  /// positive semidefinite, for a ratio in a law that Controller does not have, and for a loop that
  /// analysis::gain_margin refuses.
  Audit(const RobotModel& model, const AuditOptions& options);

  const RobotModel& model() const noexcept { return model_; }
  const AuditOptions& options() const noexcept { return options_; }

  /// Computes the three numbers at q (n, rad) from the eigenvalues alone, in double precision and
  /// without proved bounds. Postures near a singularity and postures without an oscillating mode
  /// are left to audit(), which is slower. Throws std::invalid_argument unless q has n finite
  /// entries.
  PostureNumbers numbers(const JointVector& q) const;

  /// Computes the numbers of another loop with the same springs at q, such as the loop of a
  /// PostureLoop, from its mass, damping and stiffness factor. Returns nothing where numbers(q)
  /// would leave the posture to audit().
  std::optional<PostureNumbers> numbers(const LoopAt& loop) const;

  /// Computes modes and numbers at q with proved bounds. Throws like numbers(), and
  /// std::runtime_error if the eigenvalue iteration fails.
  PostureAudit audit(const JointVector& q) const;

  /// Returns what rotors would change at the posture for which audit() returned `found`.
  MissingRotors missing_rotors(const PostureAudit& found) const;

  /// Returns posture `index` (from 0) of the sequence `seed`. It is spread evenly over the range of
  /// all joints at once, at most half a turn each way, by the quasi-random sequence of Roberts
  /// (2018), moved by an offset that depends on the seed.
  JointVector posture(std::uint64_t seed, std::int64_t index) const;

  /// Returns the numbers of the postures `first` .. `first + count - 1` of the sequence `seed`.
  /// They depend on nothing else: neither on the call's share of the postures nor on earlier calls.
  std::vector<PostureNumbers> sample(std::uint64_t seed, std::int64_t first,
                                     std::int64_t count) const;

  /// Returns the springs and dampers at q as matrices, as if no gear gave way, without those
  /// designed for a ratio. Throws like numbers().
  analysis::TaskImpedance impedance(const JointVector& q) const {
    return task_impedance(evaluate(q));
  }

  /// Returns the system at q that damping is designed for: with the springs, the null space's
  /// dampers and the friction, without the dampers of task or joints, and as if no gear gave way.
  /// Throws like numbers().
  analysis::TaskImpedance undamped(const JointVector& q) const;

  /// Returns the sampled loop at q, of SampledArm::at with the integral of the springs, in joint
  /// coordinates.
  /// Throws like numbers(), and std::invalid_argument without a period.
  analysis::SampledLoop loop(const JointVector& q) const;

  /// Returns the closed loop at q, in the coordinates of its gears, and, with a period, how it is
  /// sampled. Throws like numbers().
  LoopAt at(const JointVector& q) const;

  /// Designs damping for the stiffness at q, with `ratio` for every mode. Throws
  /// std::invalid_argument for a ratio that is not positive.
  DampingSuggestion suggest(const JointVector& q, double ratio) const;

 private:
  DynamicsResult evaluate(const JointVector& q) const;
  std::optional<PostureNumbers> numbers(
      const analysis::System<kMaxJoints>& system,
      const std::function<analysis::SampledLoop()>& sampled) const;
  analysis::SampledLoop loop(const JointVector& q, const DynamicsResult& robot) const;
  /// Returns the closed loop, with elastic joints where there are some.
  analysis::System<> system_of(const analysis::TaskImpedance& impedance) const;
  /// Returns the springs and dampers that act at a posture.
  Impedance impedance_at(const DynamicsResult& robot) const;
  /// Returns the same as matrices of an impedance whose errors are counted.
  analysis::TaskImpedance task_impedance(const DynamicsResult& robot) const;

  RobotModel model_;
  AuditOptions options_;
  SampledArm arm_;
  Impedance impedance_;               ///< in 1/s^2 and 1/s with inertia_blocks
  int springs_ = 0;                   ///< modes where no posture is singular
  std::optional<Settings> designed_;  ///< that design damping for ratios, or AuditOptions::settings
};

/// Summarizes postures by their `numbers`; posture(i) returns the i-th posture. `numbers` only
/// select the postures; the numbers in the result come from Audit::audit, with proved bounds.
WorkspaceAudit summarize(const Audit& audit, const std::vector<PostureNumbers>& numbers,
                         const std::function<JointVector(std::int64_t)>& posture);

}  // namespace dashpot::controller
