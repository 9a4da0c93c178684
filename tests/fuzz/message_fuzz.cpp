// The input as LCM messages, behind the fingerprint of the type that its first byte chooses: the
// decoders, and the judge of commands.
#include <dashpot/lcmtypes/command_filter.hpp>
#include <dashpot/lcmtypes/message_check.hpp>
#include <dashpot/lcmtypes/publish/encode.hpp>
#include <dashpot/tests/fuzz/fuzz_input.hpp>

#include <vector>

namespace {

using namespace dashpot::lcmtypes;  // NOLINT(google-build-using-namespace)
using dashpot::command_t;
using dashpot::fuzz::require;
using Bytes = std::vector<std::uint8_t>;

/// The bytes behind the fingerprint of a message type, which libFuzzer would hardly guess.
template <class Message>
Bytes marked(const Bytes& bytes) {
  const auto fingerprint = static_cast<std::uint64_t>(Message::getHash());
  Bytes message;
  for (int shift = 56; shift >= 0; shift -= 8)
    message.push_back(static_cast<std::uint8_t>(fingerprint >> shift));
  message.insert(message.end(), bytes.begin(), bytes.end());
  return message;
}

/// A decoded message is encoded to the same bytes, but for booleans other than 0 and 1.
template <class Message>
void decode_as(const Bytes& unmarked) {
  const Bytes data = marked<Message>(unmarked);
  Message message;
  if (!decode(data.data(), data.size(), message)) return;
  Bytes bytes;
  encode(message, bytes);
  require(bytes.size() == data.size(), "a message is as long as its bytes");
  Message again;
  require(decode(bytes.data(), bytes.size(), again), "what was encoded can be decoded");
}

CommandLimits limits() {
  CommandLimits limits;
  limits.position_lower.setConstant(7, -3);
  limits.position_upper.setConstant(7, 3);
  return limits;
}

void judge(const Bytes& unmarked) {
  const Bytes data = marked<command_t>(unmarked);
  constexpr std::int64_t kNow = 1'700'000'000'000'000;
  CommandFilter filter(limits());
  std::int64_t accepted = 0;
  for (const std::int64_t later : {0, 1'000'000, -1'000'000}) {
    if (filter.judge(data.data(), data.size(), kNow + later, later) == CommandVerdict::kAccepted)
      ++accepted;
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
  if (size == 0) return 0;
  const Bytes bytes(data + 1, data + size);
  const int kind = *data % 4;
  if (kind == 0) decode_as<dashpot::state_t>(bytes);
  if (kind == 1) decode_as<dashpot::modes_t>(bytes);
  if (kind == 2) decode_as<command_t>(bytes);
  if (kind == 3) judge(bytes);
  return 0;
}
