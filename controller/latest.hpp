#pragma once
#include <array>
#include <atomic>
#include <cstdint>

namespace dashpot::controller {

/// Hands the latest value from one writing thread to one reading thread. Neither thread ever waits,
/// allocates or sees half a value. Values that the reader does not fetch in time are skipped.
///
/// There are three slots: one belongs to the writer, one to the reader, and the third is shared.
/// The writer exchanges its slot for the shared one after writing. The reader exchanges its slot
/// for the shared one before reading, if the shared one is fresh.
template <class Value>
class Latest {
 public:
  Latest() = default;
  Latest(const Latest&) = delete;
  Latest& operator=(const Latest&) = delete;

  /// Copies `value` and publishes it. For the writing thread.
  void write(const Value& value) noexcept {
    slot() = value;
    publish();
  }
  /// Returns the slot in which the next value is written in place, over an old one. For the writing
  /// thread.
  Value& slot() noexcept { return slots_[writer_]; }
  /// Hands over the value in slot(). For the writing thread.
  void publish() noexcept {
    writer_ =
        shared_.exchange(static_cast<std::uint8_t>(writer_ | kFresh), std::memory_order_acq_rel) &
        kIndex;
  }

  /// Fetches the latest value. Returns true if it was not fetched before. For the reading thread.
  bool fetch() noexcept {
    if ((shared_.load(std::memory_order_relaxed) & kFresh) == 0) return false;
    reader_ = shared_.exchange(reader_, std::memory_order_acq_rel) & kIndex;
    return true;
  }
  /// Returns the value fetched last; a default value before the first fetch. For the reading
  /// thread.
  const Value& value() const noexcept { return slots_[reader_]; }

 private:
  static constexpr std::uint8_t kIndex = 3;
  static constexpr std::uint8_t kFresh = 4;
  static_assert(std::atomic<std::uint8_t>::is_always_lock_free);

  std::array<Value, 3> slots_{};
  alignas(64) std::atomic<std::uint8_t> shared_{1};
  alignas(64) std::uint8_t writer_ = 0;
  alignas(64) std::uint8_t reader_ = 2;
};

}  // namespace dashpot::controller
