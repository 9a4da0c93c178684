#pragma once
#include <dashpot/controller/robot_types.hpp>

#include <array>
#include <cstdint>

namespace dashpot::lcmtypes {

/// Everything that the accepted commands have set so far. It is accumulated, so that no part is
/// lost if two commands arrive within one tick.
struct Command {
  std::int64_t utime = 0;     ///< of the last accepted command, us since 1970-01-01 UTC
  std::int64_t sequence = 0;  ///< of the last accepted command
  std::int32_t parts = 0;     ///< sum of command_t::MODE, ... that were ever set
  std::int64_t accepted = 0;  ///< number of accepted commands so far
  /// For each bit of `parts`, the number of the accepted command that set it last, counted from 1.
  std::array<std::int64_t, 14> set_by{};
  std::int64_t fault_tick = 0;     ///< of part RELEASE: the fault to release, by its tick
  controller::Payload payload;     ///< of part PAYLOAD
  controller::Pose tool;           ///< of part TOOL_FRAME: T in the tip link
  controller::Pose pose_tool;      ///< T of the tip's pose in `setpoint`, as the CommandTaker says
  controller::TipSpeed tip_speed;  ///< of part TIP_SPEED
  controller::Setpoint setpoint;   ///< only the parts set so far mean anything; its time does not
};

/// Returns true if a command later than the `after`-th accepted one has set `part`
/// (command_t::MODE, ...).
bool has_set(const Command& command, std::int32_t part, std::int64_t after) noexcept;

/// Copies the parts that were set by commands later than the `after`-th accepted one into
/// `setpoint`, and does not change its other parts and its time. Dampers that are zero beside a
/// ratio are not copied: those before act where there is no spring.
void apply(const Command& command, controller::Setpoint& setpoint, std::int64_t after = 0) noexcept;

}  // namespace dashpot::lcmtypes
