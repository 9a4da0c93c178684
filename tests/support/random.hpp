#pragma once
// Random numbers and matrices for tests, from a seed that every failure prints.

#include <dashpot/tests/support/dice.hpp>

#include <gtest/gtest.h>

#include <Eigen/Geometry>
#include <string>

namespace dashpot::testing {

/// While it lives, failures of the test show the seed:
///     Random random(7);
///     const Eigen::MatrixXd M = random.spd(5);
class Random : public Dice {
 public:
  explicit Random(std::uint64_t seed)
      : Dice(seed), trace_(__FILE__, __LINE__, "seed " + std::to_string(seed)) {}

 private:
  ::testing::ScopedTrace trace_;
};

inline Eigen::Quaterniond random_rotation(Random& random) {
  return Eigen::Quaterniond(Eigen::Vector4d(random.vector(4).normalized()));
}

}  // namespace dashpot::testing
