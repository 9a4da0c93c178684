#include <dashpot/analysis/base/arithmetic.hpp>
#include <dashpot/analysis/base/require.hpp>
#include <dashpot/analysis/sampled/circle_count.hpp>
#include <dashpot/analysis/sampled/margin_search.hpp>
#include <dashpot/analysis/sampled_loop.hpp>

#include <Eigen/Cholesky>
#include <algorithm>
#include <array>
#include <cmath>
#include <optional>

namespace dashpot::analysis {
namespace {

using Eigen::MatrixXd;

/// From one factor to the next that is tried, and the least one.
constexpr double kFactorStep = 1.25, kLeastMargin = 1e-3;

/// The loop with `factor` times its stiffness and its controller's damping.
class ScaledLoop {
 public:
  /// Motions with |log z| below `slowest`, per tick, do not count.
  ScaledLoop(const SampledDataModel& loop, double slowest) : slowest_(slowest) {
    if (loop.rows() > kDenseRows) {
      counted_.emplace(loop, slowest);
      return;
    }
    // Motions that do not count are the same with every factor but zero.
    free_ = loop.on_other_motions(loop.transition(0));
    gain_ = loop.on_other_motions(loop.transition(1)) - free_;
    if (loop.rows() > 2 * loop.n) return;
    const MatrixXd V = loop.on_other_motions(energy(loop)), W = V * gain_;
    if (!is_positive(V)) return;  // not an energy
    lost_[0] = V - free_.transpose() * V * free_;
    lost_[0].diagonal().array() -= kRounding * V.trace();
    lost_[1] = free_.transpose() * W;
    lost_[1] += lost_[1].transpose().eval();
    lost_[2] = gain_.transpose() * W;
  }

  /// Proves with Cholesky's decomposition that a loop without delay, filter and memory is stable:
  /// a tick takes away some of an energy, whatever the state. False says nothing.
  bool proves(double factor) const {
    if (lost_[0].size() == 0) return false;
    const MatrixXd lost = lost_[0] - factor * (lost_[1] + factor * lost_[2]);
    return is_positive(lost);
  }

  /// The excess is the largest |z|, less 1, or something like it: the loop is stable if it is
  /// negative.
  Trial at(double factor) const {
    if (counted_) return {factor, counted_->excess(factor)};
    MatrixXd A = free_ + factor * gain_;
    return Trial::solve(factor, A, slowest_);
  }
  double excess(double factor) const { return at(factor).excess; }

 private:
  /// Cholesky's decomposition reports success for NaN.
  static bool is_positive(const MatrixXd& A) {
    return A.allFinite() && Eigen::LLT<MatrixXd>(A).info() == Eigen::Success;
  }

  /// Returns V of an energy x'V x of the states (y, y') that falls over a wide range of factors.
  /// For a mode with a ratio of 0.33 this is from 1 to 7, for one with 0.7 to 85, until ticks
  /// matter.
  static MatrixXd energy(const SampledDataModel& loop) {
    constexpr double kCross = 0.7, kStiffness = 1.4;
    const Eigen::Index n = loop.n;
    const MatrixXd C = loop.C - loop.D, K = loop.K - loop.P;
    MatrixXd V = MatrixXd::Identity(2 * n, 2 * n);
    V.topRightCorner(n, n) = 0.5 * kCross * (C + C.transpose());
    V.bottomLeftCorner(n, n) = V.topRightCorner(n, n);
    V.topLeftCorner(n, n) = kStiffness * (0.5 * (K + K.transpose()) + kCross * C.transpose() * C);
    return V;
  }

  static constexpr double kRounding = 1e-13;
  double slowest_;
  MatrixXd free_, gain_;
  std::array<MatrixXd, 3> lost_;  ///< of the energy in a tick, by powers of the factor
  std::optional<CircleCount> counted_;
};

bool keeps(const SampledDataModel& unit, double margin, double slowest) {
  const ScaledLoop loop(unit, slowest);
  // Also if it is unstable with less: gain_margin begins at 1.
  if (margin < 1) return loop.excess(margin) < 0 || loop.excess(1) < 0;
  if (!(loop.excess(margin) < 0)) return false;
  for (double factor = 1; factor < margin; factor *= kFactorStep) {
    if (!(loop.excess(factor) < 0)) return false;
  }
  return true;
}

/// See gain_margin.
double find_margin(const SampledDataModel& unit, double most, double slowest) {
  const ScaledLoop loop(unit, slowest);
  const auto after = [most](double factor) { return std::min(kFactorStep * factor, most); };
  double factor = 1;
  if (loop.proves(1)) {
    while (factor < most && loop.proves(after(factor))) factor = after(factor);
  }
  Trial here = loop.at(factor);
  if (here.excess < 0) {
    for (Trial inside = here;; inside = here) {
      if (inside.factor >= most) return kInfinity;
      here = loop.at(after(inside.factor));
      if (!(here.excess < 0)) return boundary(loop, inside, here);
    }
  }
  for (Trial outside = here;; outside = here) {
    if (outside.factor < kLeastMargin) return 0;
    here = loop.at(0.8 * outside.factor);
    if (here.excess < 0) return boundary(loop, here, outside);
  }
}

}  // namespace

template <int N>
double gain_margin(const System<N>& system, const Spectrum<N>& spectrum, const SampledLoop& loop,
                   double most) {
  if (loop.gears.any()) {
    const GearedLoop geared(system, loop);
    return gain_margin(geared.system, geared.spectrum, geared.loop, most);
  }
  return find_margin(SampledDataModel(system, spectrum, loop), most, loop.slowest * loop.period);
}

template <int N>
double gain_margin(const ElasticForm<N>& form, const SampledLoop& loop, double most) {
  return find_margin(SampledDataModel(form, loop), most, loop.slowest * loop.period);
}

bool keeps_margin(const System<>& system, const Spectrum<>& spectrum, const SampledLoop& loop,
                  double margin) {
  require("keeps_margin", margin >= 0, "the gain margin must not be negative");
  if (loop.gears.any()) {
    const GearedLoop geared(system, loop);
    return keeps_margin(geared.system, geared.spectrum, geared.loop, margin);
  }
  const SampledDataModel unit(system, spectrum, loop);
  return margin == 0 || keeps(unit, margin, loop.slowest * loop.period);
}

template double gain_margin(const System<kDynamic>&, const Spectrum<kDynamic>&, const SampledLoop&,
                            double);
template double gain_margin(const System<kMaxDof>&, const Spectrum<kMaxDof>&, const SampledLoop&,
                            double);
template double gain_margin(const ElasticForm<kDynamic>&, const SampledLoop&, double);
template double gain_margin(const ElasticForm<kMaxDof>&, const SampledLoop&, double);

}  // namespace dashpot::analysis
