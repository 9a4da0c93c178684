#pragma once
#include <dashpot/controller/types.hpp>

namespace dashpot::controller {

/// Returns factor A^1/2 for a symmetric A (n x n), of which the lower triangle is read, and whose
/// eigenvalues below zero, which rounding may make of those that vanish, count as zero. Jacobi
/// rotations in at most kMostSweeps sweeps, so that the work is bounded; the root of a finite A is
/// finite.
JointMatrix symmetric_root(const JointMatrix& A, double factor) noexcept;

}  // namespace dashpot::controller
