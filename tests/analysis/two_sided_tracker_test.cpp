// Systems whose damping or stiffness is not symmetric, followed: bounds against 33 digits, labels,
// shapes, and what ends it.
#include <dashpot/analysis/spectrum/mode_numbers.hpp>
#include <dashpot/tests/support/panda_path.hpp>
#include <dashpot/tests/support/proved_eigenvalues.hpp>
#include <dashpot/tests/support/tracked.hpp>

#include <gtest/gtest.h>

#include <Eigen/Geometry>

namespace dashpot::analysis {
namespace {

using testing::backward_error;
using testing::Dice;
using testing::panda_impedance;
using testing::SystemPath;
using testing::Tracked;
/// Expects shapes as well, at every step.
struct TwoSidedFollower : testing::Follower {
  testing::Verdict judge(const System<kMaxDof>& system) const override {
    testing::Verdict verdict =
        testing::judge_against(testing::proved_eigenvalues(system), *spectrum, 1e-18);
    EXPECT_TRUE(verdict.proved);
    return verdict;
  }
  void look(const System<kMaxDof>& system) override {
    std::vector<ComplexVector<kMaxDof>> now;
    for (int i = 0; i < spectrum->mode_count; ++i) {
      const TrackedShapes& shapes = spectrum->shapes[static_cast<std::size_t>(i)];
      for (std::size_t k = 0; k < 2; ++k) {
        worst_shape =
            std::max(worst_shape, backward_error(system, mode(i).eigenvalues[k], shapes.u[k]));
        EXPECT_NEAR((shapes.u[k].adjoint() * system.mass * shapes.u[k]).value().real(), 1, 1e-11);
        if (!system.symmetric()) {
          EXPECT_EQ(shapes.slope[k], Complex());
        }
      }
      now.push_back(shapes.u[0]);
      if (now.size() > last_shapes.size()) continue;
      const ComplexVector<kMaxDof> Mu = system.mass * last_shapes[now.size() - 1];
      least_overlap = std::min(least_overlap, std::abs(now.back().dot(Mu)));
    }
    last_shapes = now;
  }
  std::vector<ComplexVector<kMaxDof>> last_shapes;
  double worst_shape = 0, least_overlap = 1;
};

/// J' f changes with the posture by K_G: column k is the derivative by q_k (paper, Eq. 13).
Eigen::MatrixXd geometric_stiffness(const Eigen::MatrixXd& J, const Eigen::Vector3d& force) {
  Eigen::MatrixXd K(7, 7);
  for (Eigen::Index k = 0; k < 7; ++k) {
    for (Eigen::Index j = 0; j < 7; ++j) {
      const Eigen::Index inner = std::min(j, k), outer = std::max(j, k);
      const Eigen::Vector3d axis = J.col(inner).tail<3>(), lever = J.col(outer).head<3>();
      K(j, k) = force.dot(axis.cross(lever));
      if (k > j) K(j, k) += 0.2 * force.norm() * J(3, k) * J(4, j);  // a moment, not symmetric
    }
  }
  return K;
}

TEST(TwoSidedTracker, FollowsALoadedArm) {
  DASHPOT_NEEDS_PROVED_EIGENVALUES();
  TwoSidedFollower follower;
  follower.follow(
      [](double t) {
        System<kMaxDof> system = panda_impedance(testing::swing(t), 0.1);
        system.stiffness += geometric_stiffness(testing::panda(testing::swing(t)).jacobian,
                                                Eigen::Vector3d(20, -30, 60));
        system.stiffness.diagonal().array() += 10;
        system.damping.diagonal().array() += 0.5;
        system.stiffness_factor.resize(0, 7);
        return system;
      },
      100, 0.1, 4);
  follower.expect_followed();
  EXPECT_EQ(follower.spectrum->mode_count, 7);
  EXPECT_LE(follower.counters().iterations, 250);
  EXPECT_LE(follower.widest, 1e-9);
  EXPECT_GE(follower.tightest, 1e-5) << "bounds without meaning";
  EXPECT_LE(follower.worst_shape, 1e-14);
  EXPECT_GE(follower.least_overlap, 0.98);
}

/// The term J' C_C dJ/dt leaves the springs' directions, and so a zero mode.
TEST(TwoSidedTracker, FollowsAZeroMode) {
  DASHPOT_NEEDS_PROVED_EIGENVALUES();
  Dice dice(523);
  const SystemPath path = testing::skewed_singular(dice);
  TwoSidedFollower follower;
  follower.follow(path, 40, 0.04, 4);
  follower.expect_followed();
  EXPECT_EQ(follower.spectrum->zero_mode_count, 1);
  EXPECT_EQ(follower.spectrum->mode_count, path(0).dof() - 1);
  EXPECT_LE(follower.widest, 1e-8);
  EXPECT_LE(follower.worst_shape, 1e-13);
}

struct Family {
  SystemPath (*make)(Dice&);
  int paths, steps;
  double length, tracked;  ///< least share of updates
};

TEST(TwoSidedTracker, EnclosesTheTruthOnHardPaths) {
  DASHPOT_NEEDS_PROVED_EIGENVALUES();
  const std::vector<Family> families = {{testing::skewed_critical, 4, 100, 1, 0.98},
                                        {testing::skewed_wandering, 6, 60, 0.4, 0.97},
                                        {testing::skewed_coinciding, 10, 60, 0.3, 0.95}};
  for (std::size_t f = 0; f < families.size(); ++f) {
    const Family& family = families[f];
    TrackerCounters sum;
    for (int k = 0; k < family.paths; ++k) {
      const auto seed = static_cast<std::uint64_t>(1000 * f) + static_cast<std::uint64_t>(k);
      SCOPED_TRACE("family " + std::to_string(f) + ", seed " + std::to_string(seed));
      Dice dice(seed);
      const SystemPath path = family.make(dice);
      if (path(0).stiffness_factor.rows() > 0) continue;  // K is not what is given, then
      TwoSidedFollower follower;
      follower.follow(path, family.steps, family.length, 4);
      if (path(0).dof() > 1) {
        EXPECT_GT(follower.tightest, 0);
      }
      sum.tracked += follower.counters().tracked;
      sum.direct += follower.counters().direct - 1;
    }
    EXPECT_GE(static_cast<double>(sum.tracked),
              family.tracked * static_cast<double>(sum.tracked + sum.direct))
        << f;
  }
}

/// Which way a system is followed changes with its symmetry; indices stay.
TEST(TwoSidedTracker, KeepsLabelsWhereSymmetryComesAndGoes) {
  Dice dice(77);
  const Eigen::MatrixXd T = dice.congruence(3, 3), skew = dice.matrix(3, 3);
  Tracked tracked;
  std::array<double, 3> last{};
  for (int step = 0; step < 90; ++step) {
    const double t = 0.001 * step;
    System<kMaxDof> system = testing::classical_system(T, Eigen::Vector3d(10, 10.4 - 8 * t, 25),
                                                       Eigen::Vector3d(0.1, 0.2, 0.3));
    if (step / 30 == 1) system.stiffness += 1e-3 * skew;
    ASSERT_EQ(tracked.update(system), Status::kOk);
    const bool turned = step % 30 == 0;
    EXPECT_EQ(tracked.spectrum->origin, turned ? SpectrumOrigin::kDirect : SpectrumOrigin::kTracked)
        << step;
    EXPECT_EQ(tracked.spectrum->epoch, 1);
    EXPECT_EQ(tracked.spectrum->shapes[0].slope[0] == Complex(), step / 30 == 1) << step;
    for (int i = 0; i < 3; ++i) {
      const double ratio = tracked.mode(i).damping_ratio;
      if (step > 0) {
        EXPECT_NEAR(ratio, last[static_cast<std::size_t>(i)], 0.01) << step;
      }
      last[static_cast<std::size_t>(i)] = ratio;
    }
  }
}

TEST(TwoSidedTracker, StopsWhereThereIsNothingToFollow) {
  System<kMaxDof> good(2);
  good.stiffness << 100, 3, -2, 400;
  good.damping << 0.2, 0.1, -0.1, 0.3;
  Tracked tracked;
  using Change = void (*)(System<kMaxDof>&);
  for (const auto& [change, status] : std::initializer_list<std::pair<Change, Status>>{
           {[](System<kMaxDof>& s) { s.stiffness(0, 1) = testing::kNan; }, Status::kNotFinite},
           {[](System<kMaxDof>& s) { s.damping(1, 0) = testing::kInfinity; }, Status::kNotFinite},
           {[](System<kMaxDof>& s) { s.mass(0, 0) = -1e-3; }, Status::kMassNotPositiveDefinite},
           {[](System<kMaxDof>& s) { s.mass(0, 1) = 1e-9; }, Status::kNotSymmetric}}) {
    EXPECT_EQ(tracked.update(good), Status::kOk);
    System<kMaxDof> bad = good;
    change(bad);
    EXPECT_EQ(tracked.update(bad), status);
    EXPECT_EQ(tracked.spectrum->mode_count, 0);
  }
  // The mode of 20 rad/s loses its spring: one mode less.
  EXPECT_EQ(tracked.update(good), Status::kOk);
  good.stiffness.col(0).setZero();
  EXPECT_EQ(tracked.update(good), Status::kOk);
  EXPECT_EQ(tracked.spectrum->mode_count, 1);
  EXPECT_EQ(tracked.spectrum->zero_mode_count, 1);
}

/// Rounding errors of K leave little of a mode that is far slower than others: the direct solver
/// has residuals in twice the precision.
TEST(TwoSidedTracker, LeavesModesThatAreFarApartToTheDirectSolver) {
  for (const double slow : {1e-2, 1e-5, 1e-7}) {
    SCOPED_TRACE(slow);
    Tracked tracked;
    for (int step = 0; step < 5; ++step) {
      const double t = 1 + 1e-4 * step;
      Eigen::MatrixXd V(3, 3);
      V << 1, 0.3, 0.2, 0.1 * t, 1, 0.4, 0.3, 0.2, 1;
      const Eigen::VectorXd w = Eigen::Vector3d(100 * t, 10, 100 * slow * t);
      const System<kMaxDof> system =
          testing::turned_system(Eigen::Vector3d(2, 1, 3).asDiagonal(), V,
                                 0.1 * Eigen::MatrixXd(w.asDiagonal()), w.cwiseAbs2().asDiagonal());
      ASSERT_EQ(tracked.update(system), Status::kOk);
      const bool near = slow == 1e-2;
      EXPECT_EQ(tracked.spectrum->origin,
                near && step > 0 ? SpectrumOrigin::kTracked : SpectrumOrigin::kDirect);
      for (int i = 0; i < 3; ++i) EXPECT_LE(relative_bound(tracked.mode(i)), 1e-6);
    }
  }
}

TEST(TwoSidedTracker, DoesNoMoreThanItIsGranted) {
  System<kMaxDof> system(3);
  system.stiffness << 100, 3, -2, 1, 400, 5, -7, 2, 900;
  Tracked tracked;
  ASSERT_EQ(tracked.update(system), Status::kOk);
  system.damping(0, 1) = 0.1;
  Work work;
  ASSERT_EQ(tracked.tracker->update(system, *tracked.spectrum, work), Status::kOk);
  ASSERT_EQ(tracked.spectrum->origin, SpectrumOrigin::kTracked);
  for (const std::int64_t granted : {std::int64_t{1000}, work.done()}) {
    system.damping(0, 1) *= 1 + 1e-6;
    Work some(granted);
    const Status status = tracked.tracker->update(system, *tracked.spectrum, some);
    EXPECT_EQ(status, granted == 1000 ? Status::kUnfinished : Status::kOk);
    EXPECT_LE(some.done(), granted);
  }
  EXPECT_EQ(tracked.spectrum->origin, SpectrumOrigin::kTracked);  // from the last one before
}

}  // namespace
}  // namespace dashpot::analysis
