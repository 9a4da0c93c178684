#pragma once
// EXPECT_TRUE(near(computed, expected, tolerance)) for matrices: a failure names the worst entry.

#include <gtest/gtest.h>

#include <Eigen/Core>
#include <cmath>

namespace dashpot::testing {

/// Every entry within the absolute tolerance; infinite ones have to be equal.
template <class Computed, class Expected>
::testing::AssertionResult near(const Eigen::MatrixBase<Computed>& computed,
                                const Eigen::MatrixBase<Expected>& expected, double tolerance) {
  if (computed.rows() != expected.rows() || computed.cols() != expected.cols()) {
    return ::testing::AssertionFailure()
           << "computed is " << computed.rows() << " x " << computed.cols() << ", expected is "
           << expected.rows() << " x " << expected.cols();
  }
  double worst = 0;
  Eigen::Index row = 0;
  Eigen::Index col = 0;
  for (Eigen::Index j = 0; j < computed.cols(); ++j) {
    for (Eigen::Index i = 0; i < computed.rows(); ++i) {
      const double error =
          computed(i, j) == expected(i, j) ? 0 : std::abs(computed(i, j) - expected(i, j));
      if (!(error <= worst)) {  // a NaN is the worst of all
        worst = error;
        row = i;
        col = j;
        if (std::isnan(error)) break;
      }
    }
    if (std::isnan(worst)) break;
  }
  if (worst <= tolerance) return ::testing::AssertionSuccess();
  return ::testing::AssertionFailure()
         << "entry (" << row + 1 << "," << col + 1 << ") is " << computed(row, col) << ", expected "
         << expected(row, col) << ": off by " << worst << ", more than " << tolerance;
}

}  // namespace dashpot::testing
