#pragma once
#include <dashpot/controller/types.hpp>

namespace dashpot::controller {

/// Returns factor A^1/2 for a symmetric A (n x n), of which the lower triangle is read. Eigenvalues
/// below 1e-13 of the largest entry count as zero, because rounding makes them of those that
/// vanish. Jacobi rotations in at most 12 sweeps, so that the work is bounded; the root of a finite
/// A is finite.
JointMatrix symmetric_root(const JointMatrix& A, double factor) noexcept;

}  // namespace dashpot::controller
