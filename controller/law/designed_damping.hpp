#pragma once
#include <dashpot/analysis/ratio_damping.hpp>
#include <dashpot/controller/dynamics.hpp>
#include <dashpot/controller/law/gain_blend.hpp>
#include <dashpot/controller/law/null_space.hpp>

namespace dashpot::controller {

/// Designs the damping C with which every mode of the stiffness K has one damping ratio, for a mass
/// M (n x n) that is new at every tick. K belongs to the task (6 x 6), with a Jacobian (6 x n) that
/// is new as well, or to the joints (n x n); see analysis::RatioDamping.
///
/// C is symmetric, positive semidefinite to rounding, and bounded. The joint damping is at most
/// 2 ratio omega M for the fastest mode, and next to a singularity the task's C itself is at most
/// 2.3 ratio |K| / kSoftFrequency. Modes below kSoftFrequency get less than their ratio. If there
/// is no design, because a mass or stiffness matrix is not valid, the last C stays; the first C is
/// zero.
class RatioDamper {
 public:
  /// K is `springs` x `springs`.
  explicit RatioDamper(int springs) { C_.setZero(springs, springs); }
  /// Forgets the last design.
  void reset() noexcept { C_.setZero(); }
  /// Sets the stiffness, which rounding errors may make slightly indefinite, and the ratio.
  /// `friction` is the viscous friction of the joints (n, N m s/rad), which is subtracted from the
  /// damping; without entries there is none.
  void set(const JointMatrix& K, double ratio, const JointVector& friction) noexcept;
  /// Lowers the ratio to what the sampled loop tolerates with springs that are active with the
  /// share `in_force`. The first argument has to outlive this.
  void set_loop(const analysis::BorneDamping& borne, double in_force) noexcept {
    design_.set_loop(&borne, in_force);
  }
  /// Designs C for this tick, from the lower triangle of M, which rounding errors may make slightly
  /// indefinite. `J` is null for springs in the joints.
  void update(const JointMatrix& M, const Jacobian* J) noexcept;
  /// Returns C in the axes of K and J.
  const JointMatrix& damping() const noexcept { return C_; }
  /// Returns the share of the ratio that the loop allows.
  const analysis::DampingLevel& level() const noexcept { return design_.level(); }

 private:
  JointMatrix C_;
  JointMatrix definite_;  ///< of M
  analysis::RatioDamping design_;
};

/// Active springs and dampers: the blended gains, and, if these have a damping ratio, the C_C and
/// C_q that give this ratio to the springs of tip and joints at the robot's posture. Ratio and
/// stiffness are the blended ones, so that the damping changes as smoothly as they do. The given
/// viscous friction is subtracted; if two modes are active, each subtracts its share. A ratio with
/// which the sampled loop would not keep its margin is lowered. Springs at the tip include their
/// null space.
class DesignedDamping {
 public:
  /// `viscous_friction` is the friction of the robot's joints, n, N m s/rad. The achievable damping
  /// of the loop limits the ratios. `weights` belong to the weighted projector.
  explicit DesignedDamping(const JointVector& viscous_friction,
                           const analysis::BorneDamping& borne = {},
                           const JointVector& weights = {});
  DesignedDamping(const DesignedDamping&) = delete;  // the dampers point to the achievable damping
  DesignedDamping& operator=(const DesignedDamping&) = delete;

  /// Designs the damping of this tick, and computes the null space if there are springs at the tip.
  /// Returns springs and dampers, valid until the next tick.
  const Impedance& update(const GainBlend& gains, const DynamicsResult& robot) noexcept;
  /// Returns springs and dampers of this tick again; `given` are the blended gains.
  const Impedance& now(const Impedance& given) const noexcept {
    return tip_ || joints_ ? in_force_ : given;
  }
  /// Returns the null space of the last tick with springs at the tip.
  const NullSpace& null_space() const noexcept { return null_space_; }
  /// Returns the share of the ratios that the loop allows now; `given` are the blended gains.
  analysis::DampingLevel level(const Impedance& given) const noexcept;
  void reset() noexcept { tip_ = joints_ = false; }

 private:
  JointVector friction(double share) const noexcept;
  void set_tip(const Impedance& given, const DynamicsResult& robot) noexcept;
  void design_tip(const Impedance& given, const DynamicsResult& robot) noexcept;

  bool tip_ = false, joints_ = false;  ///< whose damping is designed
  std::uint64_t changes_ = 0;
  JointVector friction_;  ///< no entries: none
  analysis::BorneDamping borne_;
  RatioDamper tip_damper_{6};
  RatioDamper joint_damper_;
  Jacobian J_;  ///< in the tool's axes
  Impedance in_force_;
  NullSpace null_space_;
};

}  // namespace dashpot::controller
