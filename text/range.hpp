#pragma once
#include <cmath>
#include <limits>
#include <sstream>
#include <string>

namespace dashpot::text {

/// Values that a number may have. Infinity never belongs to them.
struct Range {
  double least = -std::numeric_limits<double>::infinity();
  bool with_least = true;  ///< false: values have to exceed `least`
  double most = std::numeric_limits<double>::infinity();

  bool has(double value) const {
    return std::isfinite(value) && value <= most && (with_least ? value >= least : value > least);
  }
};

inline constexpr Range kAnyNumber{};
inline constexpr Range kPositive{0, false};
inline constexpr Range kNotNegative{0};

/// Returns "is -1 N m, not positive" and the like for a value that is not in the range.
inline std::string complaint(const Range& range, double value, const std::string& unit) {
  std::ostringstream text;
  text << "is " << value << (unit.empty() ? "" : " ") << unit << ", ";
  if (!std::isfinite(value)) {
    text << "not finite";
  } else if (value > range.most) {
    text << "must be at most " << range.most;
  } else if (range.least != 0) {
    text << "must be at least " << range.least;
  } else {
    text << (range.with_least ? "negative" : "not positive");
  }
  return text.str();
}

}  // namespace dashpot::text
