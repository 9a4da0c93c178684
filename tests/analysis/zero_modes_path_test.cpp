// Arms with several zero modes, as a stiffness of translations alone leaves them: their rates often
// coincide, and must not keep the modes from being followed.
#include <dashpot/tests/support/random.hpp>
#include <dashpot/tests/support/tracked.hpp>

#include <gtest/gtest.h>

#include <array>

namespace dashpot::analysis {
namespace {

using Eigen::MatrixXd;
using Eigen::VectorXd;
using testing::Random;

enum class Friction {
  kNone,      ///< of the zero modes: all rates are zero
  kEqual,     ///< one rate for all
  kSmall,     ///< of each joint, a millionth of the springs' damping
  kOrdinary,  ///< of each joint
};
void PrintTo(Friction friction, std::ostream* out) {
  *out << std::array{"none", "equal", "small", "ordinary"}[static_cast<std::size_t>(friction)];
}

class SeveralZeroModes : public ::testing::TestWithParam<std::tuple<int, Friction>> {};

TEST_P(SeveralZeroModes, AreFollowed) {
  const auto [p, friction] = GetParam();
  const int n = 9;
  Random random(5400U + static_cast<unsigned>(p));
  const MatrixXd M = MatrixXd::Identity(n, n) + 0.1 / n * random.spd(n);
  MatrixXd W = 0.3 * random.matrix(p, n);
  for (int i = 0; i < p; ++i) W(i, i) += 10 + 2 * i;
  const MatrixXd dM = 1e-6 * random.spd(n), dW = 1e-3 * random.matrix(p, n);
  const VectorXd joints = VectorXd::NullaryExpr(n, [&] { return random.uniform(0.5, 2); });
  const auto at = [&, kind = friction](double step) {
    System<kMaxDof> system(n);
    system.mass = M + step * dM;
    const MatrixXd factor = W + step * dW;
    system.stiffness_factor = factor;
    MatrixXd C = 0.03 * factor.transpose() * factor;
    if (kind == Friction::kEqual) C += 0.5 * system.mass;
    if (kind == Friction::kSmall) C += 1e-6 * MatrixXd(joints.asDiagonal());
    if (kind == Friction::kOrdinary) C += MatrixXd(joints.asDiagonal());
    system.damping = 0.5 * (C + C.transpose());
    return system;
  };
  testing::Follower follower;
  follower.follow(at, 250, 249, 50);
  follower.expect_followed();
  EXPECT_LE(follower.counters().iterations, 650);
  ASSERT_EQ(follower.spectrum->zero_mode_count, n - p);
  const auto truth = testing::true_eigenvalues(at(249));
  for (int k = 0; k < n - p; ++k) {
    const Complex rate = follower.spectrum->zero_mode_rates[static_cast<std::size_t>(k)];
    EXPECT_LE(testing::distance_to_nearest(rate, truth), 1e-11);
  }
}

INSTANTIATE_TEST_SUITE_P(Arms, SeveralZeroModes,
                         ::testing::Combine(::testing::Values(1, 2, 3, 6),
                                            ::testing::Values(Friction::kNone, Friction::kEqual,
                                                              Friction::kSmall,
                                                              Friction::kOrdinary)));

}  // namespace
}  // namespace dashpot::analysis
