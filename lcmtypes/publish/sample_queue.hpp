#pragma once
#include <algorithm>
#include <atomic>
#include <cstddef>
#include <cstdint>
#include <vector>

namespace dashpot::lcmtypes {

/// A queue between one writing and one reading thread. Neither ever waits for the other: items that
/// find the queue full are dropped and counted. All memory is taken at set-up.
template <class T>
class SampleQueue {
 public:
  explicit SampleQueue(std::size_t capacity) : items_(std::max<std::size_t>(1, capacity)) {}

  /// Writer only. False if there was no room.
  bool push(const T& item) noexcept {
    const std::uint64_t written = written_.load(std::memory_order_relaxed);
    if (written - read_.load(std::memory_order_acquire) == items_.size()) {
      dropped_.store(dropped_.load(std::memory_order_relaxed) + 1, std::memory_order_relaxed);
      return false;
    }
    items_[written % items_.size()] = item;
    written_.store(written + 1, std::memory_order_release);
    return true;
  }

  /// Reader only. The oldest item, until `pop`; null if there is none.
  const T* front() const noexcept {
    const std::uint64_t read = read_.load(std::memory_order_relaxed);
    if (read == written_.load(std::memory_order_acquire)) return nullptr;
    return &items_[read % items_.size()];
  }
  void pop() noexcept {
    read_.store(read_.load(std::memory_order_relaxed) + 1, std::memory_order_release);
  }

  /// Any thread. How many items found no room.
  std::int64_t dropped() const noexcept { return dropped_.load(std::memory_order_relaxed); }

 private:
  std::vector<T> items_;
  // Each on a cache line of its own, because each is written by one thread only.
  alignas(64) std::atomic<std::uint64_t> written_{0};
  alignas(64) std::atomic<std::int64_t> dropped_{0};
  alignas(64) std::atomic<std::uint64_t> read_{0};
};

}  // namespace dashpot::lcmtypes
