#pragma once
#include <dashpot/analysis/sampled/sampled_spectrum.hpp>
#include <dashpot/analysis/spectrum/spectrum_result.hpp>
#include <dashpot/analysis/system.hpp>

#include <limits>
#include <vector>

namespace dashpot::analysis {

/// A thing of the world that a loop touches along one direction: a spring k, a damper and a mass
/// on x = a' q, to which they add k a a', b a a' and m a a'. The spring is the world's: it acts
/// without hold or delay.
struct Touch {
  Eigen::VectorXd direction;  ///< a, n; in the coordinates of the gears if there are some
  double damping = 0;         ///< b, N s/m, at least 0
  double mass = 0;            ///< m, kg, at least 0
  double most = 1e9;          ///< stiffness up to which a limit is looked for, N/m
  /// N/m, up to which it is looked for in steps of a factor of 16. If there is none, the touch
  /// against a rigid world is then not looked at.
  double coarse = 0;
  double stiffness_share = 1, damping_share = 1;  ///< factors of the controller's K - P and C - D
};

/// The stiffness k of a touch at which a sampled loop loses its stability.
struct ContactLimit {
  /// N/m: the first boundary above 0 to six digits, found in steps of at most a factor of 2.25 and
  /// finer ones where the least ratio has a minimum or the touch turns by a multiple of pi in a
  /// tick; 0 if the loop is unstable before it touches, infinite if there is no boundary up to
  /// Touch::most.
  double stiffness = 0;
  /// The loop is stable at `lower` and unstable at `upper`, N/m: the eigenvalues outside the unit
  /// circle were counted there by the argument principle, in steps that can miss none. Equal to
  /// `stiffness` if it is 0 or infinite; NaN if nothing was counted.
  double lower = std::numeric_limits<double>::quiet_NaN();
  double upper = std::numeric_limits<double>::quiet_NaN();
  double frequency = 0;  ///< of the motion that begins to grow at the limit, rad/s
  /// True if the loop is stable against a rigid world, a' q = 0.
  bool stable_if_rigid = false;
};

/// The least damped motion at one stiffness of a touch.
struct ContactPoint {
  double stiffness;          ///< k, N/m
  double damping_ratio;      ///< -Re(log z) / |log z|, the least; negative if the loop is unstable
  double natural_frequency;  ///< |log z| / T of that motion, rad/s
};

/// Returns the limit of a loop without gears, or in their coordinates (see with_gears), with or
/// without `proved` bounds. Motions slower than SampledLoop::slowest do not count. `spectrum` is of
/// `system`. Throws like gain_margin, and std::invalid_argument for a direction of another size or
/// zero, and for a stiffness, damping or mass that is negative or not finite.
ContactLimit contact_limit(const System<>& system, const Spectrum<>& spectrum,
                           const SampledLoop& loop, const Touch& touch, bool proved = true);

/// Returns the least damped motion for each stiffness (at least 0, N/m). Throws likewise.
std::vector<ContactPoint> contact_curve(const System<>& system, const Spectrum<>& spectrum,
                                        const SampledLoop& loop, const Touch& touch,
                                        const std::vector<double>& stiffness);

/// Tells whether a sampled loop gives energy to what touches it, wherever that is. With the springs
/// and dampers of the controller as u = -H(z) q, which counts delay, filter and memory, the loop
/// takes energy from every motion if
///     Phi(theta) = s D - T / (2 - 2 cos theta) He{(1 - 1/z) H(z)},   z = e^(i theta),
/// is positive semidefinite for 0 < theta <= pi, s = 1, and K at rest is symmetric positive
/// semidefinite (docs/theory.md). He is the Hermitian part. One joint with a spring and a
/// difference damper: D >= K T / 2 + |C - D| (Colgate and Schenkel 1997). If velocities are
/// measured at an instant, a motion between ticks can show the controller any velocity at no cost,
/// so that no friction is enough beside dampers; then s = theta^2 / (2 - 2 cos theta), which counts
/// motions slower than the Nyquist frequency.
struct PortPassivity {
  bool passive = false;
  /// Viscous friction that each joint would need in addition, N m s/rad: minus the least eigenvalue
  /// of Phi over s; 0 or less if the loop is passive up to the Nyquist frequency.
  double missing_friction = 0;
  double frequency = 0;     ///< where it is missing, rad/s
  double from = 0, to = 0;  ///< frequencies with a negative eigenvalue, rad/s, to 1 %
  bool instants = false;    ///< dampers act on velocities measured at an instant
};

/// Returns the passivity of a loop without gears, or in their coordinates. Throws
/// std::invalid_argument for a period that is not positive.
PortPassivity port_passivity(const System<>& system, const SampledLoop& loop);

}  // namespace dashpot::analysis
