// An analysis does no more work than it is granted, and what it finds does not depend on that.
#include <dashpot/analysis/mode_tracker.hpp>
#include <dashpot/analysis/spectrum/refinement.hpp>
#include <dashpot/analysis/tracker/tracked_start.hpp>
#include <dashpot/tests/support/random.hpp>

#include <gtest/gtest.h>

#include <memory>

namespace dashpot::analysis {
namespace {

using testing::Random;

/// All modes near critical damping at about one frequency: what takes the solver longest.
System<kMaxDof> near_critical_system(Random& random, Eigen::Index n, double coupling) {
  System<kMaxDof> system(n);
  system.mass = random.spd(n);
  system.stiffness = 9 * system.mass + coupling * random.spd(n);
  system.damping = 6 * system.mass + coupling * random.spd(n);
  return system;
}

System<kMaxDof> ordinary_system(Random& random, Eigen::Index n) {
  System<kMaxDof> system(n);
  system.mass = random.spd(n);
  system.stiffness = 100 * random.spd(n);
  system.damping = random.spd(n);
  return system;
}

void expect_same(const Spectrum<kMaxDof>& a, const Spectrum<kMaxDof>& b) {
  EXPECT_EQ(a.status, b.status);
  ASSERT_EQ(a.modes.size(), b.modes.size());
  for (int i = 0; i < a.modes.size(); ++i) {
    EXPECT_EQ(a.modes[i].eigenvalues, b.modes[i].eigenvalues);
    EXPECT_EQ(a.modes[i].error_bound, b.modes[i].error_bound);
    EXPECT_EQ(a.modes[i].shapes[0], b.modes[i].shapes[0]);
  }
}

TEST(Work, IsGrantedUntilTheFirstThatIsTooMuch) {
  Work work(10);
  EXPECT_TRUE(work.take(4));
  EXPECT_TRUE(work.take(6));
  EXPECT_FALSE(work.over());
  EXPECT_FALSE(work.take(1));
  EXPECT_TRUE(work.over());
  EXPECT_FALSE(work.take(0));
  EXPECT_EQ(work.done(), 10);
}

/// Just enough gives the same to the last bit; a unit less, or much less, gives nothing.
TEST(Work, OfTheSolverIsAllOrNothing) {
  Random random(811);
  auto all = std::make_unique<Spectrum<kMaxDof>>(), some = std::make_unique<Spectrum<kMaxDof>>();
  auto solver = std::make_unique<SpectrumSolver<kMaxDof>>();
  for (const Eigen::Index n : {1, 3, 7, 12, 16}) {
    for (const double coupling : {-1.0, 1e-9, 1e-5, 1e-2}) {
      SCOPED_TRACE(::testing::Message() << "n " << n << ", coupling " << coupling);
      const System<kMaxDof> system =
          coupling < 0 ? ordinary_system(random, n) : near_critical_system(random, n, coupling);
      Work unlimited;
      solver->solve(system, *all, unlimited);
      ASSERT_FALSE(all->modes.empty());
      ASSERT_GT(unlimited.done(), 0);
      Work enough(unlimited.done());
      solver->solve(system, *some, enough);
      ASSERT_NO_FATAL_FAILURE(expect_same(*some, *all));
      EXPECT_EQ(enough.done(), unlimited.done());
      for (const std::int64_t limit :
           {unlimited.done() - 1, unlimited.done() / 2, unlimited.done() / 20, std::int64_t{0}}) {
        Work less(limit);
        EXPECT_EQ(solver->solve(system, *some, less), Status::kUnfinished);
        EXPECT_EQ(some->modes.size(), 0);
        EXPECT_LE(less.done(), limit);
      }
    }
  }
}

/// In the solver's first blocks the work of a step is the sum over pairs of blocks, each once.
TEST(Work, OfASylvesterEquationIsCountedOnceForEachPair) {
  BlockList<kMaxDof> blocks;
  int first = 0;
  for (const int size : {2, 1, 2, 3}) {
    blocks.push_back({first, size});
    first += size;
  }
  const auto equation = [](std::int64_t unknowns, std::int64_t square, std::int64_t more) {
    return cubed(unknowns, 4) + squared(unknowns, square) + more;
  };
  EXPECT_EQ(sylvester_work<kMaxDof>(blocks),
            3 * 250 + equation(3, 40, 500) + 2 * equation(6, 60, 0));
}

/// The next update finds the modes that one update left undone, at their indices.
TEST(Work, OfTheTrackerIsAllOrNothing) {
  Random random(812);
  auto tracker = std::make_unique<ModeTracker>();
  auto spectrum = std::make_unique<TrackedSpectrum>(), before = std::make_unique<TrackedSpectrum>();
  System<kMaxDof> system = ordinary_system(random, 7);
  ASSERT_EQ(tracker->update(system, *before), Status::kOk);
  EXPECT_TRUE(tracker->follows());
  system.stiffness *= 4;  // a jump, to be solved directly: all is twice as fast
  system.damping *= 2;
  Work unfollowed(400'000);
  EXPECT_EQ(tracker->update(system, *spectrum, unfollowed), Status::kUnfinished);
  EXPECT_EQ(spectrum->mode_count, 0);
  EXPECT_LE(unfollowed.done(), 400'000);
  EXPECT_FALSE(tracker->follows());
  Work none(0);
  EXPECT_EQ(tracker->update(system, *spectrum, none), Status::kUnfinished);
  Work unlimited;
  ASSERT_EQ(tracker->update(system, *spectrum, unlimited), Status::kOk);
  EXPECT_GT(unlimited.done(), 400'000);
  EXPECT_TRUE(tracker->follows());
  EXPECT_EQ(spectrum->epoch, before->epoch);
  for (std::size_t i = 0; i < 7; ++i) {
    EXPECT_NEAR(spectrum->modes[i].natural_frequency, 2 * before->modes[i].natural_frequency,
                1e-9 * before->modes[i].natural_frequency);
  }
  const TrackerCounters& counters = tracker->counters();
  EXPECT_EQ(counters.unfinished, 2);
  EXPECT_EQ(counters.updates(), 4);
}

/// An update that ends before it has followed the modes loses nothing: neither what the next one
/// follows, nor a bound.
TEST(Work, LeavesWhatCanBeFollowedToALaterUpdate) {
  Random random(813);
  auto tracker = std::make_unique<ModeTracker>();
  auto spectrum = std::make_unique<TrackedSpectrum>();
  auto exact = std::make_unique<Spectrum<kMaxDof>>();
  System<kMaxDof> system = ordinary_system(random, 12);
  ASSERT_EQ(tracker->update(system, *spectrum), Status::kOk);
  const System<kMaxDof> change = ordinary_system(random, 12);
  for (int step = 0; step < 6; ++step) {
    const double way = step == 3 ? -1e-4 : 1e-4;  // once back to what was followed last
    system.stiffness += way * change.stiffness;
    for (const std::int64_t units : {0, 150'000, 300'000}) {
      Work little(units);
      ASSERT_EQ(tracker->update(system, *spectrum, little), Status::kUnfinished);
      EXPECT_TRUE(tracker->follows());
    }
    if (step == 2) continue;
    ASSERT_EQ(tracker->update(system, *spectrum), Status::kOk);
    EXPECT_EQ(spectrum->origin, SpectrumOrigin::kTracked);
    ASSERT_EQ(SpectrumSolver<kMaxDof>().solve(system, *exact), Status::kOk);
    for (int i = 0; i < 12; ++i) {
      const ModeNumbers& mode =
          spectrum->modes[static_cast<std::size_t>(spectrum->order[static_cast<std::size_t>(i)])];
      EXPECT_LE(std::abs(mode.eigenvalues[0] - exact->modes[i].eigenvalues[0]),
                mode.error_bound + exact->modes[i].error_bound);
    }
  }
  EXPECT_EQ(tracker->counters().direct, 1);
}

}  // namespace
}  // namespace dashpot::analysis
