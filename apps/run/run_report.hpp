#pragma once
#include <dashpot/analysis/response.hpp>
#include <dashpot/analysis/spectrum.hpp>
#include <dashpot/apps/identify/identify.hpp>
#include <dashpot/apps/loop/loop_controller.hpp>
#include <dashpot/apps/loop/loop_journal.hpp>
#include <dashpot/apps/loop/loop_thread.hpp>
#include <dashpot/apps/scene/scene.hpp>

#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <vector>

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

/// The summary of `dashpot run`.
struct RunReport {
  std::string scene;  ///< the file
  int joints = 0;
  std::string missing_rotors;       ///< of the controller's model, see missing_rotors_text
  std::string without_rotors;       ///< see arm_without_rotors
  std::string rotors_hint;          ///< where their inertia is found
  std::string friction_text;        ///< damping beside the gains; empty: none
  std::string drives, drives_text;  ///< published drives of the model; empty: none
  double period = 0;                ///< s
  double wall_time = 0;             ///< s
  Pace pace = Pace::kFast;
  bool interrupted = false;  ///< by the user
  Privileges privileges;
  LoopRecord loop;
  double simulated_time = 0;  ///< s
  sim::EnergyAudit energy;
  Extremes extremes;
  std::optional<Eigen::Vector3d> contact_force;  ///< of the wall at the end, N; none without one
  lcmtypes::PublisherCounters messages;
  std::optional<CommandReport> commands;     ///< if commands were enabled
  std::optional<IdentifyReport> identified;  ///< from the motion after an excitation
  std::optional<PredictedRelease> release;   ///< if the scene begins with one
  std::optional<RingDown> ring_down;
};

/// For people: tables, each line ended by a newline.
std::string to_table(const RunReport& report);
/// One JSON object. docs/command-line.md lists the keys.
std::string to_json(const RunReport& report);

}  // namespace dashpot::apps
