#pragma once
#include <dashpot/analysis/matrix_types.hpp>
#include <dashpot/analysis/task_space.hpp>

#include <algorithm>
#include <cmath>

namespace dashpot::analysis {

/// The damping ratio wanted of every mode.
struct DampingTarget {
  double ratio = 0.7;  ///< not negative
  /// Modes slower than this (rad/s) are soft. Next to a singularity the hand cannot follow the
  /// spring. The ratio of soft modes is given up so that the damping matrix stays bounded.
  /// Positive.
  double soft_frequency = 1e-3;

  static DampingTarget constant(double zeta) {
    DampingTarget target;
    target.ratio = zeta;
    return target;
  }

  /// Returns the damper that acts through a spring of unit stiffness on a mode of frequency omega:
  /// c = 2 ratio / omega (s) for omega >= soft (a soft frequency, normally `soft_frequency`). Below
  /// it c = 2 ratio x (35 - 42 x + 15 x^2) / (8 soft) with x = (omega / soft)^2. This meets 1 /
  /// omega with two derivatives, is smooth in omega^2, falls to zero with omega, and never exceeds
  /// kPeak 2 ratio / soft.
  double damper(double omega, double soft) const noexcept {
    if (omega >= soft) return 2 * ratio / omega;
    const double x = (omega / soft) * (omega / soft);
    return 2 * ratio * x * (35 + x * (15 * x - 42)) / (8 * soft);
  }
  static constexpr double kPeak = 1.1413;

  /// Returns the frequency (rad/s) below which modes are soft if the largest frequency is
  /// `fastest`: `soft_frequency`, or the frequency where rounding takes over if that is larger.
  double soft_limit(double fastest) const noexcept {
    return std::max(soft_frequency, 1e-14 * fastest);
  }
};

/// Entries of the damping matrix that may differ from zero.
enum class DampingStructure {
  kFull,
  kBlock,  ///< two blocks: the first three directions (translation) and the others (rotation)
  kDiagonal,
};

/// One system to be damped: the damping matrix X (k x k) that is sought acts through `map`,
///     C = system.damping + map X map',
/// so that map is J' (n x m) in task space and the identity in joint space.
struct DampingSample {
  System<> system;
  Eigen::MatrixXd map;
};

/// Returns the system of `impedance` without its task damping, and its map. Joint damping counts as
/// damping given already. Throws InvalidSystem as to_joint_space does, and for what a design cannot
/// include: a jacobian_rate, or a jacobian without task stiffness.
DampingSample damping_sample(const TaskImpedance& impedance);

}  // namespace dashpot::analysis
