#pragma once
#include <dashpot/analysis/matrix_types.hpp>

#include <Eigen/Core>

namespace dashpot::analysis {

/// A damping matrix and an entrywise bound of its error.
struct NullSpaceDamping {
  Eigen::MatrixXd damping;
  Eigen::MatrixXd error;  ///< infinite where rounding errors decide which motions are free
};

/// Returns N' D N (n x n): damping D (n x n) of the motions that springs K_C (m x m, positive
/// semidefinite) at J (m x n) leave free, with the dynamically consistent projector
///     N = L^-T P L',    P = I - V V',    M = L L',    F' J L^-T = U diag(omega) V',    K_C = F F'.
/// V has the columns whose omega is above max(m, n) eps times the largest. The vibrations of these
/// springs are not damped: V' L^-1 (N' D N) = 0. M has to be positive definite, and is known within
/// `M_error` (entrywise, no rows: exactly).
NullSpaceDamping null_space_damping(Eigen::MatrixXd M, const Eigen::MatrixXd& J,
                                    const Eigen::MatrixXd& K_C, const Eigen::MatrixXd& D,
                                    Eigen::MatrixXd M_error = {});

}  // namespace dashpot::analysis
