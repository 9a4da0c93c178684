#pragma once
// A histogram of durations, in memory of a fixed size.

#include <algorithm>
#include <array>
#include <bit>
#include <cmath>
#include <cstddef>
#include <cstdint>

namespace dashpot::stress {

/// Counts durations in bins that are 1/32 of their value wide, up to 18 minutes.
class LogHistogram {
 public:
  /// Counts a duration, ns; one below zero as zero.
  void add(std::int64_t duration) noexcept {
    const auto value = static_cast<std::uint64_t>(std::max<std::int64_t>(duration, 0));
    const unsigned shift = shift_of(value);
    const std::uint64_t bin = kBinsOfOctave * shift + (value >> shift);
    ++counts_[std::min<std::size_t>(bin, counts_.size() - 1)];
    ++count_;
    largest_ = std::max(largest_, static_cast<std::int64_t>(value));
  }

  std::int64_t count() const noexcept { return count_; }
  /// Returns the largest duration, ns.
  std::int64_t largest() const noexcept { return largest_; }
  /// Returns the end of the bin below whose end `share` of the durations are, ns, but not more than
  /// the largest.
  std::int64_t quantile(double share) const noexcept {
    const auto wanted = static_cast<std::int64_t>(std::ceil(share * static_cast<double>(count_)));
    std::int64_t seen = 0;
    for (std::size_t bin = 0; bin < counts_.size(); ++bin) {
      seen += counts_[bin];
      if (seen >= wanted) return std::min(end_of(bin), largest_);
    }
    return largest_;
  }

 private:
  static constexpr unsigned kBinsOfOctave = 32;
  static constexpr unsigned kBits = 40;  // of the longest duration with a bin of its own

  /// Bits that a bin of this value leaves out: all but six from the first.
  static unsigned shift_of(std::uint64_t value) noexcept {
    const auto bits = static_cast<unsigned>(std::bit_width(value));
    return bits > 6 ? bits - 6 : 0;
  }
  static std::int64_t end_of(std::size_t bin) noexcept {
    const std::size_t shift = bin < 2 * kBinsOfOctave ? 0 : bin / kBinsOfOctave - 1;
    return static_cast<std::int64_t>((bin - kBinsOfOctave * shift + 1) << shift) - 1;
  }

  std::array<std::int64_t, kBinsOfOctave*(kBits - 4)> counts_{};
  std::int64_t count_ = 0;
  std::int64_t largest_ = 0;
};

}  // namespace dashpot::stress
