#pragma once
#include <dashpot/controller/robot_types.hpp>

#include <Eigen/Core>
#include <vector>

namespace dashpot::identification {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

/// A linear model of torques: row k n + j belongs to joint j in window k.
struct LinearModel {
  Index joints = 0;
  MatrixXd A;      ///< rows x parameters
  VectorXd y;      ///< rows
  VectorXd used;   ///< rows: 1, or 0 for a row that does not count
  VectorXd prior;  ///< parameters: standard deviation about zero; infinity: none
};

struct RobustFit {
  VectorXd value;
  MatrixXd covariance;
  VectorXd residual;  ///< rows, y - A value, of those that do not count as well
  VectorXd weight;    ///< rows, 0 to 1: less than 1 for outliers
  VectorXd sigma;     ///< joints, standard deviation of the residuals without outliers
  /// Orthonormal directions, in units of each parameter's `scale`, that the rows hardly determine.
  MatrixXd unseen;
  VectorXd scale;        ///< of parameters: the inverse norm of their weighted columns
  VectorXd inflation;    ///< joints, how many windows count as one, because residuals are alike
  double condition = 0;  ///< of the columns of norm 1, without unseen directions
};

/// Least squares with Tukey's weights, each joint in units of its own residuals. Undetermined
/// directions (singular values below 1e-5 of columns of norm 1) stay at zero.
///
/// Residuals are coloured, because errors of the model change slowly. So the covariance is, for
/// each parameter, the larger of two. One is the long-run variance of the scores by equal-weighted
/// cosines (E. Lazarus et al., Journal of Business & Economic Statistics 36(4), 2018), enlarged by
/// Student's t. The other is the covariance of least squares, times the sum of each joint's
/// autocorrelations up to the first negative pair (C. Geyer, Statistical Science 7(4), 1992), which
/// also counts residuals that repeat with a periodic motion.
RobustFit robust_fit(const LinearModel& model);

}  // namespace dashpot::identification
