#pragma once
// Numbers of double arithmetic that bounds and tolerances are made of, and an index.

#include <cstddef>
#include <limits>
#include <numbers>

namespace dashpot::analysis {

/// Distance from 1 to the next double, 2^-52.
inline constexpr double kEps = std::numeric_limits<double>::epsilon();
/// Unit roundoff: one operation errs by at most this part of its result.
inline constexpr double kUnit = kEps / 2;
/// For the rounding errors of the bounds themselves.
inline constexpr double kSlack = 1 + 1e-10;
inline constexpr double kPi = std::numbers::pi;
inline constexpr double kInfinity = std::numeric_limits<double>::infinity();

/// The index of an array, of one that counts matrices.
constexpr std::size_t at(int i) noexcept {
  return static_cast<std::size_t>(i);
}

}  // namespace dashpot::analysis
