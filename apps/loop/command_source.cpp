#include <dashpot/apps/loop/command_source.hpp>
#include <dashpot/controller/attachment.hpp>
#include <dashpot/controller/input_error.hpp>
#include <dashpot/lcmtypes/message_reader.hpp>

#include <chrono>
#include <utility>

namespace dashpot::apps {
namespace {

using lcmtypes::Command;

/// Carries out the receiver's part of a valid command; false if the controller refuses it.
bool carry_out(Command& command, LoopGoal& goal, std::string& reason) {
  const std::int64_t before = command.accepted - 1;
  const auto change = [&command, before](controller::Gains& gains) {
    controller::Setpoint changed;
    changed.gains = gains;
    lcmtypes::apply(command, changed, before);
    gains = changed.gains;
  };
  LoopGoal::Change wanted{change, {}, {}, {}};
  if (lcmtypes::has_set(command, command_t::PAYLOAD, before)) wanted.payload = command.payload;
  if (lcmtypes::has_set(command, command_t::TOOL_FRAME, before)) wanted.tool = command.tool;
  if (lcmtypes::has_set(command, command_t::TIP_SPEED, before)) {
    wanted.tip_speed = command.tip_speed;
  }
  if (goal.change(wanted, reason) != DASHPOT_OK) return false;
  if (lcmtypes::has_set(command, command_t::TIP_POSE, before)) {
    command.pose_tool = goal.latest_tool();
  }
  if (lcmtypes::has_set(command, command_t::RELEASE, before)) goal.release();
  return true;
}

}  // namespace

void refuse_second_loop(const std::shared_ptr<lcm::LCM>& bus) {
  constexpr std::chrono::milliseconds kListened{300};  // states come every period
  bool heard = false;
  lcmtypes::MessageHandlers handlers;
  handlers.on_state = [&heard](const state_t& /*message*/) { heard = true; };
  lcmtypes::BusReader reader(bus, handlers);
  const auto end = std::chrono::steady_clock::now() + kListened;
  while (!heard && std::chrono::steady_clock::now() < end) reader.wait(20);
  if (!heard) return;
  throw controller::InputError(
      "--commands",
      "another loop publishes states on this bus, and both would take each "
      "command: end it, or give this one a bus of its own (--lcm-url)");
}

CommandSource::CommandSource(std::shared_ptr<lcm::LCM> bus, const lcmtypes::CommandLimits& limits,
                             LoopGoal& goal)
    : goal_(goal),
      receiver_(std::move(bus), limits, [&goal](Command& command, std::string& reason) {
        return carry_out(command, goal, reason);
      }) {}

bool CommandSource::take() noexcept {
  constexpr std::int32_t kGoals = int{command_t::MODE} + int{command_t::JOINT_POSITION} +
                                  int{command_t::TIP_POSE} + int{command_t::WRENCH};
  taken_ = false;
  if (!receiver_.fetch()) return false;
  const Command& command = receiver_.command();
  // Only new parts: the scenario may have replaced older ones meanwhile.
  const std::int64_t before = std::exchange(commands_, command.accepted);
  for (std::int32_t part = 1; part <= kGoals; part *= 2) {
    taken_ = taken_ || ((kGoals & part) != 0 && lcmtypes::has_set(command, part, before));
  }
  if (taken_) {
    controller::Setpoint setpoint = goal_.setpoint();
    lcmtypes::apply(command, setpoint, before);
    if (lcmtypes::has_set(command, command_t::TIP_POSE, before)) {
      setpoint.tip_pose = controller::carried(setpoint.tip_pose, command.pose_tool, goal_.tool());
    }
    goal_.hold(setpoint);
  }
  return lcmtypes::has_set(command, command_t::RELEASE, before);
}

}  // namespace dashpot::apps
