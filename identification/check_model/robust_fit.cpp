#include <dashpot/identification/check_model/robust_fit.hpp>

#include <Eigen/QR>
#include <Eigen/SVD>
#include <algorithm>
#include <cmath>
#include <numbers>

namespace dashpot::identification {
namespace {

constexpr double kUnseen = 1e-5;

/// The solution by singular values, and the inverse of the normal matrix.
struct Solution {
  VectorXd value;
  MatrixXd inverse, unseen;
  VectorXd scale;
  double condition;
};

Solution solve(const LinearModel& model, const VectorXd& root_weight) {
  const Index p = model.A.cols();
  const auto priors = static_cast<Index>((model.prior.array() < 1e300).count());
  const Index rows = std::max(model.A.rows() + priors, p);
  MatrixXd A = MatrixXd::Zero(rows, p + 1);
  A.topRows(model.A.rows()).leftCols(p) = root_weight.asDiagonal() * model.A;
  A.col(p).head(model.A.rows()) = root_weight.cwiseProduct(model.y);
  Index row = model.A.rows();
  for (Index i = 0; i < p; ++i) {
    if (model.prior[i] < 1e300) A(row++, i) = 1 / model.prior[i];
  }
  Solution solution;
  solution.scale = A.leftCols(p).colwise().norm().transpose();
  // A column of zeros is seen by no row.
  solution.scale = (solution.scale.array() > 0).select(solution.scale.cwiseInverse(), 1);
  A.leftCols(p) *= solution.scale.asDiagonal();
  const Eigen::HouseholderQR<MatrixXd> qr(A);
  const Index kept = std::min(rows, p + 1);
  const MatrixXd R = qr.matrixQR().topRows(kept).triangularView<Eigen::Upper>();
  const Eigen::JacobiSVD<MatrixXd> svd(R.leftCols(p), Eigen::ComputeThinU | Eigen::ComputeFullV);
  const VectorXd& s = svd.singularValues();
  Index rank = 0;
  while (rank < s.size() && s[rank] > kUnseen) ++rank;
  const MatrixXd V = svd.matrixV().leftCols(rank);
  const VectorXd inverse = s.head(rank).cwiseInverse();
  solution.value = V * inverse.asDiagonal() * (svd.matrixU().leftCols(rank).transpose() * R.col(p));
  solution.value = solution.scale.cwiseProduct(solution.value);
  const MatrixXd root = solution.scale.asDiagonal() * V * inverse.asDiagonal();
  solution.inverse = root * root.transpose();
  solution.unseen = svd.matrixV().rightCols(p - rank);
  solution.condition = rank > 0 ? s[0] / s[rank - 1] : 0;
  return solution;
}

/// Standard deviation of each joint's residuals by their median size, which outliers hardly change.
VectorXd sizes(const LinearModel& model, const VectorXd& residual) {
  const Index n = model.joints;
  VectorXd sigma(n);
  for (Index j = 0; j < n; ++j) {
    std::vector<double> all;
    double largest = 0;
    for (Index row = j; row < residual.size(); row += n) {
      if (model.used[row] > 0) all.push_back(std::abs(residual[row]));
      largest = std::max(largest, std::abs(model.y[row]));
    }
    double median = 0;
    if (!all.empty()) {
      const auto middle = all.begin() + static_cast<std::ptrdiff_t>(all.size() / 2);
      std::nth_element(all.begin(), middle, all.end());
      median = *middle;
    }
    // No torque is known better than to a millionth.
    sigma[j] = std::max({median / 0.6745, 1e-6 * largest, 1e-12});
  }
  return sigma;
}

constexpr double kTukey = 6;  // deviations, beyond which nothing counts

/// Returns the sensitivity of a joint's parameters to its residuals, over the sensitivity with
/// constant weights w: mean w / mean (w r)'.
double response(const RobustFit& fit, const VectorXd& row_weight, Index joint) {
  double weight = 0, slope = 0;
  for (Index row = joint; row < fit.residual.size(); row += fit.sigma.size()) {
    if (row_weight[row] <= 0) continue;
    const double x = std::pow(fit.residual[row] / (kTukey * fit.sigma[joint]), 2);
    weight += std::pow(std::max(0.0, 1 - x), 2);
    slope += x < 1 ? (1 - x) * (1 - 5 * x) : 0;
  }
  return slope > 0 ? std::min(2.0, weight / slope) : 1;
}

/// Student's t for 95 % with `degrees` of freedom, over 1.96 (Cornish and Fisher).
double student(double degrees) {
  const double z = 1.959964, z3 = z * z * z, z5 = z3 * z * z;
  return 1 + ((z3 + z) / (4 * degrees) + (5 * z5 + 16 * z3 + 3 * z) / (96 * degrees * degrees)) / z;
}

/// Variance of the sum of the scores, which have a column for each window.
MatrixXd long_run_variance(const MatrixXd& scores, double& degrees) {
  const Index K = scores.cols();
  const auto N = static_cast<double>(K);
  const Index B = std::clamp<Index>(static_cast<Index>(0.4 * std::pow(N, 2.0 / 3.0)), 4, K);
  degrees = static_cast<double>(B);
  MatrixXd sums(scores.rows(), B);
  for (Index b = 0; b < B; ++b) {
    const VectorXd cosine = VectorXd::NullaryExpr(K, [&](Index k) {
      return std::sqrt(2.0) * std::cos(std::numbers::pi * static_cast<double>(b + 1) *
                                       (static_cast<double>(k) + 0.5) / N);
    });
    sums.col(b) = scores * cosine;
  }
  return sums * sums.transpose() / degrees;
}

/// Variance of the mean of these residuals, over the variance for white ones.
double inflation(const std::vector<double>& residual) {
  const std::size_t N = residual.size();
  double power = 0;
  for (const double r : residual) power += r * r;
  if (power == 0 || N < 4) return 1;
  const auto correlation = [&](std::size_t lag) {
    double sum = 0;
    for (std::size_t i = lag; i < N; ++i) sum += residual[i] * residual[i - lag];
    return sum / power;
  };
  double sum = 1 + 2 * correlation(1);
  for (std::size_t lag = 2; lag + 1 < N / 2; lag += 2) {
    const double pair = correlation(lag) + correlation(lag + 1);
    if (pair <= 0) break;
    sum += 2 * pair;
  }
  return std::max(1.0, sum);
}

MatrixXd covariance_of(const LinearModel& model, RobustFit& fit, const VectorXd& row_weight,
                       const MatrixXd& inverse) {
  const Index n = model.joints, K = model.y.size() / n, p = model.A.cols();
  const MatrixXd weighted = row_weight.asDiagonal() * model.A;
  const double per_joint = static_cast<double>(p) / static_cast<double>(n);
  MatrixXd scores(p, K), white = MatrixXd::Zero(p, p);
  fit.inflation = VectorXd::Ones(n);
  const VectorXd gain =
      VectorXd::NullaryExpr(n, [&](Index j) { return response(fit, row_weight, j); });
  for (Index k = 0; k < K; ++k) {
    scores.col(k) = weighted.middleRows(k * n, n).transpose() *
                    gain.cwiseProduct(fit.residual.segment(k * n, n));
  }
  for (Index j = 0; j < n; ++j) {
    std::vector<double> residual;
    double square = 0, count = 0, weight = 0;
    MatrixXd own = MatrixXd::Zero(p, p);
    for (Index row = j; row < model.y.size(); row += n) {
      if (row_weight[row] <= 0) continue;
      residual.push_back(fit.residual[row] * fit.weight[row] * gain[j]);
      square += residual.back() * residual.back();
      count += 1;
      weight += row_weight[row];
      own.noalias() += weighted.row(row).transpose() * model.A.row(row);
    }
    if (count == 0) continue;
    // The fit took degrees of freedom from few independent residuals.
    const double inflated = fit.inflation[j] = inflation(residual), independent = count / inflated;
    const double left = std::max(2.0, independent - per_joint);
    const double variance = square / (weight * std::pow(fit.sigma[j], 4));
    white += own * (variance * inflated * independent / left * std::pow(student(left), 2));
  }
  double degrees = 1;
  MatrixXd meat = long_run_variance(scores, degrees);
  for (Index i = 0; i < p; ++i) {
    if (model.prior[i] >= 1e300) continue;
    meat(i, i) += std::pow(model.prior[i], -2);
    white(i, i) += std::pow(model.prior[i], -2);
  }
  const double rows = (row_weight.array() > 0).cast<double>().sum();
  const double spent = rows / std::max(1.0, rows - static_cast<double>(p));
  const MatrixXd first = inverse * meat * inverse * (spent * std::pow(student(degrees), 2));
  const MatrixXd second = inverse * white * inverse;
  VectorXd larger(p);
  for (Index i = 0; i < p; ++i) {
    larger[i] = second(i, i) > 0 ? std::sqrt(std::max(1.0, first(i, i) / second(i, i))) : 1;
  }
  return larger.asDiagonal() * second * larger.asDiagonal();
}

}  // namespace

RobustFit robust_fit(const LinearModel& model) {
  const Index n = model.joints;
  RobustFit fit;
  fit.weight = VectorXd::Ones(model.y.size());
  fit.residual = model.y;
  fit.sigma = sizes(model, fit.residual);
  Solution solution;
  VectorXd row_weight(model.y.size());
  constexpr int kRounds = 10;
  for (int round = 0; round < kRounds; ++round) {
    for (Index row = 0; row < model.y.size(); ++row) {
      row_weight[row] = model.used[row] * fit.weight[row] / std::pow(fit.sigma[row % n], 2);
    }
    solution = solve(model, row_weight.cwiseSqrt());
    fit.value = solution.value;
    fit.residual = model.y - model.A * fit.value;
    fit.sigma = sizes(model, fit.residual);
    if (round + 1 == kRounds) break;
    // Huber's weights first, which converge from any start, then Tukey's, which drop outliers
    // entirely.
    const bool far = round < kRounds / 2;
    for (Index row = 0; row < model.y.size(); ++row) {
      const double size = std::abs(fit.residual[row]) / fit.sigma[row % n];
      const double share = size / kTukey;
      fit.weight[row] = far         ? std::min(1.0, 1.345 / std::max(size, 1e-300))
                        : share < 1 ? std::pow(1 - share * share, 2)
                                    : 0;
    }
  }
  fit.covariance = covariance_of(model, fit, row_weight, solution.inverse);
  fit.unseen = solution.unseen;
  fit.scale = solution.scale;
  fit.condition = solution.condition;
  return fit;
}

}  // namespace dashpot::identification
