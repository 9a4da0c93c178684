#pragma once
#include <dashpot/apps/identify/identify_writer.hpp>
#include <dashpot/apps/loop/command_report.hpp>
#include <dashpot/apps/loop/loop_thread.hpp>
#include <dashpot/apps/run/predicted_release.hpp>
#include <dashpot/apps/run/ring_down.hpp>

#include <optional>
#include <string>

namespace dashpot::apps {

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
