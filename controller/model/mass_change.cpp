#include <dashpot/controller/dynamics.hpp>

#include <Eigen/Geometry>
#include <cmath>

namespace dashpot::controller {
namespace {

using Eigen::Matrix3d;
using Eigen::Vector3d;

/// A rigid body's inertia about one point.
struct BodyInertia {
  double mass = 0;
  Vector3d first_moment = Vector3d::Zero();
  Matrix3d second = Matrix3d::Zero();

  /// Returns the momentum of a twist at the point, linear first.
  Vector6 operator*(const Vector6& twist) const {
    const Vector3d v = twist.head<3>(), w = twist.tail<3>();
    Vector6 momentum;
    momentum << mass * v + w.cross(first_moment), second * w + first_moment.cross(v);
    return momentum;
  }
};

/// Returns the change of the twist b that moves along with the twist a.
Vector6 turned_twist(const Vector6& a, const Vector6& b) {
  const Vector3d w = a.tail<3>();
  Vector6 result;
  result << w.cross(b.head<3>()) + a.head<3>().cross(b.tail<3>()), w.cross(b.tail<3>());
  return result;
}

/// Returns the same of a momentum or wrench.
Vector6 turned_wrench(const Vector6& a, const Vector6& f) {
  const Vector3d w = a.tail<3>();
  Vector6 result;
  result << w.cross(f.head<3>()), w.cross(f.tail<3>()) + a.head<3>().cross(f.head<3>());
  return result;
}

template <class Rows>
Vector3d three(const Rows& rows, std::size_t first, std::size_t lane) {
  return {rows[first][lane], rows[first + 1][lane], rows[first + 2][lane]};
}

}  // namespace

JointMatrix DynamicsKernel::mass_change(const JointVector& q, const Jacobian& J,
                                        const JointVector& x) const noexcept {
  const auto n = static_cast<std::size_t>(n_);
  std::array<Matrix3d, kMaxJoints> R;
  std::array<Vector3d, kMaxJoints> p;  // from the first joint's origin
  Matrix3d R_now = Matrix3d::Identity();
  Vector3d tip = Vector3d::Zero();
  for (std::size_t i = 0; i < n; ++i) {
    const Links& links = links_[i / 4];
    const std::size_t lane = i % 4;
    const auto at = static_cast<Eigen::Index>(i);
    const double angle = links.revolute[lane] * q[at];
    const double next = i + 1 < n ? q[at + 1] : 0;
    Matrix3d fixed, turn = Matrix3d::Identity();
    fixed << three(links.rotation, 0, lane), three(links.rotation, 3, lane),
        three(links.rotation, 6, lane);
    turn(0, 0) = turn(1, 1) = std::cos(angle);
    turn(1, 0) = std::sin(angle);
    turn(0, 1) = -turn(1, 0);
    R_now = (R_now * fixed * turn).eval();
    R[i] = R_now;
    p[i] = tip;
    tip += R_now * (three(links.offset, 0, lane) + next * three(links.next_slide, 0, lane));
  }

  std::array<Vector6, kMaxJoints> V;
  Vector6 sum = Vector6::Zero();
  for (std::size_t i = 0; i < n; ++i) {
    const auto at = static_cast<Eigen::Index>(i);
    V[i] = sum += x[at] * J.col(at);
  }
  JointMatrix change(n_, n_);
  std::array<Vector6, kMaxJoints> momentum;  // I_i c_i
  BodyInertia carried;
  Vector6 W = Vector6::Zero();
  for (std::size_t k = n; k-- > 0;) {
    const Links& links = links_[k / 4];
    const std::size_t lane = k % 4;
    const auto column = static_cast<Eigen::Index>(k);
    const Vector3d a = p[k] - tip, h = R[k] * three(links.first_moment, 0, lane);
    Matrix3d I;
    I << links.inertia[0][lane], links.inertia[3][lane], links.inertia[4][lane],
        links.inertia[3][lane], links.inertia[1][lane], links.inertia[5][lane],
        links.inertia[4][lane], links.inertia[5][lane], links.inertia[2][lane];
    const double m = links.mass[lane];
    BodyInertia link;
    link.mass = m;
    link.first_moment = h + m * a;
    link.second = R[k] * I * R[k].transpose() +
                  (2 * h.dot(a) + m * a.squaredNorm()) * Matrix3d::Identity() - h * a.transpose() -
                  a * h.transpose() - m * a * a.transpose();
    carried.mass += link.mass;
    carried.first_moment += link.first_moment;
    carried.second += link.second;
    W += link * V[k];
    const Vector6 twist_k = J.col(column);
    momentum[k] = carried * twist_k;
    const Vector6 moved = turned_twist(twist_k, V[k]);
    const Vector6 lower = turned_wrench(twist_k, W) - carried * moved;
    for (std::size_t i = 0; i < n; ++i) {
      const auto row = static_cast<Eigen::Index>(i);
      change(row, column) = i < k ? lower.dot(J.col(row)) : -momentum[i].dot(moved);
    }
  }
  return change;
}

}  // namespace dashpot::controller
