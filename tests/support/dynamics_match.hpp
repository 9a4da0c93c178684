#pragma once
// EXPECT_TRUE(same_dynamics(computed, expected, qd, 1e-12)): every term, scaled by what it is made
// of.

#include <dashpot/controller/dynamics.hpp>
#include <dashpot/tests/support/matrices.hpp>

namespace dashpot::testing {

/// M relative to sqrt(M_ii M_jj); terms with qd to the largest entries of M or J times |qd|^2; the
/// rest to its largest entry, J also to 1 m and poses too.
inline ::testing::AssertionResult same_dynamics(const controller::DynamicsResult& computed,
                                                const controller::DynamicsResult& expected,
                                                const controller::JointVector& qd,
                                                double tolerance) {
  const Eigen::VectorXd root = expected.M.diagonal().cwiseSqrt().cwiseInverse();
  const double speed = qd.squaredNorm();
  const auto largest = [](const auto& matrix) { return matrix.cwiseAbs().maxCoeff(); };
  const auto check = [&](const char* name, const auto& a, const auto& b, double scale) {
    return near(a, b, tolerance * scale) << " in " << name;
  };
  auto result = check("M", (root.asDiagonal() * computed.M * root.asDiagonal()).eval(),
                      (root.asDiagonal() * expected.M * root.asDiagonal()).eval(), 1);
  if (!result) return result;
  result = check("coriolis", computed.coriolis, expected.coriolis, largest(expected.M) * speed);
  if (!result) return result;
  result = check("gravity", computed.gravity, expected.gravity, largest(expected.gravity));
  if (!result) return result;
  const double reach = std::max(1.0, largest(expected.J));
  result = check("J", computed.J, expected.J, reach);
  if (!result) return result;
  result = check("Jdot_qd", computed.Jdot_qd, expected.Jdot_qd, reach * speed);
  if (!result) return result;
  result =
      check("p_BT_B", computed.p_BT_B, expected.p_BT_B, std::max(1.0, largest(expected.p_BT_B)));
  if (!result) return result;
  return check("R_BT", computed.R_BT, expected.R_BT, 1);
}

}  // namespace dashpot::testing
