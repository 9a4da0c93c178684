#include <dashpot/analysis/sampled/loci.hpp>
#include <dashpot/analysis/sampled/sampled_data_model.hpp>
#include <dashpot/analysis/sampled/small_problem.hpp>
#include <dashpot/analysis/sampled_loop.hpp>

#include <algorithm>
#include <cmath>
#include <limits>
#include <stdexcept>

namespace dashpot::analysis {
namespace {

constexpr double kInfinity = std::numeric_limits<double>::infinity();
/// Motions with |log z| below this never count; the latter with states of the controller's own.
constexpr double kSlowest = 1e-6, kSlowestWithStates = 1e-4, kLargestSlowest = 1;
constexpr double kLeast = 1e-3;
/// Factors from `crossings` are refined where they are as near as this to what they decide.
constexpr double kNear = 1.05;

/// The number of roots outside the border with no gain at all. Masses and friction have none; what
/// the compensated gravity adds is a loop of its own, whose gain grows from 0 to 1.
int roots_without_gain(const SmallProblem& problem, const Border& border) {
  if (!problem.has_gravity()) return 0;
  const Loci loci(
      border, [&](Complex zeta) { return problem.gravity_values(zeta); },
      [](Complex) { return Complex(0); });
  int count = 0;
  for (const Crossing& crossing : loci.crossings(kNear)) {
    if (loci.refined(crossing).factor < 1) count += crossing.leaving;
  }
  return count;
}

/// The least factor above 1; infinite if there is none up to `most`.
double least_above(const Loci& loci, const std::vector<Crossing>& all, double most) {
  double least = kInfinity;
  for (const Crossing& one : all) {
    if (one.factor < 1 / kNear || one.factor > kNear * std::min(least, most)) continue;
    const double factor = loci.refined(one).factor;
    if (factor > 1) least = std::min(least, factor);
  }
  return least <= most ? least : kInfinity;
}

/// See gain_margin.
double find_margin(const SampledDataModel& model, double most, double slowest) {
  const bool states = model.inner() > (model.difference ? 3 : 2) * model.n;
  const Border border(std::clamp(slowest, states ? kSlowestWithStates : kSlowest, kLargestSlowest));
  const SmallProblem problem(model);
  int unstable = roots_without_gain(problem, border);
  if (problem.rank() == 0) return unstable > 0 ? 0 : kInfinity;
  const Loci loci(
      border, [&](Complex zeta) { return problem.values(zeta); },
      [&](Complex zeta) { return model.log_actuation(zeta); });
  std::vector<Crossing> all = loci.crossings(kNear * std::max(most, 1.0));
  std::vector<Crossing> below;
  for (const Crossing& one : all) {
    const bool near = one.factor > 1 / kNear && one.factor < kNear;
    const Crossing crossing = near ? loci.refined(one) : one;
    if (crossing.factor >= 1) continue;
    below.push_back(crossing);
    unstable += crossing.leaving;
  }
  if (unstable <= 0) return least_above(loci, all, most);
  std::sort(below.begin(), below.end(),
            [](const Crossing& a, const Crossing& b) { return a.factor > b.factor; });
  for (const Crossing& crossing : below) {
    unstable -= crossing.leaving;
    if (crossing.factor < kLeast) break;
    if (unstable <= 0) return loci.refined(crossing).factor;
  }
  return 0;
}

}  // namespace

template <int N>
double gain_margin(const System<N>& system, const Spectrum<N>& spectrum, const SampledLoop& loop,
                   double most, double slowest) {
  return find_margin(SampledDataModel(system, spectrum, loop), most, slowest * loop.period);
}

template <int N>
double gain_margin(const ElasticForm<N>& form, const SampledLoop& loop, double most,
                   double slowest) {
  return find_margin(SampledDataModel(form, loop), most, slowest * loop.period);
}

template double gain_margin(const System<kDynamic>&, const Spectrum<kDynamic>&, const SampledLoop&,
                            double, double);
template double gain_margin(const System<kMaxDof>&, const Spectrum<kMaxDof>&, const SampledLoop&,
                            double, double);
template double gain_margin(const ElasticForm<kDynamic>&, const SampledLoop&, double, double);
template double gain_margin(const ElasticForm<kMaxDof>&, const SampledLoop&, double, double);

}  // namespace dashpot::analysis
