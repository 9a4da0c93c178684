#pragma once
#include <dashpot/analysis/response.hpp>
#include <dashpot/analysis/spectrum.hpp>
#include <dashpot/apps/scene/scene.hpp>

#include <optional>

namespace dashpot::apps {

/// The shares of the modes in the motion with which a scene begins.
struct PredictedRelease {
  analysis::Spectrum<> spectrum;
  analysis::ModeShares shares;
};

/// Returns the shares for a scene whose robot is released away from its rest, linear about the
/// rest. Amplitudes belong to the tip's x, y and z, m. Nothing if the robot starts at rest, has
/// elastic gears, or has no modes.
std::optional<PredictedRelease> predict_release(const Scene& scene);

}  // namespace dashpot::apps
