#pragma once
#include <dashpot/analysis/sampled_loop.hpp>
#include <dashpot/apps/scene/scene.hpp>

namespace dashpot::apps {

/// The modes of a scene at its rest with the torque held over a period, delayed and filtered as its
/// drives do it, beside those of the continuous loop that they come from.
struct SampledModes {
  analysis::Spectrum<> continuous;
  analysis::SampledSpectrum sampled;
  double gain_margin = 0;  ///< of all gains together, see analysis::gain_margin
};

/// Finds the modes of a scene with an arm; friction and gravity are those that the controller
/// believes in.
SampledModes sampled_modes(const Scene& scene);

}  // namespace dashpot::apps
