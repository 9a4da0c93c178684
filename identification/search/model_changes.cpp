// Changes of a model: more factors, other ones, or fewer; and whether parts of the records have it.
#include <dashpot/identification/records/common.hpp>
#include <dashpot/identification/records/decay_cells.hpp>
#include <dashpot/identification/search/model_search.hpp>

#include <Eigen/SVD>
#include <algorithm>
#include <array>
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

namespace {

/// Parts that are stretches of time, as shares of a record.
constexpr std::array<std::pair<double, double>, 3> kWindows = {
    std::pair(0.0, 0.5), {0.1, 1.0}, {0.25, 1.0}};
constexpr double kColoured = 2;    ///< whiteness above which copies of modes are doubted
constexpr double kWeak = 0.05;     ///< energy, of the strongest: its deviation suffices
constexpr double kCopies = 0.15;   ///< of the logarithm of a frequency
constexpr double kAlike = 0.8;     ///< modal assurance criterion
constexpr double kDeviations = 3;  ///< by which an estimate may be off by chance
/// A part says nothing of a frequency (relative) or ratio with a larger deviation,
constexpr double kVague = 0.05;
/// and does not have a factor that differs by more, unless its deviation explains it.
constexpr double kSame = 0.05, kSameRatio = 0.15;
constexpr double kAtRest = 1e-9;     ///< of the motion: less are digits of a channel at rest
constexpr double kOfOneDecay = 1.4;  ///< factor on deviations; of several it shows in the records

/// Differences of a model's factors in parts of the records: their beginnings, their ends, and each
/// of several records.
std::vector<DecayStep> steps_of_parts(const Search& search, const DecayFit& whole) {
  std::vector<DecayStep> steps;
  const auto add = [&](const std::vector<MotionRecord>& records,
                       const std::vector<DecayFactor>& there) {
    DecayData part(records);
    part.set_drifts(search.found.data.drifts());
    steps.push_back(step_of(part, there, whole.noise));
  };
  for (const auto& [from, to] : kWindows) {
    std::vector<MotionRecord> records;
    for (const MotionRecord& cells : search.cells) {
      const auto size = static_cast<double>(cells.time.size());
      const auto first = static_cast<Index>(from * size), last = static_cast<Index>(to * size);
      records.push_back(part_of(cells, first, std::max(last, first + 1)));
    }
    add(records, whole.factors);
  }
  for (std::size_t r = 0; search.cells.size() > 1 && r < search.cells.size(); ++r) {
    std::vector<DecayFactor> alone = whole.factors;
    for (DecayFactor& factor : alone) factor.scale.assign(1, {1, 0}), factor.reference = 0;
    add({search.cells[r]}, alone);
  }
  return steps;
}

/// The factor that parts of the records contradict most; none: the number of factors. `shown` gets
/// the variances by which the parts differ beyond their own deviations.
std::size_t contradicted(const Search& search, const DecayFit& whole,
                         std::vector<std::array<double, 2>>& shown) {
  const std::vector<DecayStep> parts = steps_of_parts(search, whole);
  shown.assign(whole.factors.size(), {});
  // If the residual is not noise, no difference comes by chance.
  const double chance = whole.whiteness > kColoured ? 0 : kDeviations * kDeviations;
  std::size_t worst = whole.factors.size();
  double most = 1, strongest = 0;
  std::vector<double> energy;
  for (std::size_t k = 0; k < whole.factors.size(); ++k) {
    energy.push_back(energy_of(search.found.data, whole, k));
    strongest = std::max(strongest, energy.back());
  }
  Index at = 0;
  for (std::size_t k = 0; k < whole.factors.size(); ++k) {
    const DecayFactor& factor = whole.factors[k];
    const bool counts = factor.pair && energy[k] > kWeak * strongest;
    for (int i = 0; i < factor.parameters(); ++i, ++at) {
      const double size = factor.pair ? 1 : std::abs(factor.first);
      double& variance = shown[k][static_cast<std::size_t>(i)];
      double excess = 0, weights = 0, chi = 0, count = 0;
      for (std::size_t p = 0; p < parts.size(); ++p) {
        const double d = parts[p].step[at] / size,
                     own = parts[p].covariance(at, at) / (size * size);
        if (!std::isfinite(own) || !std::isfinite(d) || !(own < kVague * kVague)) continue;
        const double same = i == 0 ? kSame : kSameRatio;
        const double far = std::abs(d) / std::max(kDeviations * std::sqrt(own), same);
        if (counts && far > most) most = far, worst = k;
        if (p < kWindows.size()) {
          variance = std::max(variance, (d * d - chance * own) * size * size);
        } else if (own > 0) {
          chi += d * d / own, ++count;
          excess += d * d / own - 1, weights += 1 / own;
        }
      }
      if (count > 1 && chi > count - 1 + kDeviations * std::sqrt(2 * (count - 1))) {
        variance += excess / weights * size * size;
      }
    }
  }
  return worst;
}

/// The weaker of two factors that are one motion which is not linear: near each other, with like
/// shapes. None: the number of factors.
std::size_t copy_in(const DecayData& data, const DecayFit& whole) {
  const auto shape = [&whole](Index first, const DecayFactor& factor) {
    const MatrixXd rows = whole.amplitudes.middleRows(first, factor.parameters()) *
                          whole.noise.cwiseInverse().asDiagonal();
    return VectorXd(Eigen::JacobiSVD<MatrixXd>(rows, Eigen::ComputeThinV).matrixV().col(0));
  };
  Index at = 0;
  for (std::size_t k = 0; k < whole.factors.size(); ++k) {
    const DecayFactor& one = whole.factors[k];
    Index other_at = 0;
    for (std::size_t i = 0; i < k; ++i) {
      const DecayFactor& other = whole.factors[i];
      if (one.pair && other.pair && std::abs(one.first - other.first) < kCopies &&
          std::pow(shape(at, one).dot(shape(other_at, other)), 2) > kAlike) {
        return energy_of(data, whole, k) < energy_of(data, whole, i) ? k : i;
      }
      other_at += other.parameters();
    }
    at += one.parameters();
  }
  return whole.factors.size();
}

/// If parts differ or the residual is not noise, models of other orders differ, too: adds their
/// spread to the deviations.
void add_spread_of_orders(Search& search) {
  const std::vector<DecayFactor>& factors = search.found.fit.factors;
  for (std::size_t k = 0; k < factors.size(); ++k) {
    if (!factors[k].pair) continue;
    std::array<double, 2> sum{};
    double count = 0;
    for (const DecayFit& model : search.plain_by_order) {
      const DecayFactor* nearest = nullptr;
      double least = kCopies;
      for (const DecayFactor& factor : model.factors) {
        const double distance = std::abs(factor.first - factors[k].first);
        if (factor.pair && distance < least) least = distance, nearest = &factor;
      }
      if (nearest == nullptr) continue;
      sum[0] += std::pow(nearest->first - factors[k].first, 2);
      sum[1] += std::pow(nearest->second - factors[k].second, 2);
      ++count;
    }
    for (std::size_t i : {0U, 1U}) search.found.scatter[k][i] += count > 0 ? sum[i] / count : 0;
  }
}

}  // namespace

