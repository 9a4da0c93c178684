#pragma once
#include <dashpot/controller/robot_types.hpp>

#include <Eigen/Geometry>
#include <cmath>
#include <numbers>

namespace dashpot::controller {

/// Returns the rotation vector of a unit quaternion (log map), rad. Its length is in [0, 2 pi]. The
/// sign of q says which way round it turns; a q with w >= 0 gives the shorter way, at most pi. With
/// w = cos(a/2), |v| = sin(a/2) the vector is a v / |v|.
inline Eigen::Vector3d rotation_vector(const Eigen::Quaterniond& q) noexcept {
  const double sine = q.vec().norm();
  if (sine < 1e-9) return q.vec() * (q.w() < 0 ? -2.0 : 2.0);  // error below 1e-18 relative
  return q.vec() * (2 * std::atan2(sine, q.w()) / sine);
}

/// Returns the quaternion of a rotation vector (exp map).
inline Eigen::Quaterniond quaternion(const Eigen::Vector3d& rotation_vector) noexcept {
  const double half = 0.5 * rotation_vector.norm();
  // sin(h) / h by its series where the quotient has no digits left; the next term is below 1e-18.
  const double ratio = half < 1e-4 ? 1 - half * half / 6 : std::sin(half) / half;
  Eigen::Quaterniond q;
  q.w() = std::cos(half);
  q.vec() = (0.5 * ratio) * rotation_vector;
  return q;
}

/// Returns the angle by which R differs from a rotation, as the largest entry of |R'R - I|;
/// infinity if R is a reflection or not finite.
inline double rotation_defect(const Eigen::Matrix3d& R) noexcept {
  const double defect =
      (R.transpose() * R - Eigen::Matrix3d::Identity()).cwiseAbs().maxCoeff<Eigen::PropagateNaN>();
  return R.determinant() > 0 && std::isfinite(defect) ? defect
                                                      : std::numeric_limits<double>::infinity();
}

/// Orientation error: the rotation vector e, in B's axes, that turns the tip to its goal,
///     R_goal = exp(e x) R,
/// so that K_rot e is the torque toward the goal and K_rot is in N m/rad. (Controllers that take
/// the vector part of a quaternion instead have half that stiffness.)
///
/// The shortest rotation jumps from pi to -pi where the tip is half a turn from its goal. This
/// error continues beyond pi instead: of the rotation vectors of the two quaternions q and -q, it
/// takes the one that continues the last error. Past 3/4 of a whole turn it takes the short way
/// again.
class OrientationError {
 public:
  /// Returns the error between two unit quaternions.
  Eigen::Vector3d update(const Eigen::Quaterniond& goal, const Eigen::Quaterniond& tip) noexcept {
    Eigen::Quaterniond error = goal * tip.conjugate();
    if (error.dot(last_) < 0) error.coeffs() = -error.coeffs();
    if (error.w() < kShortWay) error.coeffs() = -error.coeffs();
    last_ = error;
    return rotation_vector(error);
  }
  /// Makes the next error the short way round, at most pi.
  void reset() noexcept { last_ = Eigen::Quaterniond::Identity(); }

 private:
  static constexpr double kShortWay = -0.5 * std::numbers::sqrt2;  // cos(3/4 pi): 3/2 pi in all
  Eigen::Quaterniond last_ = Eigen::Quaterniond::Identity();
};

}  // namespace dashpot::controller
