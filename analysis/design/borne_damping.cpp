#include <dashpot/analysis/base/require.hpp>
#include <dashpot/analysis/borne_damping.hpp>
#include <dashpot/analysis/sampled_loop.hpp>

#include <cmath>
#include <complex>
#include <numbers>

namespace dashpot::analysis {
namespace {

class Boundary {
 public:
  struct Point {
    double k, c;
  };

  explicit Boundary(const SampledLoop& loop)
      : delay_(loop.delay), difference_(loop.difference_velocity) {
    if (loop.torque_cutoff > 0) {
      rest_ = std::exp(-2 * std::numbers::pi * loop.torque_cutoff * loop.period);
    }
    end_ = find_end();
    tip_ = find_tip();
  }

  /// -1 / P = k + c V / P; its real and imaginary part
  Point at(double theta) const {
    const double s = std::sin(theta / 2), co = std::cos(theta / 2);
    const std::complex<double> filter = (1.0 - std::polar(rest_, -theta)) / (1 - rest_);
    const std::complex<double> p =
        4 * s * s / co * std::polar(1.0, (delay_ + 0.5) * theta) * filter;
    if (!difference_) return {p.real(), p.imag() * co / (2 * s)};
    const double c = p.imag() / std::sin(theta);
    return {p.real() - 2 * s * s * c, c};
  }

  /// The point of the largest stiffness.
  Point tip() const { return at(tip_); }
  /// The least and the most damping for a stiffness. If k does not return to 0 before theta = pi,
  /// z = -1 limits the damping for every k.
  double least(double k) const { return at(where(k, 0, tip_)).c; }
  double most(double k) const { return at(tip_ < end_ ? where(k, end_, tip_) : end_).c; }

 private:
  /// The theta between where k is less, and where it is more.
  double where(double k, double less, double more) const {
    for (int i = 0; i < 45; ++i) {
      const double middle = 0.5 * (less + more);
      (at(middle).k < k ? less : more) = middle;
    }
    return 0.5 * (less + more);
  }

  /// The theta at which k is 0 again, or nearly pi if there is none.
  double find_end() const {
    constexpr double kStep = 1.01, kLast = std::numbers::pi - 1e-6;
    for (double theta = 1e-6; theta < kLast; theta *= kStep) {
      if (at(theta).k < 0) return where(0, theta, theta / kStep);
    }
    return kLast;
  }

  /// The theta with the largest k, by golden section: k rises, and then falls.
  double find_tip() const {
    constexpr double kGolden = 0.6180339887498949;
    double low = 0, high = end_;
    while (high - low > 1e-9 * high) {
      const double left = high - kGolden * (high - low), right = low + kGolden * (high - low);
      if (at(left).k < at(right).k) {
        low = left;
      } else {
        high = right;
      }
    }
    return high;
  }

  int delay_;
  bool difference_;
  double rest_ = 0;  ///< 1 - a
  double end_, tip_;
};

}  // namespace

BorneDamping::BorneDamping(const SampledLoop& loop, double gain_margin)
    : period_(loop.period), square_(loop.period * loop.period) {
  require("damping", std::isfinite(loop.period) && loop.period > 0, "period has to be positive, s");
  require("damping", loop.delay >= 0, "delay must not be negative, ticks");
  require("damping", std::isfinite(loop.torque_cutoff) && loop.torque_cutoff >= 0,
          "torque_cutoff must be finite and not negative, Hz");
  require("damping", std::isfinite(gain_margin) && gain_margin > 1,
          "the gain margin has to be above 1");
  const Boundary boundary(loop);
  const Boundary::Point tip = boundary.tip();
  steepest_ = tip.c / tip.k;
  cells_per_k_ = kCells * gain_margin / tip.k;
  for (std::size_t i = 0; i <= kCells; ++i) {
    const double k = tip.k * static_cast<double>(i) / kCells;
    most_[i] = boundary.most(k) / gain_margin;
    least_[i] = boundary.least(k) / gain_margin;
  }
  most_[kCells] = least_[kCells] = tip.c / gain_margin;
  least_[0] = 0;  // exactly: of motions without springs
}

}  // namespace dashpot::analysis
