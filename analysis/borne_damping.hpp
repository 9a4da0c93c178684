#pragma once
#include <array>

namespace dashpot::analysis {

struct SampledLoop;

/// The part of the wanted damping that a sampled loop tolerates.
struct DampingLevel {
  double level = 1;  ///< smallest share that a mode keeps, above 0 and at most 1
  bool kept = true;  ///< every mode keeps the gain margin

  void include(const DampingLevel& other) noexcept {
    if (other.level < level) level = other.level;
    kept = kept && other.kept;
  }
};

/// The damping that one mode tolerates in a sampled loop, computed in constant time.
///
/// The mode is y'' + d y' + omega^2 y = 0. Its spring and damper act through a computer as in
/// sample_loop, without friction, gravity and memory. It is at the boundary of stability where
///     1 + k P(z) + c V(z) = 0,    k = (omega T)^2,  c = d T,  z = e^(i theta),
///     P = z^-delay a / (1 - (1 - a) / z) (z + 1) / (2 (z - 1)^2),    a = 1 - exp(-2 pi f_c T),
///     V = 2 (z - 1) / (z + 1) P, or (1 - 1 / z) P if the velocity is differenced.
/// The real and imaginary part give k and c for each theta. From k = c = 0 the boundary follows the
/// least damping that a stiffness needs, up to the largest stiffness that is stable with any
/// damping. It returns to k = 0 along the most damping that a stiffness tolerates. The loop is
/// stable between the two branches. The mode has a gain margin of m if (m k, m c) is between them.
///
/// With proportional damping the loop has no other modes than these, one for each undamped mode.
class BorneDamping {
 public:
  /// Tolerates any damping.
  BorneDamping() = default;
  /// For modes that are to keep a gain margin, above 1. Throws std::invalid_argument for a loop
  /// that sample_loop refuses, and for another margin.
  BorneDamping(const SampledLoop& loop, double gain_margin);

  /// Returns the share, above 0 and at most 1, of the damping `wanted` (1/s) with which a mode of
  /// frequency `omega` (rad/s) keeps the margin. If no share keeps it, because the spring alone is
  /// too stiff for the loop or `wanted` is too small for the spring, returns the share with the
  /// largest margin. `worst` records this, and the smallest share so far.
  ///
  /// `in_force`, above 0 and at most 1, is the share of this mode while springs replace each other
  /// gradually. omega^2 and `wanted` then count as this share of a whole mode, so that all the
  /// springs together tolerate no more than one mode does.
  ///
  /// Shares are up to a few percent less than the largest that keeps the margin, because the
  /// boundary is interpolated between kCells + 1 points, inside of it.
  double share(double omega, double wanted, double in_force, DampingLevel& worst) const noexcept {
    const double k = square_ * omega * omega / in_force, c = period_ * wanted / in_force;
    double most = steepest_ * k;
    const double at = k * cells_per_k_;
    bool kept = false;
    if (at < kCells) {
      const auto i = static_cast<std::size_t>(at);
      const double s = at - static_cast<double>(i);
      most = most_[i] + s * (most_[i + 1] - most_[i]);
      kept = c >= least_[i] + s * (least_[i + 1] - least_[i]);
    }
    const double result = c > most ? most / c : 1;
    worst.include({result, kept});
    return result;
  }

  static constexpr int kCells = 64;

 private:
  using Table = std::array<double, kCells + 1>;  // over k from 0 to the largest stable one

  double period_ = 0, square_ = 0;  // T and its square; 0: any damping is allowed
  double cells_per_k_ = 0;
  double steepest_ = 0;     // c / k of the largest margin beyond the table
  Table most_{}, least_{};  // c
};

}  // namespace dashpot::analysis
