#pragma once
#include <dashpot/controller/base/impedance.hpp>

#include <Eigen/Geometry>
#include <numbers>

namespace dashpot::controller {

/// Returns which directions of a frame have springs, 1 or 0 for each. K is positive semidefinite,
/// so that a row is zero if its diagonal entry is.
inline Vector6 sprung(const Matrix6& K) noexcept {
  Vector6 result;
  for (int i = 0; i < 6; ++i) result[i] = K(i, i) > 0 ? 1 : 0;
  return result;
}

/// Limits the deflection of the tip's springs: e (m, and rad as a rotation vector) becomes
///     e - (1 - min(1, r / |e_s|)) e_s,
/// linear and angular part each by itself. e_s is the part of e in directions that have springs,
/// and r is the limit. Less deflection is less energy: e' K e becomes no larger if K does not
/// couple the two parts.
struct ErrorClamp {
  double linear = 0;   ///< m
  double angular = 0;  ///< rad

  Vector6 clamped(const Vector6& e, const TipImpedance& base, const TipImpedance& tool,
                  const Eigen::Matrix3d& R_BT) const noexcept {
    if (e.head<3>().norm() <= linear && e.tail<3>().norm() <= angular) return e;
    Vector6 e_s = e;  // all of e while springs blend from one frame to the other
    if (tool.none()) {
      e_s = part_along(sprung(base.stiffness), Eigen::Matrix3d::Identity(), e);
    } else if (base.none()) {
      e_s = part_along(sprung(tool.stiffness), R_BT, e);
    }
    const double far = e_s.head<3>().norm(), turned = e_s.tail<3>().norm();
    Vector6 result = e;
    if (far > linear) result.head<3>() -= (1 - linear / far) * e_s.head<3>();
    if (turned > angular) result.tail<3>() -= (1 - angular / turned) * e_s.tail<3>();
    return result;
  }
};

/// Keeps the tip's reference within the error clamp. It knows the pose of the tip, and the springs
/// between tip and reference.
struct ReferenceGovernor {
  const Eigen::Vector3d& position;
  const Eigen::Quaterniond& rotation;
  const Eigen::Matrix3d& R_BT;  ///< of `rotation`
  const TipImpedance& base;
  const TipImpedance& tool;
  const ErrorClamp& clamp;

  Vector6 clamped(const Vector6& e) const noexcept { return clamp.clamped(e, base, tool, R_BT); }
  /// Returns true if a cheap bound shows that a pose is within the clamp: the angle between two
  /// unit quaternions is at most pi sqrt(1 - (their product)^2).
  bool near(const Eigen::Vector3d& p, const Eigen::Quaterniond& q) const noexcept {
    const double cosine = q.dot(rotation);
    return (p - position).squaredNorm() <= clamp.linear * clamp.linear &&
           std::numbers::pi * std::numbers::pi * (1 - cosine * cosine) <=
               clamp.angular * clamp.angular;
  }
};

/// Returns the deflection e of springs that change from `now` to `then` without its part in the
/// directions of new springs, so that springs that grow from zero start without deflection.
inline Vector6 without_new_springs(const Vector6& e, const TipImpedance& now_base,
                                   const TipImpedance& now_tool, const TipImpedance& then_base,
                                   const TipImpedance& then_tool,
                                   const Eigen::Matrix3d& R_BT) noexcept {
  const bool in_tool = !then_tool.none();
  const Matrix6 now =
      in_tool ? Matrix6(now_tool.stiffness + turned(now_base.stiffness, R_BT.transpose()))
              : Matrix6(now_base.stiffness + turned(now_tool.stiffness, R_BT));
  const Vector6 then = sprung(in_tool ? then_tool.stiffness : then_base.stiffness);
  const Vector6 fresh = then.cwiseProduct(Vector6::Ones() - sprung(now));
  return e - part_along(fresh, in_tool ? R_BT : Eigen::Matrix3d::Identity(), e);
}

}  // namespace dashpot::controller
