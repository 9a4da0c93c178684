#pragma once
#include <dashpot/controller/base/impedance.hpp>

#include <algorithm>

namespace dashpot::controller {

/// Straight way from one value to another in a given time:  now = (1 - s) from + s to, s growing
/// evenly from 0 to 1. Every value on it is a weighted mean of the two, so matrices stay positive
/// semidefinite, and a torque linear in them changes at a bounded rate.
///
/// A new target sets out from the value of the moment and takes the full time again. Targets that
/// come every tick are so followed with a lag of about that time; a way that starts gently would
/// never get going then.
template <class Value>
class Ramp {
 public:
  /// `ticks`: how many steps a change takes, at least 1.
  explicit Ramp(int ticks) noexcept : step_(1.0 / std::max(1, ticks)) {}

  /// At rest at `value`.
  void start(const Value& value) noexcept {
    from_ = to_ = now_ = value;
    s_ = 1;
    ++changes_;
  }
  void set_target(const Value& to) noexcept {
    from_ = now_;
    to_ = to;
    s_ = 0;
  }
  void step() noexcept {
    if (s_ == 1) return;
    ++changes_;
    s_ = s_ > 1 - 1.5 * step_ ? 1 : s_ + step_;
    now_ = s_ == 1 ? to_ : blend(from_, to_, s_);
  }

  const Value& now() const noexcept { return now_; }
  const Value& target() const noexcept { return to_; }
  /// How often the value changed so far.
  std::uint64_t changes() const noexcept { return changes_; }

 private:
  double step_;
  double s_ = 1;
  std::uint64_t changes_ = 0;
  Value from_{};
  Value to_{};
  Value now_{};
};

template <int N>
using GainBlend = Ramp<Impedance<N>>;

}  // namespace dashpot::controller