void keep_repeated(Search& search) {
  auto& [data, fit, by_order, order, larger, scatter, differs, not_repeated] = search.found;
  const auto contradicts = [&](const DecayFit& whole) {
    return contradicted(search, whole, search.found.scatter);
  };
  // Unexplained motion is not noise, and looks like a mode near another one.
  const bool copied =
      std::max(search.colour, fit.whiteness) > kColoured && copy_in(data, fit) < fit.factors.size();
  if (contradicts(fit) == fit.factors.size() && !copied) {
    if (fit.whiteness > kColoured) add_spread_of_orders(search);
    return;
  }
  differs = true;
  const DecayFit before = fit;
  larger.reset();
  std::vector<const DecayFit*> models;
  for (const DecayFit& model : search.plain_by_order) {
    if (!model.factors.empty() && model.factors.size() < before.factors.size() &&
        std::isfinite(model.criterion)) {
      models.push_back(&model);
    }
  }
  std::sort(models.begin(), models.end(), [&](const DecayFit* a, const DecayFit* b) {
    return search.score(*a) < search.score(*b);
  });
  for (const DecayFit* model : models) {
    fit = data.drifts() ? fit_decays(data, model->factors, model->noise, search.limits.iterations)
                        : *model;
    if (copy_in(data, fit) == fit.factors.size() && contradicts(fit) == fit.factors.size()) break;
    fit = before;
  }
  for (;;) {
    std::size_t worst = contradicts(fit);
    if (worst == fit.factors.size()) worst = copy_in(data, fit);
    if (worst == fit.factors.size() || fit.factors.size() < 2) break;
    std::vector<DecayFactor> factors = fit.factors;
    factors.erase(factors.begin() + static_cast<std::ptrdiff_t>(worst));
    fit = fit_decays(data, factors, fit.noise, search.limits.iterations);
    larger.reset();
  }
  for (const DecayFactor& factor : before.factors) {
    const bool kept = std::any_of(fit.factors.begin(), fit.factors.end(), [&](const auto& other) {
      const Complex a = factor.eigenvalues()[0], b = other.eigenvalues()[0];
      return std::abs(a - b) < kSame * std::abs(a);
    });
    if (!kept) not_repeated.push_back(factor);
  }
  add_spread_of_orders(search);
}

VectorXd usual_noise(const std::vector<MotionRecord>& all, const VectorXd& noise,
                     const VectorXd& motion) {
  VectorXd sum = VectorXd::Zero(noise.size()), count = sum;
  for (const MotionRecord& record : all) {
    const VectorXd alone = first_noise({record});
    for (Index c = 0; c < alone.size(); ++c) {
      if (alone[c] > kAtRest * motion[c]) sum[c] += std::log(alone[c]), ++count[c];
    }
  }
  const VectorXd mean = sum.cwiseQuotient(count.cwiseMax(1)).array().exp();
  return (count.array() > 0).select(mean, noise).cwiseMax(DecayData::kLinear * motion);
}

void widen(FoundModel& found, const VectorXd& sensors) {
  const double rest = std::max(1.0, found.fit.noise.cwiseQuotient(sensors).maxCoeff());
  found.fit.covariance *= rest * (found.data.sources() == 1 ? kOfOneDecay * kOfOneDecay : 1);
}

}  // namespace dashpot::identification
