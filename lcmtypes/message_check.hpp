#pragma once
#include <dashpot/controller/robot_types.hpp>
#include <dashpot/lcmtypes/command_t.hpp>
#include <dashpot/lcmtypes/contact_t.hpp>
#include <dashpot/lcmtypes/modes_t.hpp>
#include <dashpot/lcmtypes/sampled_modes_t.hpp>
#include <dashpot/lcmtypes/state_t.hpp>

#include <cstddef>
#include <cstdint>

namespace dashpot::lcmtypes {

/// Returns the integer of `count` bytes, the most significant first.
inline std::uint64_t read_big_endian(const std::uint8_t* bytes, std::size_t count) noexcept {
  std::uint64_t value = 0;
  for (std::size_t i = 0; i < count; ++i) value = value << 8 | bytes[i];
  return value;
}

/// Largest message that is looked at, bytes; any that obeys the limits of its definition is
/// smaller.
inline constexpr std::size_t kMaxMessageSize = 65536;

/// Returns the largest number of modes of n joints: 2 n where all of them are elastic, at most 16.
constexpr std::int32_t most_modes(std::int32_t n) {
  return n < controller::kMaxJoints / 2 ? 2 * n : controller::kMaxJoints;
}

/// Decodes bytes of unknown origin. The generated decoders allocate the length that an array's
/// length field states before they compare it with the number of bytes; so the fingerprint and
/// these fields are read first. Returns false, with `message` unspecified, unless
///   - the fingerprint belongs to the message type,
///   - the sizes are within 1 <= n <= 16, 0 <= num_modes <= most_modes(n),
///   - and the message fills `size` bytes exactly.
/// Allocates less than kMaxMessageSize. Values are not judged: they may be NaN or out of range.
bool decode(const void* data, std::size_t size, state_t& message) noexcept;
bool decode(const void* data, std::size_t size, modes_t& message) noexcept;
bool decode(const void* data, std::size_t size, sampled_modes_t& message) noexcept;
bool decode(const void* data, std::size_t size, contact_t& message) noexcept;
bool decode(const void* data, std::size_t size, command_t& message) noexcept;

/// Reads the sender of a command, and nothing else. Returns false if these are not the first bytes
/// of a command_t.
bool read_sender(const void* data, std::size_t size, std::int64_t& sender) noexcept;

}  // namespace dashpot::lcmtypes
