#include <dashpot/lcmtypes/command.hpp>
#include <dashpot/lcmtypes/command_t.hpp>

#include <bit>

namespace dashpot::lcmtypes {
namespace {

/// With a ratio the dampers of a command act only beside springs; without any, those before stay.
template <class Matrix>
void take_dampers(double ratio, const Matrix& from, Matrix& to) noexcept {
  if (ratio == 0 || (from.array() != 0).any()) to = from;
}

}  // namespace

bool has_set(const Command& command, std::int32_t part, std::int64_t after) noexcept {
  const auto bit = static_cast<std::size_t>(std::countr_zero(static_cast<std::uint32_t>(part)));
  return (command.parts & part) != 0 && command.set_by[bit] > after;
}

void apply(const Command& command, controller::Setpoint& setpoint, std::int64_t after) noexcept {
  const controller::Setpoint& from = command.setpoint;
  const auto has = [&](std::int32_t part) { return has_set(command, part, after); };
  if (has(command_t::MODE)) setpoint.mode = from.mode;
  if (has(command_t::JOINT_POSITION)) setpoint.joint_position = from.joint_position;
  if (has(command_t::TIP_POSE)) setpoint.tip_pose = from.tip_pose;
  if (has(command_t::WRENCH)) setpoint.wrench = from.wrench;
  if (has(command_t::JOINT_GAINS)) {
    setpoint.gains.joint_stiffness = from.gains.joint_stiffness;
    take_dampers(from.gains.joint_damping_ratio, from.gains.joint_damping,
                 setpoint.gains.joint_damping);
  }
  if (has(command_t::JOINT_GAINS) || has(command_t::JOINT_RATIO)) {
    setpoint.gains.joint_damping_ratio = from.gains.joint_damping_ratio;
  }
  if (has(command_t::TASK_GAINS)) {
    setpoint.gains.frame = from.gains.frame;
    setpoint.gains.directions = from.gains.directions;
    setpoint.gains.task_stiffness = from.gains.task_stiffness;
    take_dampers(from.gains.task_damping_ratio, from.gains.task_damping,
                 setpoint.gains.task_damping);
  }
  if (has(command_t::TASK_GAINS) || has(command_t::TASK_RATIO)) {
    setpoint.gains.task_damping_ratio = from.gains.task_damping_ratio;
  }
  if (has(command_t::NULL_GAINS)) {
    setpoint.gains.null_stiffness = from.gains.null_stiffness;
    setpoint.gains.null_damping = from.gains.null_damping;
    setpoint.gains.null_damping_ratio = from.gains.null_damping_ratio;
  }
}

}  // namespace dashpot::lcmtypes
