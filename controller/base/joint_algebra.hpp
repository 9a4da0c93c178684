#pragma once
// The few operations on n joint coordinates, n known at compile time, that the controller needs.
// Plain loops: expression templates of every size from 1 to 16 would take minutes to compile.

#include <dashpot/controller/types.hpp>

namespace dashpot::controller {

/// n
template <int N>
using Joints = Eigen::Matrix<double, N, 1>;
/// n x n
template <int N>
using JointSquare = Eigen::Matrix<double, N, N>;
/// 6 x n
template <int N>
using Jacobian = Eigen::Matrix<double, 6, N>;

/// Returns column j of a Jacobian.
template <int N>
Eigen::Map<const Vector6> column(const Jacobian<N>& J, int j) noexcept {
  return Eigen::Map<const Vector6>(J.data() + 6 * j);
}
template <int N>
Eigen::Map<Vector6> column(Jacobian<N>& J, int j) noexcept {
  return Eigen::Map<Vector6>(J.data() + 6 * j);
}

/// Returns J qd.
template <int N>
Vector6 twist(const Jacobian<N>& J, const Joints<N>& qd) noexcept {
  Vector6 V = Vector6::Zero();
  for (int j = 0; j < N; ++j) V += qd[j] * column<N>(J, j);
  return V;
}

/// tau += J' F
template <int N>
void add_torque(const Jacobian<N>& J, const Vector6& F, Joints<N>& tau) noexcept {
  for (int j = 0; j < N; ++j) tau[j] += column<N>(J, j).dot(F);
}

/// y += factor A x
template <int N>
void add_product(const JointSquare<N>& A, const Joints<N>& x, Joints<N>& y,
                 double factor = 1) noexcept {
  for (int j = 0; j < N; ++j) {
    const double x_j = factor * x[j];
    for (int i = 0; i < N; ++i) y[i] += A(i, j) * x_j;
  }
}

/// y += factor x
template <int N>
void add(const Joints<N>& x, Joints<N>& y, double factor = 1) noexcept {
  for (int i = 0; i < N; ++i) y[i] += factor * x[i];
}

/// Returns a - b.
template <int N>
Joints<N> difference(const Joints<N>& a, const Joints<N>& b) noexcept {
  Joints<N> result;
  for (int i = 0; i < N; ++i) result[i] = a[i] - b[i];
  return result;
}

/// Returns true if all entries are finite.
template <int N>
bool finite(const Joints<N>& x) noexcept {
  double sum = 0;  // becomes NaN with the first entry that is not finite
  for (int i = 0; i < N; ++i) sum += 0 * x[i];
  return sum == 0;
}

/// Convert from and to the type of interfaces; `from` has N entries.
template <int N>
Joints<N> fixed(const JointVector& from) noexcept {
  Joints<N> to;
  for (int i = 0; i < N; ++i) to[i] = from[i];
  return to;
}
template <int N>
void copy(const Joints<N>& from, JointVector& to) noexcept {
  to.resize(N);
  for (int i = 0; i < N; ++i) to[i] = from[i];
}

}  // namespace dashpot::controller
