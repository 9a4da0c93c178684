#pragma once
#include <array>
#include <atomic>
#include <cstdint>

namespace dashpot::controller {

/// Hands the latest value from one writing thread to one reading thread. Neither ever waits,
/// allocates or sees half a value; values that the reader does not fetch in time are skipped.
///
/// Of three slots one belongs to the writer, one to the reader, and the third changes hands: the
/// writer exchanges its own for it after writing, the reader before reading if it is fresh.
template <class Value>
class Latest {
 public:
  Latest() = default;
  Latest(const Latest&) = delete;
  Latest& operator=(const Latest&) = delete;

  /// Of the writing thread.
  void write(const Value& value) noexcept {
    slot() = value;
    publish();
  }
  /// Of the writing thread: where the next value is written in place, over an old one, ...
  Value& slot() noexcept { return slots_[writer_]; }
  /// ... and then handed over.
  void publish() noexcept {
    writer_ =
        shared_.exchange(static_cast<std::uint8_t>(writer_ | kFresh), std::memory_order_acq_rel) &
        kIndex;
  }

  /// Of the reading thread: fetches the latest value; whether it is one that was not seen before.
  bool fetch() noexcept {
    if ((shared_.load(std::memory_order_relaxed) & kFresh) == 0) return false;
    reader_ = shared_.exchange(reader_, std::memory_order_acq_rel) & kIndex;
    return true;
  }
  /// Of the reading thread: the value last fetched; a default one before the first.
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
