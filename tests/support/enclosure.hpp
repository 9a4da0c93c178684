#pragma once
// The check that published bounds enclose the true eigenvalues.

#include <dashpot/analysis/mode_tracker.hpp>
#include <dashpot/tests/support/systems.hpp>

#include <algorithm>
#include <cmath>
#include <utility>
#include <vector>

namespace dashpot::testing {

struct Verdict {
  bool enclosed = true;
  bool proved = true;     ///< no bound is infinite
  double tightest = 0;    ///< largest error / bound; slack counts as error
  double widest = 0;      ///< largest bound / |eigenvalue|
  const char* what = "";  ///< was not enclosed
};

/// Gives each published eigenvalue i a true one j of its own within reach[i] + slack[j], by
/// augmenting paths; no slack: what is true is exact.
class Matching {
 public:
  Matching(const std::vector<LongComplex>& published, const std::vector<LongComplex>& truth,
           const std::vector<long double>& reach, std::vector<long double> slack = {})
      : published_(published),
        truth_(truth),
        reach_(reach),
        slack_(std::move(slack)),
        owner_(truth.size(), -1) {
    slack_.resize(truth.size(), 0);
    for (std::size_t i = 0; i < published.size(); ++i) {
      visited_.assign(truth.size(), false);
      complete_ = complete_ && place(i);
    }
  }
  bool complete() const { return complete_; }
  /// The true eigenvalue of published i.
  std::size_t of(std::size_t i) const {
    const auto found = std::find(owner_.begin(), owner_.end(), static_cast<int>(i));
    return static_cast<std::size_t>(found - owner_.begin());
  }

 private:
  bool place(std::size_t i) {
    for (std::size_t j = 0; j < truth_.size(); ++j) {
      const long double apart = std::abs(published_[i] - truth_[j]);
      if (visited_[j] || !(apart <= reach_[i] + slack_[j])) continue;
      visited_[j] = true;
      if (owner_[j] >= 0 && !place(static_cast<std::size_t>(owner_[j]))) continue;
      owner_[j] = static_cast<int>(i);
      return true;
    }
    return false;
  }

  const std::vector<LongComplex>&published_, &truth_;
  const std::vector<long double>& reach_;
  std::vector<long double> slack_;
  std::vector<int> owner_;
  std::vector<bool> visited_;
  bool complete_ = true;
};

/// Whether each eigenvalue is within its bound of a true one, one to one; and natural frequency and
/// damping ratio within theirs, where it is clear which two true eigenvalues are the mode's.
/// `accuracy`: of the truth, relative to the largest eigenvalue.
inline Verdict judge_against(const std::vector<LongComplex>& truth,
                             const analysis::TrackedSpectrum& spectrum, double accuracy) {
  using Long = long double;
  Long size = 0;
  for (const LongComplex& z : truth) size = std::max(size, std::abs(z));
  const Long slack = static_cast<Long>(accuracy) * size;
  std::vector<LongComplex> published;
  std::vector<Long> reach;
  Verdict verdict;
  for (int i = 0; i < spectrum.mode_count; ++i) {
    const analysis::ModeNumbers& mode = spectrum.modes[static_cast<std::size_t>(i)];
    verdict.proved = verdict.proved && std::isfinite(mode.error_bound);
    for (const auto& value : mode.eigenvalues) {
      published.emplace_back(value);
      reach.push_back(static_cast<Long>(mode.error_bound) + slack);  // infinite: whatever it is
    }
  }
  const auto fail = [&](const char* what) {
    if (verdict.enclosed) verdict.what = what;
    verdict.enclosed = false;
  };
  const Matching matching(published, truth, reach);
  if (!matching.complete()) {
    fail("eigenvalues");
    return verdict;
  }
  const auto compare = [&](Long error, double bound, const char* what) {
    if (!std::isfinite(bound)) return;
    error = std::max<Long>(error, 0);
    if (!(error <= static_cast<Long>(bound))) fail(what);
    const auto ratio = static_cast<double>(error / static_cast<Long>(bound));
    if (error > 0 && !(ratio <= verdict.tightest)) verdict.tightest = ratio;
  };
  for (int i = 0; i < spectrum.mode_count; ++i) {
    const analysis::ModeNumbers& mode = spectrum.modes[static_cast<std::size_t>(i)];
    const std::size_t k = 2 * static_cast<std::size_t>(i);
    const LongComplex &a = truth[matching.of(k)], &b = truth[matching.of(k + 1)];
    for (const std::size_t e : {k, k + 1}) {
      compare(std::abs(published[e] - truth[matching.of(e)]) - slack, mode.error_bound,
              "eigenvalues");
      const auto modulus = static_cast<double>(std::abs(published[e]));
      if (modulus > 0) verdict.widest = std::max(verdict.widest, mode.error_bound / modulus);
    }
    bool clear = std::isfinite(mode.error_bound);
    for (std::size_t j = 0; j < truth.size() && clear; ++j) {
      const bool own = j == matching.of(k) || j == matching.of(k + 1);
      const bool near = std::abs(truth[j] - published[k]) <= 4 * reach[k] ||
                        std::abs(truth[j] - published[k + 1]) <= 4 * reach[k];
      clear = own || !near;
    }
    const Long product = (a * b).real();
    if (!clear || !(product > 0) || std::isnan(mode.natural_frequency)) continue;
    const Long omega = std::sqrt(product), zeta = -(a + b).real() / (2 * omega);
    compare(std::abs(omega - static_cast<Long>(mode.natural_frequency)) - slack,
            mode.natural_frequency_bound, "natural frequency");
    compare(std::abs(zeta - static_cast<Long>(mode.damping_ratio)) - slack / omega,
            mode.damping_ratio_bound, "damping ratio");
  }
  return verdict;
}

/// Judges against eigenvalues computed in long double.
inline Verdict judge(const analysis::System<analysis::kMaxDof>& system,
                     const analysis::TrackedSpectrum& spectrum, double accuracy) {
  return judge_against(true_eigenvalues(system), spectrum, accuracy);
}

}  // namespace dashpot::testing
