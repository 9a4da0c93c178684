#pragma once
#include <dashpot/controller/base/impedance.hpp>

#include <algorithm>

namespace dashpot::controller {

/// Linear blend from one value to another in a given time:  now = (1 - s) from + s to, where s
/// grows evenly from 0 to 1. Every value is a weighted mean of the two, so that matrices stay
/// positive semidefinite, and a torque linear in them changes at a bounded rate.
///
/// A new target starts a blend from the present value that takes the full time again. Targets that
/// come every tick are so followed with a lag of about this time. The blend does not start slowly,
/// because with such targets it would never leave its start.
template <class Value>
class Ramp {
 public:
  /// `ticks` is the number of steps that a change takes, at least 1.
  Ramp(int ticks, const Value& start) noexcept
      : step_(1.0 / std::max(1, ticks)), now_(start), from_(start), to_(start) {}

  /// Sets the value and the target to `value`.
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

  /// Returns how many steps are left, 0 where the target is reached.
  double steps_left() const noexcept { return (1 - s_) / step_; }

  bool still() const noexcept { return s_ == 1; }
  const Value& now() const noexcept { return now_; }
  const Value& target() const noexcept { return to_; }
  /// Returns how often the value has changed so far.
  std::uint64_t changes() const noexcept { return changes_; }

 private:
  double step_;
  double s_ = 1;
  std::uint64_t changes_ = 0;
  Value now_;
  Value from_;
  Value to_;
};

using GainBlend = Ramp<Impedance>;

}  // namespace dashpot::controller
