// A kernel never touches the heap.
#include <dashpot/controller/dynamics.hpp>
#include <dashpot/tests/support/count_allocations.hpp>
#include <dashpot/tests/support/random.hpp>
#include <dashpot/tests/support/random_robot.hpp>

#include <gtest/gtest.h>

#include <utility>

namespace dashpot::controller {
namespace {

using testing::allocations_of;

template <int N>
void expect_none(testing::Random& random) {
  const RobotModel model = RobotModel::from_urdf_text(
      testing::RandomRobot(random.engine()()).chain(N, 0.3), "link0", "tip");
  const DynamicsKernel<N> kernel(model);
  const Eigen::Matrix<double, N, 1> q = random.vector(N), qd = random.vector(N);
  Dynamics<N> result;
  static_assert(noexcept(kernel.evaluate(q, qd, result)));
  EXPECT_EQ(allocations_of([&] { kernel.evaluate(q, qd, result); }), 0) << N;
  EXPECT_EQ(allocations_of([&] { kernel.evaluate(1e9 * q, qd, result); }), 0) << N;
}

TEST(DynamicsAllocation, DoesNotHappen) {
  if (!DASHPOT_COUNTS_ALLOCATIONS) GTEST_SKIP() << "the sanitizer owns malloc";
  EXPECT_GE(allocations_of([] { ::operator delete(::operator new(100)); }), 1);
  testing::Random random(751);
  [&]<int... I>(std::integer_sequence<int, I...>) {
    (expect_none<I + 1>(random), ...);
  }
  (std::make_integer_sequence<int, kMaxJoints>{});
}

}  // namespace
}  // namespace dashpot::controller
