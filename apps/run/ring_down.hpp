#pragma once
#include <dashpot/apps/loop/loop_controller.hpp>
#include <dashpot/apps/scene/scene.hpp>

#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <vector>

namespace dashpot::apps {

/// A mode as the analysis predicts it and as the simulated motion shows it.
struct RingDownMode {
  int label = 0;                   ///< as published
  double predicted_frequency = 0;  ///< natural, rad/s, published at the start
  double predicted_ratio = 0;
  double sampled_frequency = 0;  ///< rad/s: the same with the torque held over a period, delayed
                                 ///< and filtered as in the scene
  double sampled_ratio = 0;
  double measured_frequency = 0;  ///< rad/s, of the motion
  double measured_ratio = 0;
};

/// How the loop of a scene rings down after small releases at its start.
struct RingDown {
  std::vector<RingDownMode> modes;  ///< by falling predicted frequency
  int releases = 0;
  double residual = 0;     ///< of the fit, relative to the motion
  double growth = 0;       ///< of the fastest growing motion of the sampled loop, 1/s
  double gain_margin = 0;  ///< factor by which all gains may grow before the sampled loop becomes
                           ///< unstable
  std::vector<std::string> assumes;     ///< assumptions of that loop
  std::vector<double> integral_decays;  ///< of the slow modes that the integral causes, 1/s, the
                                        ///< slowest first; negative: growing
};

using ControllerFactory = std::function<std::unique_ptr<LoopController>()>;

/// Releases the robot near its start, once for each joint, records how it rings down, and
/// identifies the modes of the motion (identification/identification.hpp). Nothing if `stopped`
/// returns true before all have rung down. Throws InputError, and std::runtime_error if the
/// simulation fails.
std::optional<RingDown> measure_ring_down(const Scene& scene,
                                          const ControllerFactory& make_controller,
                                          const std::function<bool()>& stopped);

}  // namespace dashpot::apps
