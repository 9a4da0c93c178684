#pragma once
#include <dashpot/analysis/contact_limit.hpp>
#include <dashpot/controller/audit.hpp>

#include <array>
#include <optional>
#include <vector>

namespace dashpot::controller {

/// The surroundings that a tip touches: a spring of any stiffness, with a damper and a mass, along
/// one direction.
struct ContactOptions {
  /// In the base's axes, of any length but zero; none: the direction with the least limit.
  std::optional<Eigen::Vector3d> direction;
  double damping = 0;  ///< b, N s/m
  double mass = 0;     ///< m, kg
  double most = 1e9;   ///< stiffness up to which a limit is looked for, N/m
};

/// The largest stable stiffness at a posture, in one direction.
struct ContactAt {
  Eigen::Vector3d direction = Eigen::Vector3d::Zero();  ///< of length 1, in the base's axes
  analysis::ContactLimit limit;
};

/// The largest force of the joints in a direction, beside the weight of the arm.
struct HeldForce {
  Eigen::Vector3d direction;  ///< in which the tip presses, of length 1, in the base's axes
  /// At which the first joint reaches its effort limit, N; infinite: no joint carries it, NaN: the
  /// limits of all that do are unknown.
  double force = 0;
  int joint = -1;  ///< the joint at its limit, from 0; -1: none
  /// How far the springs are pressed in with that force, m, beyond which they are springs no more;
  /// infinite where no spring acts.
  double deflection = 0;
};

/// A posture in full.
struct ContactAudit {
  JointVector q;  ///< n, rad (m)
  ContactAt touch;
  /// The limit in that direction, N/m, with half of the stiffness, with 1.5 times the damping, and
  /// with a tick less of delay; NaN where there is no delay.
  double with_half_stiffness = 0, with_more_damping = 0, with_less_delay = 0;
  analysis::PortPassivity passivity;
  JointVector weight, effort;     ///< against gravity, and its limit, n, N m (N); infinite: unknown
  std::vector<HeldForce> forces;  ///< along the touch, against it, and along all axes of the base
};

/// Returns 13 directions of length 1, spread over the half sphere: the axes, and the diagonals of
/// faces and space.
std::vector<Eigen::Vector3d> contact_directions();

/// Returns the limit at q (n, rad) without proved bounds. Without a direction in the options, it is
/// the least of contact_directions, of which all but the lightest are searched in coarse steps.
/// Throws like Audit::numbers, and std::invalid_argument without a period, for what ContactOptions
/// does not allow, and for a direction in which the tip cannot move.
ContactAt find_contact(const Audit& audit, const JointVector& q, const ContactOptions& options);

/// Returns the limit of a touch at q, with a proved bracket, and the forces that the joints can
/// hold. The direction with the least limit is then refined to 0.01 rad. Throws likewise.
ContactAudit audit_contact(const Audit& audit, const JointVector& q, const ContactOptions& options);

/// Returns the least damped motion at q for each stiffness (N/m) of a touch in options.direction.
/// Throws likewise, and without a direction.
std::vector<analysis::ContactPoint> contact_curve(const Audit& audit, const JointVector& q,
                                                  const ContactOptions& options,
                                                  const std::vector<double>& stiffness);

}  // namespace dashpot::controller
