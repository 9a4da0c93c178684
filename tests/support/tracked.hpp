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

}  // namespace dashpot::testing
