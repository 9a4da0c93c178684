// Changes of a model: more factors, other ones, or fewer.
#include <dashpot/identification/records/common.hpp>
#include <dashpot/identification/search/model_changes.hpp>

#include <algorithm>
#include <cmath>
#include <tuple>
#include <utility>

namespace dashpot::identification {
namespace {

/// A change of the model is given up if -2 log likelihood will stay larger by this. With 60,
/// searches among heavily damped modes give up models that become the best ones.
constexpr double kDifference = 300;
/// Radians of a record: slower motion is a constant; and exponent of growth that is too fast.
constexpr double kConstant = 0.3, kGrows = 3;
constexpr double kSameCandidate = 0.1;  ///< relative distance: a fit makes one of them
/// The logarithms of the frequencies of the halves of a factor that is split, about its own; they
/// have to differ for a fit to separate them. Less damped modes are found without a split.
constexpr double kApart = 0.15, kDamped = 0.3;
constexpr double kSurelyThere = 0.02;  ///< relative deviation of a factor that need not be tried
constexpr double kCancels = 30;        ///< energy of cancelling factors, of all motion
constexpr int kUntangling = 40;        ///< iterations: the start is far away
constexpr int kAddedAgain = 4;         ///< factors, in place of those that cancelled
/// Shares of the search that are done when factors are added, split, and dropped, for progress.
constexpr double kAdding = 0.6, kSplitting = 0.7, kDropping = 0.8;

/// Replaces the model's factors by these, if they explain the cells better.
bool change(Search& search, const std::vector<DecayFactor>& factors) {
  DecayFit& fit = search.found.fit;
  std::optional<DecayFit>& larger = search.found.larger;
  // A larger model that is not worth it is still of use, if it fits better.
  const double before = fit.criterion - parameter_penalty(fit, search.found.data);
  DecayFit there = fit_decays(search.found.data, factors, fit.noise, search.limits.iterations,
                              before + kDifference);
  if (search.score(there) < search.score(fit)) {
    fit = std::move(there);
    larger.reset();
    return true;
  }
  if (factors.size() > fit.factors.size() && (!larger || there.criterion < larger->criterion)) {
    larger = std::move(there);
  }
  return false;
}

/// Factors of the residual in the cells.
std::vector<DecayFactor> candidates(const Search& search) {
  const FoundModel& found = search.found;
  std::vector<MatrixXd> rest;
  for (const MotionRecord& record : search.cells) {
    rest.emplace_back(MatrixXd::Zero(record.output.rows(), record.output.cols()));
  }
  const auto over = left_over(found.data, found.fit);
  for (std::size_t k = 0; k < over.size(); ++k) {
    for (std::size_t c = 0; c < found.data.parts[k].channels.size(); ++c) {
      const Index channel = found.data.parts[k].channels[c];
      Index at = 0;
      for (std::size_t r = 0; r < rest.size(); ++r) {
        for (Index i = 0; i < rest[r].cols(); ++i) {
          if (!std::isfinite(search.cells[r].output(channel, i))) continue;
          rest[r](channel, i) = over[k](at++, static_cast<Index>(c)) / found.fit.noise[channel];
        }
      }
    }
  }
  std::vector<DecayFactor> result;
  for (const std::vector<RealizedPole>& poles : search.poles_of_rest(rest)) {
    for (const DecayFactor& factor : factors_of(poles, search.duration)) {
      const bool known = std::any_of(result.begin(), result.end(), [&](const DecayFactor& other) {
        const Complex a = factor.eigenvalues()[0], b = other.eigenvalues()[0];
        return factor.pair == other.pair && std::abs(a - b) < kSameCandidate * std::abs(a);
      });
      if (!known) result.push_back(factor);
    }
  }
  return result;
}

/// Leaves out a factor, or one of its eigenvalues, of which the data may show only the other.
bool drop_one(Search& search) {
  const DecayFit& fit = search.found.fit;
  Index at = 0;
  for (std::size_t k = 0; k < fit.factors.size() && fit.factors.size() > 1; ++k) {
    if (!search.goes_on(kDropping)) return false;
    const Index first = at;
    at += fit.factors[k].parameters();
    const double size = fit.factors[k].pair ? 1 : std::abs(fit.factors[k].first);
    if (std::sqrt(fit.covariance(first, first)) < kSurelyThere * size) continue;
    std::vector<DecayFactor> factors = fit.factors;
    factors.erase(factors.begin() + static_cast<std::ptrdiff_t>(k));
    if (change(search, factors)) return true;
    const auto lambda = fit.factors[k].eigenvalues();
    if (!fit.factors[k].pair || lambda[0].imag() != 0) continue;
    for (const Complex& one : lambda) {
      factors = fit.factors;
      factors[k] = fit.factors[k].one_of_pair(one.real());
      if (change(search, factors)) return true;
    }
  }
  return false;
}

/// Removes factors that cancel against each other, a sign of a lost search, and begins again.
void untangle(Search& search) {
  const DecayData& data = search.found.data;
  DecayFit& fit = search.found.fit;
  std::optional<DecayFit>& larger = search.found.larger;
  std::vector<DecayFactor> kept;
  double all = 0;
  for (const DecayPart& part : data.parts) {
    for (const Index c : part.channels) {
      all += static_cast<double>(samples_of(part)) * std::pow(data.motion[c] / fit.noise[c], 2);
    }
  }
  for (std::size_t k = 0; k < fit.factors.size(); ++k) {
    if (energy_of(data, fit, k) < kCancels * all) kept.push_back(fit.factors[k]);
  }
  if (kept.size() == fit.factors.size() || kept.empty()) return;
  auto before = std::pair(fit, larger);
  fit = fit_decays(data, kept, fit.noise, kUntangling);
  for (int k = 0; k < kAddedAgain && add_from_rest(search); ++k) continue;
  drop_useless(search);
  if (!(search.score(fit) < search.score(before.first))) std::tie(fit, larger) = std::move(before);
}

}  // namespace

std::vector<DecayFactor> factors_of(const std::vector<RealizedPole>& poles, double duration) {
  std::vector<DecayFactor> factors;
  for (const auto& [lambda, shape] : poles) {
    if (modulus(lambda) * duration < kConstant || lambda.real() * duration > kGrows) continue;
    factors.push_back(lambda.imag() > 0 ? DecayFactor::of_pair(lambda)
                                        : DecayFactor::of_single(lambda.real()));
  }
  return factors;
}

bool add_from_rest(Search& search) {
  for (const DecayFactor& factor : candidates(search)) {
    if (!search.goes_on(kAdding)) return false;
    std::vector<DecayFactor> factors = search.found.fit.factors;
    factors.push_back(factor);
    if (change(search, factors)) return true;
  }
  return false;
}

/// Two heavily damped modes near each other look like one, and the residual does not show it.
bool split_one(Search& search) {
  const std::vector<DecayFactor>& whole = search.found.fit.factors;
  for (std::size_t k = 0; k < whole.size(); ++k) {
    if (!whole[k].pair || whole[k].second < kDamped) continue;
    if (!search.goes_on(kSplitting)) return false;
    std::vector<DecayFactor> factors = whole;
    factors[k].scale.clear();
    factors.push_back(factors[k]);
    factors[k].first -= kApart;
    factors.back().first += kApart;
    if (change(search, factors)) return true;
  }
  return false;
}

void drop_useless(Search& search) {
  while (drop_one(search)) continue;
}

void improve(Search& search) {
  for (int k = 0; k < search.limits.added && add_from_rest(search); ++k) continue;
  drop_useless(search);
  untangle(search);
}

}  // namespace dashpot::identification
