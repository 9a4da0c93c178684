#pragma once
#include <dashpot/analysis/mode_tracker.hpp>

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

}  // namespace dashpot::testing
