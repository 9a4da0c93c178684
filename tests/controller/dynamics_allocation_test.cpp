// A kernel never touches the heap.
#include <dashpot/controller/dynamics.hpp>
#include <dashpot/tests/support/count_allocations.hpp>
#include <dashpot/tests/support/random.hpp>
#include <dashpot/tests/support/random_robot.hpp>

#include <gtest/gtest.h>

namespace dashpot::controller {
namespace {

using testing::allocations_of;

void expect_none(testing::Random& random, int n) {
  const RobotModel model = RobotModel::from_urdf_text(
      testing::RandomRobot(random.engine()()).chain(n, 0.3), "link0", "tip");
  const DynamicsKernel kernel(model);
  const JointVector q = random.vector(n), qd = random.vector(n);
  DynamicsResult result;
  static_assert(noexcept(kernel.evaluate(q, qd, result)));
  EXPECT_EQ(allocations_of([&] { kernel.evaluate(q, qd, result); }), 0) << n;
  EXPECT_EQ(allocations_of([&] { kernel.evaluate(1e9 * q, qd, result); }), 0) << n;
}

TEST(DynamicsAllocation, DoesNotHappen) {
  if (!DASHPOT_COUNTS_ALLOCATIONS) GTEST_SKIP() << "the sanitizer owns malloc";
  EXPECT_GE(allocations_of([] { ::operator delete(::operator new(100)); }), 1);
  testing::Random random(751);
  for (int n = 1; n <= kMaxJoints; ++n) expect_none(random, n);
}

}  // namespace
}  // namespace dashpot::controller
