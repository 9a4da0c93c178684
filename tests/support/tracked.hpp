#pragma once
// A tracker along a path, and whether what it publishes is true.

#include <dashpot/tests/support/enclosure.hpp>
#include <dashpot/tests/support/tracker_paths.hpp>

#include <gtest/gtest.h>

#include <algorithm>
#include <memory>

namespace dashpot::testing {

/// A tracker and what it found last.
struct Tracked {
  explicit Tracked(const analysis::TrackerOptions& options = {})
      : tracker(std::make_unique<analysis::ModeTracker>(options)),
        spectrum(std::make_unique<analysis::TrackedSpectrum>()) {}

  analysis::Status update(const analysis::System<analysis::kMaxDof>& system) {
    return tracker->update(system, *spectrum);
  }
  const analysis::ModeNumbers& mode(int i) const {
    return spectrum->modes[static_cast<std::size_t>(i)];
  }
  const analysis::TrackerCounters& counters() const { return tracker->counters(); }

  std::unique_ptr<analysis::ModeTracker> tracker;
  std::unique_ptr<analysis::TrackedSpectrum> spectrum;
};

/// Expects each eigenvalue within its bound of a true one, one to one; and frequency and damping
/// ratio within theirs, where the two true eigenvalues of the mode are clear.
inline Verdict expect_enclosed(const analysis::System<analysis::kMaxDof>& system,
                               const analysis::TrackedSpectrum& spectrum) {
  const Verdict verdict = judge(system, spectrum, 1e-17);
  EXPECT_TRUE(verdict.enclosed) << verdict.what << ", error / bound " << verdict.tightest;
  return verdict;
}

/// |Q(lambda) u| / ((|lambda|^2 |M| + |lambda| |C| + |K|) |u|)
inline double backward_error(const analysis::System<analysis::kMaxDof>& system,
                             const analysis::Complex& value,
                             const analysis::ComplexVector<analysis::kMaxDof>& u) {
  const analysis::ComplexVector<analysis::kMaxDof> residual =
      value * value * (system.mass * u) + value * (system.damping * u) + system.stiffness * u;
  const double size = std::norm(value) * system.mass.norm() +
                      std::abs(value) * system.damping.norm() + system.stiffness.norm();
  return residual.norm() / (size * u.norm());
}

/// Follows paths, and expects bounds that hold at every `apart`-th step.
struct Follower : Tracked {
  using Tracked::Tracked;
  virtual ~Follower() = default;

  /// In `steps` steps over [0, length].
  void follow(const SystemPath& path, int steps, double length = 1, int apart = 1) {
    for (int step = 0; step < steps && !::testing::Test::HasFatalFailure(); ++step) {
      SCOPED_TRACE("step " + std::to_string(step));
      const TrackedSystem system = path(length * step / std::max(1, steps - 1));
      ASSERT_EQ(update(system), analysis::Status::kOk);
      std::vector<double> now;
      for (int i = 0; i < spectrum->mode_count; ++i) {
        now.push_back(mode(i).natural_frequency);
        if (now.size() > last.size()) continue;
        largest_jump = std::max(largest_jump, std::abs(now.back() - last[now.size() - 1]));
      }
      last = now;
      look(system);
      if (step % apart != 0 && step + 1 < steps) continue;
      const Verdict verdict = judge(system);
      ASSERT_TRUE(verdict.enclosed) << verdict.what << ", error / bound " << verdict.tightest;
      tightest = std::max(tightest, verdict.tightest);
      widest = std::max(widest, verdict.widest);
    }
  }
  virtual Verdict judge(const TrackedSystem& system) const {
    return testing::judge(system, *spectrum, 1e-17);
  }
  /// At what else there is, at every step.
  virtual void look(const TrackedSystem& /*system*/) {}
  /// The only call of the direct solver was the first, and no place changed.
  void expect_followed() const {
    EXPECT_EQ(counters().direct, 1);
    EXPECT_EQ(counters().failed, 0);
    EXPECT_EQ(counters().tracked + counters().reused, counters().updates() - 1);
    EXPECT_EQ(spectrum->epoch, 1U);
  }

  std::vector<double> last;
  double largest_jump = 0;          ///< of a natural frequency between two steps, rad/s
  double tightest = 0, widest = 0;  ///< as in Verdict
};

}  // namespace dashpot::testing
