// The input as LCM messages: each type's decoder, and the judge of commands.
#include <dashpot/lcmtypes/command_filter.hpp>
#include <dashpot/lcmtypes/message_check.hpp>
#include <dashpot/lcmtypes/publish/encode.hpp>
#include <dashpot/tests/fuzz/fuzz_input.hpp>

#include <vector>

namespace {

using namespace dashpot::lcmtypes;  // NOLINT(google-build-using-namespace)
using dashpot::command_t;
using dashpot::modes_t;
using dashpot::state_t;
using dashpot::fuzz::require;

/// A decoded message is encoded to the same bytes, but for booleans other than 0 and 1.
template <class Message>
void decode_as(const std::uint8_t* data, std::size_t size) {
  Message message;
  if (!decode(data, size, message)) return;
  std::vector<std::uint8_t> bytes;
  encode(message, bytes);
  require(bytes.size() == size, "a message is as long as its bytes");
  Message again;
  require(decode(bytes.data(), bytes.size(), again), "what was encoded can be decoded");
}

CommandLimits limits() {
  CommandLimits limits;
  limits.position_lower.setConstant(7, -3);
  limits.position_upper.setConstant(7, 3);
  return limits;
}

void judge(const std::uint8_t* data, std::size_t size) {
  constexpr std::int64_t kNow = 1'700'000'000'000'000;
  CommandFilter filter(limits());
  std::int64_t accepted = 0;
  for (const std::int64_t later : {0, 1'000'000, -1'000'000}) {
    if (filter.judge(data, size, kNow + later, later) == CommandVerdict::kAccepted) ++accepted;
  }
  const Command& command = filter.command();
  require(command.accepted == accepted, "what is accepted is counted");
  auto setpoint = dashpot::controller::Setpoint();
  apply(command, setpoint);
  if ((command.parts & command_t::JOINT_POSITION) != 0) {
    require((setpoint.joint_position.array().abs() <= 3).all(), "positions are within limits");
  }
  if ((command.parts & command_t::JOINT_GAINS) != 0) {
    require(setpoint.gains.joint_stiffness.allFinite(), "gains are finite");
  }
}

}  // namespace

int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  decode_as<state_t>(data, size);
  decode_as<modes_t>(data, size);
  decode_as<command_t>(data, size);
  judge(data, size);
  return 0;
}
