#pragma once
#include <cstdint>
#include <limits>

namespace dashpot::analysis {

/// Counts the work of an analysis and says when its share is used up. It counts units, not time, so
/// that one input ends at one point on every computer and in every run. A unit is about one
/// instruction of a build for any x86-64 processor (./run realtime compares them).
///
/// Work is taken before it is done, stage by stage, so that no more is done than was granted.
class Work {
 public:
  static constexpr std::int64_t kUnlimited = std::numeric_limits<std::int64_t>::max();

  explicit Work(std::int64_t limit = kUnlimited) noexcept : limit_(limit), left_(limit) {}

  /// True if `units` more may be done; they then count. Once the answer is false, it stays false.
  bool take(std::int64_t units) noexcept {
    over_ = over_ || units > left_;
    if (!over_) left_ -= units;
    return !over_;
  }
  /// True if some work was refused.
  bool over() const noexcept { return over_; }
  std::int64_t done() const noexcept { return limit_ - left_; }

 private:
  std::int64_t limit_, left_;
  bool over_ = false;
};

/// Returns `factor` times x cubed, or squared.
constexpr std::int64_t cubed(std::int64_t x, std::int64_t factor) noexcept {
  return factor * x * x * x;
}
constexpr std::int64_t squared(std::int64_t x, std::int64_t factor) noexcept {
  return factor * x * x;
}

}  // namespace dashpot::analysis
