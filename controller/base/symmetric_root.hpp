#pragma once
#include <dashpot/controller/robot_types.hpp>

namespace dashpot::controller {

/// A^1/2 = sum of root_k v_k v_k', with orthonormal v_k.
struct SymmetricRoot {
  JointVector roots;                            ///< n
  std::array<JointVector, kMaxJoints> vectors;  ///< v_k, n each
};

/// Returns the root of a symmetric A (n x n), of which the lower triangle is read. Eigenvalues
/// below 1e-13 of the largest entry count as zero, because they may be rounding errors of zeros.
/// Jacobi rotations in at most 12 sweeps, so that the work is bounded; the root of a finite A is
/// finite.
SymmetricRoot symmetric_root(const JointMatrix& A) noexcept;

}  // namespace dashpot::controller
