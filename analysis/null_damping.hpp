#pragma once
#include <dashpot/analysis/types.hpp>

#include <Eigen/Core>

namespace dashpot::analysis {

/// Returns N' D N (n x n): damping D (n x n) of the motions that springs K_C (m x m, positive
/// semidefinite) at J (m x n) leave free, with the dynamically consistent projector
///     N = L^-T P L',    P = I - V V',    M = L L',    F' J L^-T = U diag(omega) V',    K_C = F F'.
/// The vibrations of these springs are not damped: V' L^-1 (N' D N) = 0. M has to be positive
/// definite.
Eigen::MatrixXd null_space_damping(const Eigen::MatrixXd& M, const Eigen::MatrixXd& J,
                                   const Eigen::MatrixXd& K_C, const Eigen::MatrixXd& D);

}  // namespace dashpot::analysis
