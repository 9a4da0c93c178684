#pragma once
#include <dashpot/controller/robot_types.hpp>

#include <Eigen/Core>
#include <vector>

namespace dashpot::identification {

/// A linear model of torques: row k n + j belongs to joint j in window k.
struct LinearModel {
  Eigen::Index joints = 0;
  Eigen::MatrixXd A;      ///< rows x parameters
  Eigen::VectorXd y;      ///< rows
  Eigen::VectorXd used;   ///< rows: 1, or 0 for a row that does not count
  Eigen::VectorXd prior;  ///< parameters: standard deviation about zero; infinity: none
};

struct RobustFit {
  Eigen::VectorXd value;
  Eigen::MatrixXd covariance;
  Eigen::VectorXd residual;  ///< rows, y - A value, of those that do not count as well
  Eigen::VectorXd weight;    ///< rows, 0 to 1: what outliers are left with
  Eigen::VectorXd sigma;     ///< joints, standard deviation of the residuals without outliers
  /// Orthonormal directions, in units of each parameter's `scale`, that the rows say next to
  /// nothing about.
  Eigen::MatrixXd unseen;
  Eigen::VectorXd scale;  ///< of parameters: the inverse norm of their weighted columns
  Eigen::VectorXd
      inflation;         ///< joints, how many windows count as one, because residuals are alike
  double condition = 0;  ///< of the columns of norm 1, without unseen directions
};

/// Least squares with Tukey's weights, each joint in units of its own residuals. What the rows do
/// not see (singular values below 1e-5 of columns of norm 1) stays at zero.
///
/// Residuals are coloured: what the model lacks changes slowly. So the covariance is, for each
/// parameter, the larger of two. One is the long-run variance of the scores by equal-weighted
/// cosines (E. Lazarus et al., Journal of Business & Economic Statistics 36(4), 2018), enlarged by
/// Student's t. The other is that of least squares, times the sum of each joint's autocorrelations
/// up to the first negative pair (C. Geyer, Statistical Science 7(4), 1992), which also counts what
/// repeats with a periodic motion and so is always in step with it.
RobustFit robust_fit(const LinearModel& model);

}  // namespace dashpot::identification
