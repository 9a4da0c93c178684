#include <dashpot/identification/model/common_denominator.hpp>
#include <dashpot/identification/model/decay_columns.hpp>
#include <dashpot/identification/records/check_that.hpp>
#include <dashpot/identification/search/model_search.hpp>

#include <algorithm>
#include <cmath>
#include <limits>
#include <stdexcept>
#include <string>
#include <tuple>
#include <utility>

namespace dashpot::identification {
namespace {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

constexpr int kRoughIterations = 4;  ///< of models of rising order: a first estimate
constexpr int kProductIterations = 12;
constexpr Index kSearchCells = 3000;
/// A change of the model is given up where -2 log likelihood will stay larger by this. With 60,
/// searches among heavily damped modes give up models that become the best ones.
constexpr double kDifference = 300;
/// In lengths of the record: a slower single decay is taken for drift, if one explains as much.
constexpr double kDrifts = 3;

/// Returns as factors the poles that a record of this length (s) can tell from a constant.
std::vector<DecayFactor> factors_of(const std::vector<RealizedPole>& poles, double duration) {
  std::vector<DecayFactor> factors;
  for (const RealizedPole& pole : poles) {
    if (modulus(pole.eigenvalue) * duration < 0.3 || pole.eigenvalue.real() * duration > 3)
      continue;
    factors.push_back(pole.eigenvalue.imag() > 0 ? DecayFactor::of_pair(pole.eigenvalue)
                                                 : DecayFactor::of_single(pole.eigenvalue.real()));
  }
  return factors;
}

/// Poles of what is left over, of the whole and of the beginning, where fast decays are.
std::vector<std::vector<RealizedPole>> rest_poles(const std::vector<MatrixXd>& rest, double step,
                                                  Index channels) {
  std::vector<std::vector<RealizedPole>> result;
  for (const Index part : {1, 8}) {
    std::vector<MatrixXd> beginning;
    for (const MatrixXd& record : rest) {
      const Index columns = record.cols() / part;
      if (columns >= 10) beginning.emplace_back(record.leftCols(columns));
    }
    if (beginning.empty()) continue;
    const Realization realization(beginning, step, channels, 100);
    for (int n = 1; n <= std::min(2, realization.max_order()); ++n) {
      result.push_back(realization.poles(n));
    }
  }
  return result;
}

/// Adds the products of the strongest oscillations to a fit: an arm that moves far is not linear,
/// and these products would be taken for modes.
DecayFit with_products(const DecayData& data, const DecayFit& plain) {
  constexpr std::size_t kStrongest = 2;
  std::vector<std::pair<double, std::size_t>> strongest;
  for (std::size_t k = 0; k < plain.factors.size(); ++k) {
    if (plain.factors[k].eigenvalues()[0].imag() == 0) continue;
    strongest.emplace_back(energy_of(data, plain, k), k);
  }
  std::sort(strongest.rbegin(), strongest.rend());
  std::vector<DecayFactor> factors = plain.factors;
  for (std::size_t i = 0; i < std::min(kStrongest, strongest.size()); ++i) {
    factors[strongest[i].second].has_products = true;
  }
  return fit_decays(data, factors, plain.noise, kProductIterations);
}

/// The search is among the records that move most: more of them say no more of how many modes there
/// are.
std::vector<MotionRecord> strongest(const std::vector<MotionRecord>& records,
                                    const VectorXd& noise) {
  constexpr std::size_t kMost = 8;
  if (records.size() <= kMost) return records;
  std::vector<std::pair<double, std::size_t>> motion;
  for (std::size_t r = 0; r < records.size(); ++r) {
    const DecayData alone({records[r]});
    motion.emplace_back(-alone.motion.cwiseQuotient(noise).squaredNorm(), r);
  }
  std::sort(motion.begin(), motion.end());
  std::vector<MotionRecord> chosen;
  for (std::size_t i = 0; i < kMost; ++i) chosen.push_back(records[motion[i].second]);
  return chosen;
}

}  // namespace

ModelSearch::ModelSearch(const std::vector<MotionRecord>& all, const IdentifyOptions& options)
    : data(all), stop_(options.stop) {
  const int max_order = options.max_order;
  const bool refine = options.refine;
  VectorXd rounding;
  const VectorXd noise = first_noise(all, &rounding);
  const std::vector<MotionRecord> records = strongest(all, noise);
  const DecayCells cells(records, noise, noise.cwiseMax(DecayData::kLinear * data.motion),
                         refine ? kSearchCells : 0);
  const Index channels = data.channels;
  const Realization realization(cells.weighted(), cells.step, channels, refine ? 300 : 120);
  const int wanted =
      max_order > 0 ? max_order : static_cast<int>(std::clamp<Index>(2 * channels, 12, 32));
  const int most = std::min(
      {wanted, realization.max_order(), static_cast<int>(cells.shortest() * channels / 4)});
  check_that(most >= 1, "nothing moves");
  for (int n = 1; n <= most; ++n) {
    by_order.push_back(realization.poles(n));
    for (RealizedPole& pole :
         by_order.back()) {  // from units of the noise to those of the channels
      pole.shape = pole.shape.cwiseProduct(noise.cast<Complex>()).normalized();
    }
  }
  cells_ = cells.records;
  duration_ = cells.duration;
  poles_of_rest_ = [step = cells.step, channels](const std::vector<MatrixXd>& rest) {
    return rest_poles(rest, step, channels);
  };
  data = DecayData(cells_);
  data.rounding = rounding;
  rough_ = !refine;
  if (rough_) iterations_ = kRoughIterations;
  choose_order(cells.noise, false);
  if (!refine) return;
  improve();
  if (factor_width(fit.factors) > 2 * channels) try_products(cells.noise);
  try_drift();
  keep_repeated();

  const bool drifts = data.drifts();
  data = DecayData(all);
  data.rounding = rounding;
  data.set_drifts(drifts);
  if (all.size() > records.size()) {
    for (DecayFactor& factor : fit.factors) factor.scale.clear();
    larger.reset();
  }
  fit = fit_decays(data, fit.factors, fit.noise / cells.noise_factor(), 30);
  if (larger) larger = fit_decays(data, larger->factors, fit.noise, 30);
  if (larger && larger->criterion < fit.criterion) fit = std::move(*larger), larger.reset();
  forget_useless_larger();
  widen(all, noise);
}

ModelSearch::ModelSearch(const ExcitedCells& cells, const IdentifyOptions& options)
    : data(cells.records, cells.driven),
      stop_(options.stop),
      cells_(cells.records),
      duration_(cells.duration),
      most_added_(3),
      iterations_(60) {
  const int most = options.max_order > 0
                       ? options.max_order
                       : static_cast<int>(std::min<Index>(2 * data.channels + 16, 32));
  by_order = common_denominator_poles(cells.bridged, cells.step, most, cells.highest);
  for (std::vector<RealizedPole>& poles : by_order) {
    for (RealizedPole& pole : poles) {
      pole.shape = pole.shape.cwiseProduct(cells.noise.cast<Complex>()).normalized();
    }
  }
  poles_of_rest_ = [&cells](const std::vector<MatrixXd>& rest) {
    std::vector<MotionRecord> records = cells.bridged;
    for (std::size_t r = 0; r < records.size(); ++r) records[r].output = rest[r];
    return common_denominator_poles(records, cells.step, 2, cells.highest);
  };
  choose_order(cells.noise, false);
  improve();
  while (factor_width(fit.factors) < 2 * data.channels - 1 && split_one()) {
    while (drop_one()) continue;
  }
  // A model that none larger was compared with is not known to be large enough.
  for (int k = 0; k < 4 && !larger && add_from_rest(); ++k) {
    while (drop_one()) continue;
  }
  forget_useless_larger();
  scatter.resize(fit.factors.size());
  widen(cells.noise);
}

void ModelSearch::refine(const ExcitedCells& all) {
  data = DecayData(all.records, all.driven);
  fit = fit_decays(data, fit.factors, all.noise, iterations_);
  larger.reset();
  widen(all.noise);
}

/// Returns the criterion with a price of parameters that grows with the motion that no model
/// explains, because its squares are fewer independent numbers than samples (quasi-likelihood;
/// Lebreton et al. 1992).
double ModelSearch::score(const DecayFit& some) const {
  return some.criterion + (colour_ - 1) * parameter_penalty(some, data);
}

/// Each record with a slope of its own, as slow drift of the sensors, if that explains more.
void ModelSearch::try_drift() {
  const DecayFit before = fit;
  const std::optional<DecayFit> larger_before = larger;
  std::vector<DecayFactor> kept;
  for (const DecayFactor& factor : fit.factors) {
    const double slowest = factor.eigenvalues()[0].real() * duration_;
    if (factor.pair || slowest < -kDrifts) kept.push_back(factor);
  }
  if (kept.empty()) kept = fit.factors;
  data.set_drifts(true);
  fit = fit_decays(data, kept, before.noise, iterations_);
  if (score(fit) < score(before)) {
    larger.reset();
    while (drop_one()) continue;
    return;
  }
  data.set_drifts(false);
  fit = before;
  larger = larger_before;
}

void ModelSearch::improve() {
  for (int k = 0; k < most_added_ && add_from_rest(); ++k) continue;
  while (drop_one()) continue;
  untangle();
}

/// More eigenvalues than a linear arm of as many joints as channels has are products, if these
/// explain the records better.
void ModelSearch::try_products(const VectorXd& noise) {
  DecayFit plain = fit;
  std::optional<DecayFit> plain_larger = std::exchange(larger, std::nullopt);
  const int plain_order = order;
  choose_order(noise, true);
  improve();
  if (score(fit) < score(plain)) return;
  fit = std::move(plain);
  larger = std::move(plain_larger);
  order = plain_order;
}

/// Forgets a larger model that fits no better: nothing is learnt from it.
void ModelSearch::forget_useless_larger() {
  const double gained = larger ? larger->criterion - fit.criterion : 0;
  if (larger && (!larger->covariance.allFinite() ||
                 gained > parameter_penalty(*larger, data) - parameter_penalty(fit, data))) {
    larger.reset();
  }
}

void ModelSearch::choose_order(const VectorXd& noise, bool products) {
  std::vector<DecayFit> all(by_order.size());
  double least = std::numeric_limits<double>::infinity();
  int worse = 0;
  const auto orders = static_cast<double>(by_order.size());
  for (std::size_t n = 0; n < by_order.size() && worse < (rough_ ? 3 : 6); ++n) {
    if (std::isfinite(least) && !goes_on(0.5 * static_cast<double>(n) / orders)) break;
    if (n == plain_by_order_.size()) {
      const std::vector<DecayFactor> factors = factors_of(by_order[n], duration_);
      plain_by_order_.push_back(factors.empty() ? DecayFit{}
                                                : fit_decays(data, factors, noise, iterations_));
    }
    all[n] = plain_by_order_[n];
    if (all[n].factors.empty()) continue;  // no decay
    if (products) {
      DecayFit bent = with_products(data, all[n]);
      if (bent.criterion < all[n].criterion) all[n] = std::move(bent);
    }
    ++worse;
    if (all[n].criterion < least) least = all[n].criterion, worse = 0;
  }
  colour_ = std::numeric_limits<double>::infinity();
  for (const DecayFit& there : all) {
    if (!there.factors.empty()) colour_ = std::min(colour_, there.whiteness);
  }
  check_that(std::isfinite(colour_), "no decay is to be seen");
  least = std::numeric_limits<double>::infinity();
  for (std::size_t n = 0; n < all.size(); ++n) {
    if (all[n].factors.empty() || score(all[n]) >= least) continue;
    least = score(all[n]);
    fit = all[n];
    order = static_cast<int>(n) + 1;
  }
}

bool ModelSearch::change(const std::vector<DecayFactor>& factors) {
  // A larger model that is not worth it may still say something, if it fits better.
  const double before = fit.criterion - parameter_penalty(fit, data);
  DecayFit there = fit_decays(data, factors, fit.noise, iterations_, before + kDifference);
  if (score(there) < score(fit)) {
    fit = std::move(there);
    larger.reset();
    return true;
  }
  if (factors.size() > fit.factors.size() && (!larger || there.criterion < larger->criterion)) {
    larger = std::move(there);
  }
  return false;
}

std::vector<DecayFactor> ModelSearch::candidates() const {
  std::vector<MatrixXd> rest;
  for (const MotionRecord& record : cells_) {
    rest.emplace_back(MatrixXd::Zero(record.output.rows(), record.output.cols()));
  }
  const auto over = left_over(data, fit);
  for (std::size_t k = 0; k < over.size(); ++k) {
    for (std::size_t c = 0; c < data.parts[k].channels.size(); ++c) {
      const Index channel = data.parts[k].channels[c];
      Index at = 0;
      for (std::size_t r = 0; r < rest.size(); ++r) {
        for (Index i = 0; i < rest[r].cols(); ++i) {
          if (!std::isfinite(cells_[r].output(channel, i))) continue;
          rest[r](channel, i) = over[k](at++, static_cast<Index>(c)) / fit.noise[channel];
        }
      }
    }
  }
  std::vector<DecayFactor> result;
  for (const std::vector<RealizedPole>& poles : poles_of_rest_(rest)) {
    for (const DecayFactor& factor : factors_of(poles, duration_)) {
      const bool known = std::any_of(result.begin(), result.end(), [&](const DecayFactor& other) {
        const Complex a = factor.eigenvalues()[0], b = other.eigenvalues()[0];
        return factor.pair == other.pair && std::abs(a - b) < 0.1 * std::abs(a);
      });
      if (!known) result.push_back(factor);
    }
  }
  return result;
}

bool ModelSearch::add_from_rest() {
  for (const DecayFactor& factor : candidates()) {
    if (!goes_on(0.6)) return false;
    std::vector<DecayFactor> factors = fit.factors;
    factors.push_back(factor);
    if (change(factors)) return true;
  }
  return false;
}

/// Two heavily damped modes near each other look like one, and what is left over does not show it.
bool ModelSearch::split_one() {
  constexpr double kApart = 0.15, kDamped = 0.3;
  for (std::size_t k = 0; k < fit.factors.size(); ++k) {
    if (!fit.factors[k].pair || fit.factors[k].second < kDamped) continue;
    if (!goes_on(0.7)) return false;
    std::vector<DecayFactor> factors = fit.factors;
    factors[k].scale.clear();
    factors.push_back(factors[k]);
    factors[k].first -= kApart;
    factors.back().first += kApart;
    if (change(factors)) return true;
  }
  return false;
}

bool ModelSearch::drop_one() {
  Index at = 0;
  for (std::size_t k = 0; k < fit.factors.size() && fit.factors.size() > 1; ++k) {
    if (!goes_on(0.8)) return false;
    const Index first = at;
    at += fit.factors[k].parameters();
    const double size = fit.factors[k].pair ? 1 : std::abs(fit.factors[k].first);
    if (std::sqrt(fit.covariance(first, first)) < 0.02 * size) continue;  // it is there
    std::vector<DecayFactor> factors = fit.factors;
    factors.erase(factors.begin() + static_cast<std::ptrdiff_t>(k));
    if (change(factors)) return true;
    if (!fit.factors[k].pair) continue;
    // A pair of real eigenvalues of which the data show one.
    const auto lambda = fit.factors[k].eigenvalues();
    if (lambda[0].imag() != 0) continue;
    for (const Complex& one : lambda) {
      factors = fit.factors;
      factors[k] = fit.factors[k].one_of_pair(one.real());
      if (change(factors)) return true;
    }
  }
  return false;
}

/// Factors that cancel against each other are where a search got lost: begins again without them.
void ModelSearch::untangle() {
  constexpr double kCancels = 30;
  std::vector<DecayFactor> kept;
  double all = 0;
  for (const DecayPart& part : data.parts) {
    for (std::size_t c = 0; c < part.channels.size(); ++c) {
      all += static_cast<double>(samples_of(part)) *
             std::pow(data.motion[part.channels[c]] / fit.noise[part.channels[c]], 2);
    }
  }
  for (std::size_t k = 0; k < fit.factors.size(); ++k) {
    if (energy_of(data, fit, k) < kCancels * all) kept.push_back(fit.factors[k]);
  }
  if (kept.size() == fit.factors.size() || kept.empty()) return;
  auto before = std::pair(fit, larger);
  fit = fit_decays(data, kept, fit.noise, 40);
  for (int k = 0; k < 4 && add_from_rest(); ++k) continue;
  while (drop_one()) continue;
  if (!(score(fit) < score(before.first))) std::tie(fit, larger) = std::move(before);
}

}  // namespace dashpot::identification
