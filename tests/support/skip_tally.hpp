#pragma once
// Terms that are left out must change nothing: numbers with and without them, compared.

#include <dashpot/tests/support/enclosure.hpp>

#include <cmath>
#include <cstdint>
#include <limits>
#include <string>
#include <vector>

namespace dashpot::testing {

/// The tally of one thing that is left out.
struct SkipTally {
  std::string what;
  std::int64_t compared = 0, left_out = 0, outside = 0;
  double largest = 0;  ///< difference in units of what is allowed

  /// It was left out, and nothing differs.
  bool good() const { return outside == 0 && left_out > 0 && compared > 0; }
  /// NaN agrees with NaN.
  void see(double with, double without, double allowed) {
    ++compared;
    if (with == without || (std::isnan(with) && std::isnan(without))) return;
    const double share = std::abs(with - without) / allowed;
    if (!(share <= 1)) ++outside;
    if (!(share <= largest)) largest = share;
  }
  /// All entries to the last bit.
  template <typename A, typename B>
  void see_the_same(const A& with, const B& without) {
    if (with.size() != without.size()) return fail();
    for (Eigen::Index i = 0; i < with.size(); ++i) see(with[i], without[i], 0);
  }
  void fail() {
    ++compared, ++outside;
    largest = std::numeric_limits<double>::infinity();
  }
  SkipTally& operator+=(const SkipTally& other) {
    what = other.what;
    compared += other.compared;
    left_out += other.left_out;
    outside += other.outside;
    if (!(other.largest <= largest)) largest = other.largest;
    return *this;
  }
};

/// The modes of a spectrum as they can be compared: of Mode or VibrationMode.
struct PlainMode {
  std::array<analysis::Complex, 2> eigenvalues;
  double error_bound, natural_frequency, natural_frequency_bound, damping_ratio,
      damping_ratio_bound;

  template <typename Mode>
  explicit PlainMode(const Mode& mode)
      : eigenvalues(mode.eigenvalues),
        error_bound(mode.error_bound),
        natural_frequency(mode.natural_frequency),
        natural_frequency_bound(mode.natural_frequency_bound),
        damping_ratio(mode.damping_ratio),
        damping_ratio_bound(mode.damping_ratio_bound) {}
};
using PlainModes = std::vector<PlainMode>;

/// Fails unless the same places have the same bits.
inline void compare_bits(const PlainModes& with, const PlainModes& without, SkipTally& tally) {
  if (with.size() != without.size()) return tally.fail();
  for (std::size_t i = 0; i < with.size(); ++i) {
    const PlainMode &a = with[i], &b = without[i];
    for (std::size_t k = 0; k < 2; ++k) {
      tally.see(a.eigenvalues[k].real(), b.eigenvalues[k].real(), 0);
      tally.see(a.eigenvalues[k].imag(), b.eigenvalues[k].imag(), 0);
    }
    tally.see(a.error_bound, b.error_bound, 0);
    tally.see(a.natural_frequency, b.natural_frequency, 0);
    tally.see(a.natural_frequency_bound, b.natural_frequency_bound, 0);
    tally.see(a.damping_ratio, b.damping_ratio, 0);
    tally.see(a.damping_ratio_bound, b.damping_ratio_bound, 0);
  }
}

/// The eigenvalues of modes, and the errors that they may have.
struct PlainValues {
  std::vector<LongComplex> points;
  std::vector<long double> reach;
  std::vector<std::size_t> mode;

  /// Bounds, and `relative` times the modulus.
  PlainValues(const PlainModes& modes, double relative) {
    for (std::size_t i = 0; i < modes.size(); ++i) {
      for (const analysis::Complex& value : modes[i].eigenvalues) {
        points.emplace_back(value);
        const double error = modes[i].error_bound + relative * std::abs(value);  // may be infinite
        reach.push_back(static_cast<long double>(error));
        mode.push_back(i);
      }
    }
  }
  /// Leaves out real ones that are far from all of `others`; how many.
  int leave_out_strangers(const PlainValues& others) {
    PlainValues rest({}, 0);
    for (std::size_t k = 0; k < points.size(); ++k) {
      bool near = points[k].imag() != 0;
      for (std::size_t j = 0; j < others.points.size() && !near; ++j) {
        near = std::abs(points[k] - others.points[j]) <= reach[k] + others.reach[j];
      }
      if (!near) continue;
      rest.points.push_back(points[k]);
      rest.reach.push_back(reach[k]);
      rest.mode.push_back(mode[k]);
    }
    const auto left_out = static_cast<int>(points.size() - rest.points.size());
    *this = rest;
    return left_out;
  }
};

/// Each eigenvalue of `with` is one of `without`, one to one, within the sum of both proved bounds
/// and `relative` times its modulus; likewise frequencies and ratios of modes that have both
/// eigenvalues in common. `without` may have more modes. Which real eigenvalues form a mode, and
/// which are the rates of that many zero modes, depends on the way there.
inline void compare_bounded(const PlainModes& with, const PlainModes& without, int zero_modes,
                            double relative, SkipTally& tally) {
  PlainValues a(with, relative);
  const PlainValues b(without, 0);
  if (a.leave_out_strangers(b) > zero_modes) return tally.fail();
  const Matching matching(a.points, b.points, a.reach, b.reach);
  if (!matching.complete()) return tally.fail();
  std::vector<std::vector<std::size_t>> partners(with.size());
  for (std::size_t k = 0; k < a.points.size(); ++k) {
    const std::size_t other = matching.of(k);
    tally.see(static_cast<double>(std::abs(a.points[k] - b.points[other])), 0,
              static_cast<double>(a.reach[k] + b.reach[other]));
    partners[a.mode[k]].push_back(b.mode[other]);
  }
  for (std::size_t i = 0; i < with.size(); ++i) {
    if (partners[i].size() < 2 || partners[i][0] != partners[i][1]) continue;
    const PlainMode &x = with[i], &y = without[partners[i][0]];
    if (std::isnan(x.natural_frequency) || std::isnan(y.natural_frequency)) continue;
    tally.see(
        x.natural_frequency, y.natural_frequency,
        x.natural_frequency_bound + y.natural_frequency_bound + relative * x.natural_frequency);
    tally.see(x.damping_ratio, y.damping_ratio,
              x.damping_ratio_bound + y.damping_ratio_bound + relative);
  }
}

}  // namespace dashpot::testing
