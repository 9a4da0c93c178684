#pragma once
#include <dashpot/analysis/system.hpp>

#include <optional>
#include <vector>

namespace dashpot::analysis {

/// An impedance given in task space, in joint space, or in both; the parts add up, and each is
/// optional. n joints, m task directions (a twist is linear first, then angular). SI units.
struct TaskImpedance {
  Eigen::MatrixXd mass;                           ///< M, n x n
  std::optional<Eigen::MatrixXd> damping;         ///< n x n, joint space
  std::optional<Eigen::MatrixXd> stiffness;       ///< n x n, joint space
  std::optional<Eigen::MatrixXd> jacobian;        ///< J, m x n
  std::optional<Eigen::MatrixXd> task_damping;    ///< C_C, m x m
  std::optional<Eigen::MatrixXd> task_stiffness;  ///< K_C, m x m
  std::optional<Eigen::MatrixXd> jacobian_rate;   ///< dJ/dt, m x n: adds J' C_C Jdot to K (Eq. 55)
  /// dJ/dq_k, m x n each, k = 1..n, and the wrench f (m) that the task spring carries at
  /// equilibrium: add K_G = [(dJ/dq_1)' f ... (dJ/dq_n)' f] to K (Eq. 55)
  std::vector<Eigen::MatrixXd> jacobian_derivatives;
  std::optional<Eigen::VectorXd> wrench;
  /// Entrywise bounds of |true - given| mass and damping, n x n, for what the caller rounded. No
  /// rows: exact.
  Eigen::MatrixXd mass_error, damping_error;
};

/// Returns K_G of Eq. 55, n x n. It belongs to K where J' f of the wrench f is held by constant
/// joint torques. A constant wrench of the world at the tip has a term of its own that cancels it;
/// the controller's stiffness_under_load has the terms of other loads. K_G is symmetric for the
/// linear rows of J, in general not for the angular rows. Each derivative has as many rows as the
/// wrench has entries, and n columns.
Eigen::MatrixXd geometric_stiffness(const std::vector<Eigen::MatrixXd>& jacobian_derivatives,
                                    const Eigen::VectorXd& wrench);

/// Returns the joint-space system of an impedance (paper, Eqs. 55 and 56):
///     K = stiffness + J' K_C J + K_G + J' C_C Jdot,     C = damping + J' C_C J.
/// With nothing but a mass, C = K = 0.
///
/// The rounding errors of forming the products are kept in the system's low words, and what these
/// cannot hold is bounded in its errors. The factor W = F' J (stacked) is kept too where all of K
/// comes from a positive semidefinite K_C = F F' (and a positive semidefinite joint stiffness).
///
/// mass, damping, stiffness, C_C and K_C have to be symmetric: a difference of more than 1e-10 of
/// the largest entry is an error. A smaller one is averaged, and counts in the system's errors, so
/// that proved bounds hold for the matrix as given and for the symmetric ones that it may stand
/// for. K_G is made symmetric likewise where it is symmetric within that tolerance. So only Jdot
/// and a K_G of angular directions can make the result nonsymmetric.
///
/// The jacobian needs task_damping or task_stiffness, and these need the jacobian; jacobian_rate
/// needs task_damping; wrench and jacobian_derivatives need each other. Throws InvalidSystem, with
/// the member's name as key and the reason.
System<> to_joint_space(const TaskImpedance& impedance);

}  // namespace dashpot::analysis
