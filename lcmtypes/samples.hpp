#pragma once
// Data that the real-time thread hands over to be published: plain data without memory on the heap.

#include <dashpot/controller/snapshot.hpp>
#include <dashpot/lcmtypes/command_verdict.hpp>

#include <Eigen/Core>
#include <cstdint>
#include <optional>

namespace dashpot::lcmtypes {

/// Timing of the loop, and the verdicts of the commands that were sent to it.
struct LoopHealth {
  std::int32_t tick_time = 0;          ///< computing time of the previous tick, ns
  std::int32_t longest_tick_time = 0;  ///< since the start, ns
  std::int64_t overruns = 0;           ///< ticks that ended after their period
  std::int64_t fault_tick = 0;         ///< tick at which the snapshot's fault latched; 0: none
  CommandTally commands;
};

/// One tick.
struct StateSample {
  std::int64_t utime = 0;  ///< beginning of the tick, us since 1970-01-01 UTC
  controller::Snapshot snapshot;
  LoopHealth health;
  std::optional<Eigen::Vector3d> contact_force;  ///< on the tip, base axes, N; where it is known
};

/// The modes at one configuration.
struct ModesSample {
  std::int64_t utime = 0;  ///< beginning of the modes' tick, us since 1970-01-01 UTC
  controller::Vibration vibration;
};

/// The modes of the sampled loop.
struct SampledModesSample {
  std::int64_t utime = 0;  ///< as in ModesSample
  controller::SampledVibration vibration;
};

}  // namespace dashpot::lcmtypes
