#pragma once
// The two fully printed examples of the source paper (Kao and Saldarriaga, ROBOMECH Journal 8:12,
// 2021), and comparison with what it prints.

#include <dashpot/analysis/task_space.hpp>

#include <gtest/gtest.h>

#include <cmath>
#include <cstdlib>
#include <string>
#include <vector>

namespace dashpot::testing {

/// Three masses, free to drift (Fig. 2, Eq. 38).
inline analysis::System<> paper_chain() {
  analysis::System<> system(3);
  system.mass.diagonal() << 8, 2, 5;
  system.damping << 25, -15, -10, -15, 35, -20, -10, -20, 30;
  system.stiffness << 3600, -1200, -2400, -1200, 2700, -1500, -2400, -1500, 3900;
  return system;
}

/// Baxter arm: seven joints, five task directions (Appendix 3).
inline analysis::TaskImpedance paper_baxter() {
  analysis::TaskImpedance arm;
  arm.mass.resize(7, 7);
  arm.mass << 3.414, -0.6947, -0.1556, -0.4560, 1.934, -0.3131, 0.2101,  //
      -0.6947, 8.710, 0.3832, 5.484, 0.1270, 3.108, -0.08658,            //
      -0.1556, 0.3832, 3.860, 0.1785, 1.995, 0.2056, 0.1165,             //
      -0.4560, 5.484, 0.1785, 4.831, 0.04439, 2.444, -0.07011,           //
      1.934, 0.1270, 1.995, 0.04439, 2.770, -0.01395, 0.2296,            //
      -0.3131, 3.108, 0.2056, 2.444, -0.01395, 2.459, -0.07805,          //
      0.2101, -0.08658, 0.1165, -0.07011, 0.2296, -0.07805, 0.08852;
  Eigen::MatrixXd J(5, 7);
  J << -0.57, -0.1280, -0.3816, -0.2208, -0.1616, -0.1613, 0,  //
      0.57, -0.1280, 0.3816, -0.2208, 0.1616, -0.1613, 0,      //
      0, -0.7371, 0, -0.3903, 0, -0.02537, 0,                  //
      0, -0.7071, 0.6028, -0.7071, 0.6930, -0.7071, 0.07818,   //
      0, 0.7071, 0.6028, 0.7071, 0.6930, 0.7071, 0.07818;
  arm.jacobian = J;
  arm.task_stiffness = Eigen::MatrixXd(Eigen::VectorXd{{300, 200, 100, 10, 7}}.asDiagonal());
  arm.task_damping = Eigen::MatrixXd(Eigen::VectorXd{{3.5, 2.5, 2.5, 2, 1}}.asDiagonal());
  return arm;
}

/// One unit of the last printed digit: 0.001 for "21.970", 1 for "1200".
inline double printed_unit(const std::string& text) {
  const std::size_t point = text.find('.');
  return point == std::string::npos ? 1.0
                                    : std::pow(10.0, -static_cast<double>(text.size() - point - 1));
}

/// Every entry within some units of its last printed digit: the paper's inputs have four digits,
/// and its results are cut at times instead of rounded.
inline ::testing::AssertionResult as_printed(const Eigen::MatrixXd& computed,
                                             const std::vector<std::vector<std::string>>& printed,
                                             double units = 2) {
  if (computed.rows() != static_cast<Eigen::Index>(printed.size())) {
    return ::testing::AssertionFailure() << computed.rows() << " rows";
  }
  for (Eigen::Index i = 0; i < computed.rows(); ++i) {
    const auto& row = printed[static_cast<std::size_t>(i)];
    if (computed.cols() != static_cast<Eigen::Index>(row.size())) {
      return ::testing::AssertionFailure() << computed.cols() << " columns";
    }
    for (Eigen::Index j = 0; j < computed.cols(); ++j) {
      const std::string& text = row[static_cast<std::size_t>(j)];
      const double error = std::abs(computed(i, j) - std::strtod(text.c_str(), nullptr));
      if (!(error <= units * printed_unit(text))) {
        return ::testing::AssertionFailure() << "entry (" << i + 1 << "," << j + 1 << ") is "
                                             << computed(i, j) << ", printed " << text;
      }
    }
  }
  return ::testing::AssertionSuccess();
}

}  // namespace dashpot::testing
