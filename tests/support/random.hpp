#pragma once
// Random numbers and matrices for tests, from a seed that every failure prints.

#include <gtest/gtest.h>

#include <Eigen/Core>
#include <Eigen/Geometry>
#include <cmath>
#include <cstdint>
#include <random>
#include <string>

namespace dashpot::testing {

/// While it lives, failures of the test show the seed:
///     Random random(7);
///     const Eigen::MatrixXd M = random.spd(5);
class Random {
 public:
  explicit Random(std::uint64_t seed)
      : engine_(seed), trace_(__FILE__, __LINE__, "seed " + std::to_string(seed)) {}

  std::mt19937_64& engine() { return engine_; }

  double uniform(double low, double high) {
    return std::uniform_real_distribution<double>(low, high)(engine_);
  }
  /// Magnitudes of low and of high are equally likely, and all between.
  double log_uniform(double low, double high) {
    return std::exp(uniform(std::log(low), std::log(high)));
  }
  int integer(int low, int high) { return std::uniform_int_distribution<int>(low, high)(engine_); }

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

 private:
  std::mt19937_64 engine_;
  ::testing::ScopedTrace trace_;
};

inline Eigen::Quaterniond random_rotation(Random& random) {
  return Eigen::Quaterniond(Eigen::Vector4d(random.vector(4).normalized()));
}

}  // namespace dashpot::testing
