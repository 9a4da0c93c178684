#pragma once
// Random numbers and matrices from a seed, for programs; random.hpp is for tests.

#include <Eigen/Core>
#include <Eigen/QR>
#include <cmath>
#include <cstdint>
#include <random>

namespace dashpot::testing {

class Dice {
 public:
  explicit Dice(std::uint64_t seed) : engine_(seed) {}

  std::mt19937_64& engine() { return engine_; }

  double uniform(double low, double high) {
    return std::uniform_real_distribution<double>(low, high)(engine_);
  }
  /// Magnitudes of low and of high are equally likely, and all between.
  double log_uniform(double low, double high) {
    return std::exp(uniform(std::log(low), std::log(high)));
  }
  int integer(int low, int high) { return std::uniform_int_distribution<int>(low, high)(engine_); }
  double normal() { return std::normal_distribution<double>()(engine_); }

  /// Entries of standard normal distribution.
  Eigen::MatrixXd matrix(Eigen::Index rows, Eigen::Index cols) {
    std::normal_distribution<double> normal;
    return Eigen::MatrixXd::NullaryExpr(rows, cols, [&] { return normal(engine_); });
  }
  Eigen::VectorXd vector(Eigen::Index n) { return matrix(n, 1); }

  /// Symmetric and positive definite, entries of order one.
  Eigen::MatrixXd spd(Eigen::Index n) {
    const Eigen::MatrixXd root = matrix(n, n);
    const Eigen::MatrixXd product = root * root.transpose() + Eigen::MatrixXd::Identity(n, n);
    return (product + product.transpose()) / (2.0 * static_cast<double>(n));
  }
  Eigen::MatrixXd rotation(Eigen::Index n) {
    return Eigen::HouseholderQR<Eigen::MatrixXd>(matrix(n, n)).householderQ();
  }
  /// Magnitudes of 1 to `range`.
  Eigen::VectorXd log_vector(Eigen::Index n, double range) {
    return Eigen::VectorXd::NullaryExpr(n, [&] { return log_uniform(1, range); });
  }
  /// A regular T (n x n), M = T' T of condition number up to `range` squared.
  Eigen::MatrixXd congruence(Eigen::Index n, double range) {
    return rotation(n) * log_vector(n, range).asDiagonal() * rotation(n);
  }

 private:
  std::mt19937_64 engine_;
};

}  // namespace dashpot::testing
