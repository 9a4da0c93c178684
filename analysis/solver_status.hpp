#pragma once

namespace dashpot::analysis {

/// Result of a computation on the real-time path, where nothing throws.
enum class Status {
  kOk,
  kNotFinite,                ///< an entry of the input is NaN or infinite
  kNotSymmetric,             ///< the mass matrix is not symmetric to rounding
  kMassNotPositiveDefinite,  ///< the Cholesky factorisation of the mass matrix broke down
  kStiffnessIndefinite,      ///< a stiffness that has to be positive semidefinite is not
  kWrongSize,                ///< a matrix has a shape that does not fit the others
  kNotConverged,             ///< the eigenvalue iteration reached its cap
  kOverflow,                 ///< the entries are too large or too small to compute with
  kUncertified,  ///< modes are given, but no finite error bound could be proved for some
  kUnfinished,   ///< more work than one tick may take: another thread continues it
};

/// Returns a short English text, without a full stop.
const char* to_text(Status status) noexcept;

}  // namespace dashpot::analysis
