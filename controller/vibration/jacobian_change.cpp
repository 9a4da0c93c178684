#include <dashpot/controller/base/joint_algebra.hpp>
#include <dashpot/controller/vibration/jacobian_change.hpp>

#include <Eigen/Geometry>

namespace dashpot::controller {

using Eigen::Index;
using Eigen::Vector3d;

Jacobian jacobian_rate(const Jacobian& J, const JointVector& qd) noexcept {
  Jacobian rate(6, J.cols());
  Vector3d inner = Vector3d::Zero();        // sum of w_k qd_k for k <= j
  Vector3d outer = twist(J, qd).head<3>();  // sum of v_k qd_k for k > j
  for (Index j = 0; j < J.cols(); ++j) {
    const Vector3d v = J.col(j).head<3>(), w = J.col(j).tail<3>();
    inner += w * qd[j];
    outer -= v * qd[j];
    rate.col(j).head<3>() = inner.cross(v) + w.cross(outer);
    rate.col(j).tail<3>() = inner.cross(w);
  }
  return rate;
}

JointMatrix geometric_stiffness(const Jacobian& J, const Vector6& f) noexcept {
  JointMatrix K_G(J.cols(), J.cols());
  const Vector3d force = f.head<3>(), moment = f.tail<3>();
  for (Index k = 0; k < J.cols(); ++k) {
    const Vector3d v_k = J.col(k).head<3>(), w_k = J.col(k).tail<3>();
    for (Index j = 0; j < J.cols(); ++j) {
      const Vector3d v = J.col(j).head<3>(), w = J.col(j).tail<3>();
      K_G(j, k) =
          k <= j ? force.dot(w_k.cross(v)) + moment.dot(w_k.cross(w)) : force.dot(w.cross(v_k));
    }
  }
  return K_G;
}

Jacobian twist_change(const Jacobian& J, const JointVector& x) noexcept {
  Jacobian change = jacobian_rate(J, x);  // its linear rows are symmetric in k and x
  Vector3d beyond = twist(J, x).tail<3>();
  for (Index k = 0; k < J.cols(); ++k) {
    const Vector3d w = J.col(k).tail<3>();
    beyond -= w * x[k];
    change.col(k).tail<3>() = w.cross(beyond);
  }
  return change;
}

}  // namespace dashpot::controller
