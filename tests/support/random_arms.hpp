#pragma once
// Random impedance-controlled arms, tame and ill-conditioned, for tests of damping designs.

#include <dashpot/analysis/ratio_damping.hpp>
#include <dashpot/analysis/task_space.hpp>
#include <dashpot/tests/support/random.hpp>

#include <algorithm>
#include <cmath>
#include <vector>

namespace dashpot::testing {

/// Symmetric, with eigenvalues from `largest` / `condition` to `largest`, these two included.
inline Eigen::MatrixXd graded(Random& random, Eigen::Index n, double largest, double condition) {
  const Eigen::MatrixXd Q = random.rotation(n);
  Eigen::VectorXd values(n);
  for (double& value : values) value = random.log_uniform(largest / condition, largest);
  values[0] = largest;
  values[n - 1] = n > 1 ? largest / condition : largest;
  const Eigen::MatrixXd A = Q * values.asDiagonal() * Q.transpose();
  return 0.5 * (A + A.transpose());
}

/// n joints, m task directions; mass and task stiffness with the given condition numbers.
inline analysis::TaskImpedance random_arm(Random& random, Eigen::Index n, Eigen::Index m,
                                          double mass_condition = 30,
                                          double stiffness_condition = 30) {
  analysis::TaskImpedance arm;
  arm.mass = graded(random, n, 3, mass_condition);
  arm.jacobian = 0.5 * random.matrix(m, n);
  arm.task_stiffness = graded(random, m, 3000, stiffness_condition);
  return arm;
}

/// An arm of 7 joints and 6 directions at some configurations of a path.
inline std::vector<analysis::TaskImpedance> path_of_configurations(Random& random, int count) {
  const analysis::TaskImpedance arm = random_arm(random, 7, 6, 10, 30);
  const Eigen::MatrixXd swing = random.matrix(6, 7), root = 0.2 * random.matrix(7, 7);
  std::vector<analysis::TaskImpedance> result;
  for (int i = 0; i < count; ++i) {
    const double angle = 0.4 * std::sin(0.5 * i);
    analysis::TaskImpedance one = arm;
    one.jacobian = *arm.jacobian + 0.3 * angle * swing;
    const Eigen::MatrixXd T = Eigen::MatrixXd::Identity(7, 7) + angle * root;
    const Eigen::MatrixXd M = T * arm.mass * T.transpose();
    one.mass = 0.5 * (M + M.transpose());
    result.push_back(one);
  }
  return result;
}

/// K_C or C_C with rows and columns of zeros for the directions that are not there.
inline analysis::TaskMatrix padded(const Eigen::MatrixXd& A) {
  analysis::TaskMatrix result = analysis::TaskMatrix::Zero();
  result.topLeftCorner(A.rows(), A.cols()) = A;
  return result;
}

/// Joint friction that is strong in some joints and weak in others; N m s/rad.
inline Eigen::MatrixXd random_friction(Random& random, Eigen::Index n, double size) {
  Eigen::VectorXd values(n);
  for (double& value : values) value = size * random.log_uniform(0.01, 1);
  return values.asDiagonal();
}

}  // namespace dashpot::testing
