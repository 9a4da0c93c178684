#pragma once
// The few operations on n joint coordinates that the controller needs. n is known at run time, and
// each operation is compiled once, because a tick between which the caches forget waits for code.

#include <dashpot/controller/robot_types.hpp>

namespace dashpot::controller {

/// Returns J qd.
Vector6 twist(const Jacobian& J, const JointVector& qd) noexcept;

/// tau += J' F
void add_torque(const Jacobian& J, const Vector6& F, JointVector& tau) noexcept;

/// y += factor A x
void add_product(const JointMatrix& A, const JointVector& x, JointVector& y,
                 double factor = 1) noexcept;

/// y += factor x
void add(const JointVector& x, JointVector& y, double factor = 1) noexcept;

/// Returns a - b.
JointVector difference(const JointVector& a, const JointVector& b) noexcept;

/// Returns a' b.
double product(const JointVector& a, const JointVector& b) noexcept;

/// Returns true if all entries are finite.
bool finite(const JointVector& x) noexcept;

/// K += J1' A J2
inline void add_congruence(const Jacobian& J1, const Matrix6& A, const Jacobian& J2,
                           JointMatrix& K) noexcept {
  for (Eigen::Index j = 0; j < K.cols(); ++j) {
    const Vector6 column_j = A * J2.col(j);
    for (Eigen::Index i = 0; i < K.rows(); ++i) K(i, j) += J1.col(i).dot(column_j);
  }
}

}  // namespace dashpot::controller
