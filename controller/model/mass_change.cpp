#include <dashpot/controller/model/mass_change.hpp>

#include <Eigen/Geometry>
#include <cmath>

namespace dashpot::controller {
namespace {

using Eigen::Matrix3d;
using Eigen::Vector3d;

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

Vector6 MassChange::Body::operator*(const Vector6& twist) const noexcept {
  const Vector3d v = twist.head<3>(), w = twist.tail<3>();
  Vector6 result;
  result << mass * v + w.cross(first_moment), second * w + first_moment.cross(v);
  return result;
}

MassChange::MassChange(const DynamicsKernel& kernel, const JointVector& q,
                       const Jacobian& J) noexcept
    : J_(J) {
  const auto n = static_cast<std::size_t>(kernel.n_);
  std::array<Matrix3d, kMaxJoints> R;
  std::array<Vector3d, kMaxJoints> p;  // from the first joint's origin
  Matrix3d R_now = Matrix3d::Identity();
  Vector3d tip = Vector3d::Zero();
  for (std::size_t i = 0; i < n; ++i) {
    const DynamicsKernel::Links& links = kernel.links_[i / 4];
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
  Body carried;
  for (std::size_t k = n; k-- > 0;) {
    const DynamicsKernel::Links& links = kernel.links_[k / 4];
    const std::size_t lane = k % 4;
    const Vector3d a = p[k] - tip, h = R[k] * three(links.first_moment, 0, lane);
    Matrix3d I;
    I << links.inertia[0][lane], links.inertia[3][lane], links.inertia[4][lane],
        links.inertia[3][lane], links.inertia[1][lane], links.inertia[5][lane],
        links.inertia[4][lane], links.inertia[5][lane], links.inertia[2][lane];
    const double m = links.mass[lane];
    link_[k].mass = m;
    link_[k].first_moment = h + m * a;
    link_[k].second = R[k] * I * R[k].transpose() +
                      (2 * h.dot(a) + m * a.squaredNorm()) * Matrix3d::Identity() -
                      h * a.transpose() - a * h.transpose() - m * a * a.transpose();
    carried.mass += link_[k].mass;
    carried.first_moment += link_[k].first_moment;
    carried.second += link_[k].second;
    carried_[k] = carried;
    momentum_[k] = carried * J.col(static_cast<Eigen::Index>(k));
  }
}

JointMatrix MassChange::times(const JointVector& x) const noexcept {
  const Eigen::Index n = J_.cols();
  std::array<Vector6, kMaxJoints> V;
  Vector6 sum = Vector6::Zero();
  for (Eigen::Index i = 0; i < n; ++i) {
    sum += x[i] * J_.col(i);
    V[static_cast<std::size_t>(i)] = sum;
  }
  JointMatrix change(n, n);
  Vector6 W = Vector6::Zero();
  for (Eigen::Index k = n; k-- > 0;) {
    const auto at = static_cast<std::size_t>(k);
    W += link_[at] * V[at];
    const Vector6 twist = J_.col(k), moved = turned_twist(twist, V[at]);
    const Vector6 lower = turned_wrench(twist, W) - carried_[at] * moved;
    for (Eigen::Index i = 0; i < k; ++i) change(i, k) = lower.dot(J_.col(i));
    for (Eigen::Index i = k; i < n; ++i) {
      change(i, k) = -momentum_[static_cast<std::size_t>(i)].dot(moved);
    }
  }
  return change;
}

}  // namespace dashpot::controller
