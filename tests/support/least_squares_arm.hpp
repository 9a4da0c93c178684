#pragma once
// Rotors of an arm by ordinary least squares, as textbooks do it (J. Swevers et al., IEEE Control
// Systems 27(5), 2007): positions and torques through one low-pass without phase, velocities and
// accelerations by central differences, and for each joint an offset, two kinds of friction and a
// rotor. The payload is taken for known.

#include <dashpot/controller/dynamics.hpp>
#include <dashpot/controller/robot_description.hpp>
#include <dashpot/identification/check_model.hpp>
#include <dashpot/identification/torque_record.hpp>

#include <Eigen/Cholesky>
#include <algorithm>
#include <cmath>
#include <numbers>
#include <vector>

namespace dashpot::testing {

inline std::vector<identification::Estimate> rotors_by_least_squares(
    const controller::RobotDescription& robot, const identification::TorqueRecord& record) {
  using Eigen::Index;
  using Eigen::MatrixXd;
  const controller::RobotModel model = robot.model();
  const controller::DynamicsKernel kernel(model);
  const double step = record.time[1] - record.time[0];
  constexpr double kHalfWidth = 0.1;  // s
  const auto m = static_cast<Index>(std::lround(kHalfWidth / step));
  Eigen::VectorXd window(2 * m + 1);
  for (Index i = -m; i <= m; ++i) {
    window[i + m] =
        1 + std::cos(std::numbers::pi * static_cast<double>(i) / static_cast<double>(m));
  }
  window /= window.sum();
  const Index n = record.position.rows(), N = record.time.size() - 2 * m;
  const auto smooth = [&](const MatrixXd& value) {
    MatrixXd result(n, N);
    for (Index i = 0; i < N; ++i) result.col(i) = value.middleCols(i, 2 * m + 1) * window;
    return result;
  };
  const MatrixXd q = smooth(record.position), torque = smooth(record.torque);
  std::vector<Eigen::Matrix4d> normal(static_cast<std::size_t>(n), Eigen::Matrix4d::Zero());
  std::vector<Eigen::Vector4d> moment(static_cast<std::size_t>(n), Eigen::Vector4d::Zero());
  std::vector<double> square(static_cast<std::size_t>(n));
  controller::DynamicsResult at;
  double count = 0;
  for (Index i = m; i + m < N; i += std::max<Index>(1, m / 10), ++count) {
    const Index reach = std::max<Index>(1, m / 10);
    const Eigen::VectorXd v =
        (q.col(i + reach) - q.col(i - reach)) / (2 * step * static_cast<double>(reach));
    const Eigen::VectorXd a = (q.col(i + reach) - 2 * q.col(i) + q.col(i - reach)) /
                              std::pow(step * static_cast<double>(reach), 2);
    kernel.evaluate(q.col(i), v, at);
    const Eigen::VectorXd rest = torque.col(i) - at.M * a - at.coriolis - at.gravity;
    for (Index j = 0; j < n; ++j) {
      const auto k = static_cast<std::size_t>(j);
      const Eigen::Vector4d row(1, v[j] > 0 ? 1 : -1, v[j], a[j]);
      normal[k] += row * row.transpose();
      moment[k] += row * rest[j];
      square[k] += rest[j] * rest[j];
    }
  }
  std::vector<identification::Estimate> rotors;
  for (std::size_t k = 0; k < normal.size(); ++k) {
    const Eigen::Vector4d x = normal[k].ldlt().solve(moment[k]);
    const double left = std::max(0.0, square[k] - x.dot(moment[k])) / (count - 4);
    identification::Estimate one;
    one.value = x[3];
    one.deviation = std::sqrt(left * normal[k].inverse()(3, 3));
    rotors.push_back(one);
  }
  return rotors;
}

}  // namespace dashpot::testing
