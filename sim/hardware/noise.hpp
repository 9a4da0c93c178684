#pragma once
#include <cmath>
#include <cstdint>
#include <numbers>

namespace dashpot::sim {

/// Normally distributed numbers from a seed. The same seed gives the same bits on every machine
/// with the same mathematical library; standard distributions differ between standard libraries.
class Noise {
 public:
  explicit Noise(std::uint64_t seed) noexcept : state_(seed) {}

  /// Mean 0, standard deviation 1 (G. Box, M. Muller, 1958).
  double normal() noexcept {
    if (has_spare_) {
      has_spare_ = false;
      return spare_;
    }
    const double radius = std::sqrt(-2 * std::log(uniform()));
    const double angle = 2 * std::numbers::pi * uniform();
    spare_ = radius * std::sin(angle);
    has_spare_ = true;
    return radius * std::cos(angle);
  }

 private:
  /// In (0, 1], from the upper 53 bits of splitmix64 (G. Steele, D. Lea, C. Flood, 2014).
  double uniform() noexcept {
    std::uint64_t z = state_ += 0x9e3779b97f4a7c15U;
    z = (z ^ (z >> 30U)) * 0xbf58476d1ce4e5b9U;
    z = (z ^ (z >> 27U)) * 0x94d049bb133111ebU;
    z ^= z >> 31U;
    return static_cast<double>((z >> 11U) + 1) * 0x1p-53;
  }

  std::uint64_t state_;
  double spare_ = 0;
  bool has_spare_ = false;
};

}  // namespace dashpot::sim
