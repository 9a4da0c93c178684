#include <dashpot/controller/robot_types.hpp>
#include <dashpot/lcmtypes/message_check.hpp>

#include <array>
#include <cstdint>

namespace dashpot::lcmtypes {
namespace {

constexpr std::size_t kFingerprintSize = 8;

/// Requires the fingerprint of Message, and reads `sizes` from the fields that follow it.
template <class Message, std::size_t Count>
bool read_sizes(const void* data, std::size_t size, std::array<std::int32_t, Count>& sizes) {
  if (data == nullptr || size > kMaxMessageSize) return false;
  if (size < kFingerprintSize + sizeof(sizes)) return false;
  const auto* bytes = static_cast<const unsigned char*>(data);
  if (read_big_endian(bytes, kFingerprintSize) != static_cast<std::uint64_t>(Message::getHash())) {
    return false;
  }
  for (std::size_t i = 0; i < Count; ++i) {
    sizes[i] = static_cast<std::int32_t>(read_big_endian(bytes + kFingerprintSize + 4 * i, 4));
  }
  return true;
}

bool within(std::int32_t value, std::int32_t least, std::int32_t most) {
  return least <= value && value <= most;
}

template <class Message>
bool decode_exactly(const void* data, std::size_t size, Message& message) noexcept {
  try {
    message = Message();  // the decoders leave arrays of length zero as they are
    const int length = static_cast<int>(size);
    return message.decode(data, 0, length) == length;
  } catch (...) {  // out of memory
    return false;
  }
}

template <class Message>
bool decode_with_joints(const void* data, std::size_t size, Message& message) noexcept {
  std::array<std::int32_t, 1> sizes{};
  return read_sizes<Message>(data, size, sizes) && within(sizes[0], 1, controller::kMaxJoints) &&
         decode_exactly(data, size, message);
}

template <class Message>
bool decode_with_modes(const void* data, std::size_t size, Message& message) noexcept {
  std::array<std::int32_t, 2> sizes{};  // n, num_modes
  return read_sizes<Message>(data, size, sizes) && within(sizes[0], 1, controller::kMaxJoints) &&
         within(sizes[1], 0, most_modes(sizes[0])) && decode_exactly(data, size, message);
}

}  // namespace

bool decode(const void* data, std::size_t size, state_t& message) noexcept {
  return decode_with_joints(data, size, message);
}

bool decode(const void* data, std::size_t size, modes_t& message) noexcept {
  return decode_with_modes(data, size, message);
}

bool decode(const void* data, std::size_t size, sampled_modes_t& message) noexcept {
  return decode_with_modes(data, size, message);
}

bool decode(const void* data, std::size_t size, contact_t& message) noexcept {
  std::array<std::int32_t, 1> first{};  // no size: the message has one length
  return read_sizes<contact_t>(data, size, first) && decode_exactly(data, size, message);
}

bool decode(const void* data, std::size_t size, command_t& message) noexcept {
  return decode_with_joints(data, size, message);
}

bool read_sender(const void* data, std::size_t size, std::int64_t& sender) noexcept {
  constexpr std::size_t kPlace = kFingerprintSize + sizeof(command_t::n);
  std::array<std::int32_t, 1> sizes{};
  if (!read_sizes<command_t>(data, size, sizes) || size < kPlace + sizeof(sender)) return false;
  const auto* bytes = static_cast<const unsigned char*>(data);
  sender = static_cast<std::int64_t>(read_big_endian(bytes + kPlace, sizeof(sender)));
  return true;
}

}  // namespace dashpot::lcmtypes
