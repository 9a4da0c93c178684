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

}  // namespace dashpot::controller
