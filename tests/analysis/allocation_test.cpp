// A solver of fixed capacity never touches the heap, and finds what the dynamic one finds.
#include <dashpot/analysis/mode_tracker.hpp>
#include <dashpot/analysis/ratio_damping.hpp>
#include <dashpot/analysis/spectrum.hpp>
#include <dashpot/tests/support/count_allocations.hpp>
#include <dashpot/tests/support/random.hpp>
#include <dashpot/tests/support/random_arms.hpp>
#include <dashpot/tests/support/systems.hpp>

#include <gtest/gtest.h>

#include <memory>

namespace dashpot::analysis {
namespace {

using Eigen::MatrixXd;
using testing::allocations_of;
using testing::Random;
using testing::symmetrized;

struct Named {
  std::string name;
  System<> system;
};

/// One system of every kind, with n coordinates.
std::vector<Named> systems_of_every_kind(Random& random, int n) {
  const MatrixXd Z = MatrixXd::Zero(n, n);
  const MatrixXd M = random.spd(n), K = 50 * random.spd(n), D = random.spd(n);
  const MatrixXd W = random.matrix((n + 1) / 2, n), WW = symmetrized(W.transpose() * W);
  const MatrixXd skew = random.matrix(n, n);
  std::vector<Named> all;
  const auto add = [&](const char* name, const MatrixXd& damping, const MatrixXd& stiffness) {
    System<> system(n);
    system.mass = M;
    system.damping = damping;
    system.stiffness = stiffness;
    all.push_back({name, system});
  };
  add("light", 0.01 * D, K);
  add("heavy", 100 * D, K);
  add("undamped", Z, K);
  add("free", Z, Z);
  add("free and damped", D, Z);
  add("critical and coinciding", 8 * M, 16 * M);
  add("coupled zero modes", D, WW);
  add("zero modes, task damping", 0.1 * WW, WW);
  add("factor given", 0.1 * D, WW);
  all.back().system.stiffness_factor = W;
  add("not symmetric", D, K + 0.1 * (skew - skew.transpose()));
  add("not symmetric, zero modes", D, W.transpose() * random.matrix(W.rows(), W.rows()) * W);
  add("negative damping", -0.1 * D, K);
  add("indefinite stiffness", D, symmetrized(skew));
  add("not finite", D / 0.0, K);
  return all;
}

System<kMaxDof> fixed(const System<>& system) {
  System<kMaxDof> result(system.dof());
  result.mass = system.mass;
  result.damping = system.damping;
  result.stiffness = system.stiffness;
  result.stiffness_factor = system.stiffness_factor;
  return result;
}

TEST(Allocation, IsSeenByThisTest) {
  if (!DASHPOT_COUNTS_ALLOCATIONS) GTEST_SKIP() << "the sanitizer owns malloc";
  EXPECT_EQ(allocations_of([] {}), 0);
  EXPECT_GE(allocations_of([] { ::operator delete(::operator new(100)); }), 1);
  MatrixXd matrix;
  EXPECT_GE(allocations_of([&] { matrix.resize(7, 7); }), 1);
  void* block = nullptr;
  EXPECT_GE(allocations_of([&] { EXPECT_EQ(posix_memalign(&block, 64, 128), 0); }), 1);
  std::free(block);
  Random random(601);
  const System<> system = systems_of_every_kind(random, 4).front().system;
  SpectrumSolver<> solver;
  Spectrum<> spectrum;
  EXPECT_GE(allocations_of([&] { solver.solve(system, spectrum); }), 1);
}

TEST(Allocation, DoesNotHappenInASolverOfFixedCapacity) {
  if (!DASHPOT_COUNTS_ALLOCATIONS) GTEST_SKIP() << "the sanitizer owns malloc";
  Random random(602);
  const auto spectrum = std::make_unique<Spectrum<kMaxDof>>();
  for (const auto residual :
       {SpectrumOptions::Residual::kAutomatic, SpectrumOptions::Residual::kWorking,
        SpectrumOptions::Residual::kExtended}) {
    SpectrumOptions options;
    options.residual = residual;
    const auto solver = std::make_unique<SpectrumSolver<kMaxDof>>(options);
    for (int n = 0; n <= kMaxDof; ++n) {
      for (const Named& one : systems_of_every_kind(random, n)) {
        const System<kMaxDof> system = fixed(one.system);
        EXPECT_EQ(allocations_of([&] { solver->solve(system, *spectrum); }), 0)
            << one.name << ", n = " << n;
      }
    }
  }
}

TEST(Allocation, DoesNotHappenInTheModeTracker) {
  if (!DASHPOT_COUNTS_ALLOCATIONS) GTEST_SKIP() << "the sanitizer owns malloc";
  Random random(604);
  const auto tracker = std::make_unique<ModeTracker>();
  const auto spectrum = std::make_unique<TrackedSpectrum>();
  for (int n = 0; n <= kMaxDof; ++n) {
    for (const Named& one : systems_of_every_kind(random, n)) {
      System<kMaxDof> system = fixed(one.system);
      for (int step = 0; step < 4; ++step) {  // start, follow, follow the prediction, reuse
        if (step < 3) system.mass.diagonal() *= 1.001;
        EXPECT_EQ(allocations_of([&] { tracker->update(system, *spectrum); }), 0)
            << one.name << ", n = " << n << ", step " << step;
      }
    }
  }
  const TrackerCounters& counters = tracker->counters();
  EXPECT_GT(counters.tracked, 100);
  EXPECT_GT(counters.reused, 50);
  EXPECT_GT(counters.direct, 100);
}

TEST(Allocation, DoesNotHappenWhereTheLoopHoldsADampingRatio) {
  if (!DASHPOT_COUNTS_ALLOCATIONS) GTEST_SKIP() << "the sanitizer owns malloc";
  Random random(604);
  for (int n = 1; n <= kMaxDof; ++n) {
    const TaskImpedance arm = testing::random_arm(random, n, 6);
    const Square<kMaxDof> M = arm.mass;
    const TaskJacobian<kMaxDof> J = *arm.jacobian, bad = J / 0.0;
    const TaskMatrix K_C = *arm.task_stiffness;
    RatioDamping damper;
    TaskMatrix C_C;
    Status status = Status::kNotFinite;
    EXPECT_EQ(allocations_of([&] {
                damper.set_stiffness(K_C);
                status = damper.update(M, J, C_C);
                damper.update(M, bad, C_C);
              }),
              0)
        << "n = " << n;
    EXPECT_EQ(status, Status::kOk);
  }
}

TEST(FixedCapacity, GivesTheModesOfTheDynamicSolver) {
  Random random(603);
  const auto solver = std::make_unique<SpectrumSolver<kMaxDof>>();
  const auto spectrum = std::make_unique<Spectrum<kMaxDof>>();
  SpectrumSolver<> dynamic_solver;
  Spectrum<> expected;
  for (int n = 1; n <= kMaxDof; ++n) {
    for (const Named& one : systems_of_every_kind(random, n)) {
      SCOPED_TRACE(one.name + ", n = " + std::to_string(n));
      const Status status = dynamic_solver.solve(one.system, expected);
      EXPECT_EQ(solver->solve(fixed(one.system), *spectrum), status);
      ASSERT_EQ(spectrum->modes.size(), expected.modes.size());
      for (int i = 0; i < expected.modes.size(); ++i) {
        const auto& a = spectrum->modes[i];
        const auto& b = expected.modes[i];
        const double size = std::abs(b.eigenvalues[0]) + std::abs(b.eigenvalues[1]);
        // Defective eigenvalues are worth no more than their bounds.
        const double tolerance = 1e-12 * size + (b.kind == ModeKind::kCritical ? b.error_bound : 0);
        EXPECT_LE(std::abs(a.eigenvalues[0] - b.eigenvalues[0]), tolerance) << "mode " << i + 1;
        EXPECT_LE(std::abs(a.eigenvalues[1] - b.eigenvalues[1]), tolerance) << "mode " << i + 1;
        EXPECT_EQ(a.kind, b.kind) << "mode " << i + 1;
        if (std::isnan(b.natural_frequency)) continue;
        EXPECT_NEAR(a.natural_frequency, b.natural_frequency, 1e-12 * size);
        EXPECT_NEAR(a.damping_ratio, b.damping_ratio, 1e-12 * std::max(1.0, b.damping_ratio));
      }
    }
  }
}

}  // namespace
}  // namespace dashpot::analysis
