// Once set up, neither a step of the plant nor the dynamics in it touches the heap.
#include <dashpot/tests/sim/chains.hpp>
#include <dashpot/tests/sim/scenes.hpp>

#include <gtest/gtest.h>

#include <cerrno>
#include <cstdlib>

// Sanitizers bring their own malloc: there nothing is counted, and the test says so.
#if defined(__SANITIZE_ADDRESS__) || defined(__SANITIZE_THREAD__)
#define DASHPOT_COUNTS_ALLOCATIONS 0
#elif defined(__has_feature)
#if __has_feature(address_sanitizer) || __has_feature(thread_sanitizer) || \
    __has_feature(memory_sanitizer)
#define DASHPOT_COUNTS_ALLOCATIONS 0
#endif
#endif
#if !defined(DASHPOT_COUNTS_ALLOCATIONS) && defined(__GLIBC__)
#define DASHPOT_COUNTS_ALLOCATIONS 1
#elif !defined(DASHPOT_COUNTS_ALLOCATIONS)
#define DASHPOT_COUNTS_ALLOCATIONS 0
#endif

namespace {
// Only what the thread that has the flag on allocates is counted.
constinit thread_local bool counting = false;
constinit thread_local int allocations = 0;

[[maybe_unused]] void note_allocation() {
  if (counting) ++allocations;  // a breakpoint here shows who allocates
}
}  // namespace

#if DASHPOT_COUNTS_ALLOCATIONS
// The program's own malloc and relatives, on top of glibc's; operator new and Eigen call them.
extern "C" {
void* __libc_malloc(std::size_t size);
void* __libc_calloc(std::size_t count, std::size_t size);
void* __libc_realloc(void* block, std::size_t size);
void* __libc_memalign(std::size_t alignment, std::size_t size);

void* malloc(std::size_t size) noexcept {
  note_allocation();
  return __libc_malloc(size);
}
void* calloc(std::size_t count, std::size_t size) noexcept {
  note_allocation();
  return __libc_calloc(count, size);
}
void* realloc(void* block, std::size_t size) noexcept {
  note_allocation();
  return __libc_realloc(block, size);
}
void* aligned_alloc(std::size_t alignment, std::size_t size) noexcept {
  note_allocation();
  return __libc_memalign(alignment, size);
}
void* memalign(std::size_t alignment, std::size_t size) noexcept {
  note_allocation();
  return __libc_memalign(alignment, size);
}
int posix_memalign(void** block, std::size_t alignment, std::size_t size) noexcept {
  note_allocation();
  *block = __libc_memalign(alignment, size);
  return *block != nullptr ? 0 : ENOMEM;
}
}
#endif

namespace dashpot::sim {
namespace {

using testing::joints;

/// Allocations of this thread while `act` runs.
template <class Act>
int allocations_of(const Act& act) {
  allocations = 0;
  counting = true;
  act();
  counting = false;
  return allocations;
}

TEST(Allocation, IsSeenByThisTest) {
  if (!DASHPOT_COUNTS_ALLOCATIONS) GTEST_SKIP() << "the sanitizer owns malloc";
  EXPECT_EQ(allocations_of([] {}), 0);
  EXPECT_GE(allocations_of([] { ::operator delete(::operator new(100)); }), 1);
  Eigen::MatrixXd matrix;
  EXPECT_GE(allocations_of([&] { matrix.resize(7, 7); }), 1);
  void* block = nullptr;
  EXPECT_GE(allocations_of([&] { EXPECT_EQ(posix_memalign(&block, 64, 128), 0); }), 1);
  std::free(block);
}

/// A loop over every feature, with a command that fails in between.
void expect_no_allocation(System& system, PlantOptions options, const JointVector& start) {
  const Eigen::Index n = start.size();
  options.torque_limit = JointVector::Constant(n, 50);
  options.delay = 2;
  options.torque_cutoff = 100;
  options.position_noise = JointVector::Constant(n, 1e-5);
  options.velocity_noise = JointVector::Constant(n, 1e-5);
  options.position_resolution = JointVector::Constant(n, 1e-5);
  for (const bool difference : {false, true}) {
    options.difference_velocity = difference;
    for (const Method method : testing::kMethods) {
      for (const bool adaptive : {false, true}) {
        options.integrator.method = method;
        options.integrator.adaptive =
            adaptive && (method == Method::kDormandPrince || method == Method::kRosenbrock);
        Plant plant(system, options, start);
        JointVector torque = JointVector::Constant(n, 3);
        const JointVector bad = JointVector::Constant(n, std::nan(""));
        Status status = Status::kOk, refused = Status::kOk;
        EnergyAudit audit;
        EXPECT_EQ(allocations_of([&] {
                    for (int i = 0; i < 200 && status == Status::kOk; ++i) {
                      torque = -20 * plant.measured().velocity;
                      status = plant.step(torque);
                      refused = plant.step(bad);
                      audit = plant.audit();
                    }
                  }),
                  0)
            << "method " << static_cast<int>(method) << ", adaptive " << adaptive;
        EXPECT_EQ(status, Status::kOk);
        EXPECT_EQ(refused, Status::kCommandNotFinite);
      }
    }
  }
}

TEST(Allocation, DoesNotHappenInAStepOfAnArm) {
  if (!DASHPOT_COUNTS_ALLOCATIONS) GTEST_SKIP() << "the sanitizer owns malloc";
  const testing::ChainFile file = testing::panda_file();
  RobotParameters parameters;
  parameters.armature = JointVector::Constant(7, 0.2);
  parameters.coulomb = JointVector::Constant(7, 0.3);
  const JointVector home = joints({0, -0.7, 0.2, -2.3, 0, 1.5, 0.7});
  ArmOptions options;
  options.stops = Contact{1000, 5};
  options.wrenches = {{0.0105, 0.0303, 10 * Vector6::Ones()}};
  Arm free(testing::robot_of(file, parameters));
  options.wall = Wall{free.tip_pose(home).position - Eigen::Vector3d(0, 0, 0.005), {0, 0, 1}, {}};
  options.wall->contact = Contact{1e4, 50};
  Arm arm(testing::robot_of(file, parameters), options);
  expect_no_allocation(arm, {}, home);
}

TEST(Allocation, DoesNotHappenInAStepOfALinearSystem) {
  if (!DASHPOT_COUNTS_ALLOCATIONS) GTEST_SKIP() << "the sanitizer owns malloc";
  const testing::Chain3 chain;
  LinearSystem system(chain.M, chain.C, chain.K, {{0.0105, 0.0303, joints({1, 2, 3})}});
  expect_no_allocation(system, {}, joints({0, 0.03, 0}));
}

}  // namespace
}  // namespace dashpot::sim
