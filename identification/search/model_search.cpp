#include <dashpot/identification/model/decay_columns.hpp>
#include <dashpot/identification/records/common.hpp>
#include <dashpot/identification/records/decay_cells.hpp>
#include <dashpot/identification/search/model_search.hpp>

#include <algorithm>
#include <cmath>
#include <limits>
#include <utility>

namespace dashpot::identification {
namespace {

constexpr SearchLimits kOfDecays{.rows = 300, .worse = 6, .iterations = 30, .added = 6};
/// For models of rising order in a first estimate, to which nothing is added.
constexpr SearchLimits kRough{.rows = 120, .worse = 3, .iterations = 4, .added = 0};
/// A model of too small an order that has not settled loses to one of too large an order, whose
/// surplus modes cancel. Decays that have cancel further with more; chirps need 60 iterations.
constexpr SearchLimits kDriven{.rows = 0, .worse = 6, .iterations = 60, .added = 3};
constexpr int kProductIterations = 12;  ///< from a start that is nearly right
constexpr int kLastIterations = 30;     ///< on the samples as they are
constexpr Index kSearchCells = 3000;
constexpr std::size_t kMostSearched = 8;  ///< records
constexpr std::size_t kWithProducts = 2;  ///< oscillations, of which the strongest products are
/// In lengths of the record: a slower single decay counts as drift, if drift explains as much.
constexpr double kDrifts = 3;
/// Orders: of decays two for each channel, within these; with inputs so many more, at most; and of
/// decays at most so many for each cell and channel.
constexpr Index kLeastOrder = 12, kMostOrder = 32, kOrdersOfInputs = 16, kCellsOfOrder = 4;
constexpr int kOrdersOfRest = 2;  ///< the residual is searched for one motion at a time
constexpr Index kBeginning = 8;   ///< part of the records, where fast decays are
constexpr Index kRowsOfRest = 100, kColumnsOfRest = 10;  ///< of its Hankel matrix, most, and least
constexpr int kSearchedOn = 4;       ///< factors more, for a model that is larger
constexpr double kOrdersDone = 0.5;  ///< share of the search that is done then, for progress

/// Poles of the residual, of the whole and of the beginning, where fast decays are.
std::vector<std::vector<RealizedPole>> rest_poles(const std::vector<MatrixXd>& rest, double step,
                                                  Index channels) {
  std::vector<std::vector<RealizedPole>> result;
  for (const Index part : {Index{1}, kBeginning}) {
    std::vector<MatrixXd> beginning;
    for (const MatrixXd& record : rest) {
      const Index columns = record.cols() / part;
      if (columns >= kColumnsOfRest) beginning.emplace_back(record.leftCols(columns));
    }
    if (beginning.empty()) continue;
    const Realization realization(beginning, step, channels, kRowsOfRest);
    for (int n = 1; n <= std::min(kOrdersOfRest, realization.max_order()); ++n) {
      result.push_back(realization.poles(n));
    }
  }
  return result;
}

/// Converts poles with their shapes from units of the noise to units of the channels.
std::vector<RealizedPole> in_units_of(const VectorXd& noise, std::vector<RealizedPole> poles) {
  for (RealizedPole& pole : poles) {
    pole.shape = pole.shape.cwiseProduct(noise.cast<Complex>()).normalized();
  }
  return poles;
}

/// Adds the products of the strongest oscillations to a fit: an arm that moves far is not linear,
/// and these products would be taken for modes.
DecayFit with_products(const DecayData& data, const DecayFit& plain) {
  std::vector<std::pair<double, std::size_t>> strongest;
  for (std::size_t k = 0; k < plain.factors.size(); ++k) {
    if (plain.factors[k].eigenvalues()[0].imag() == 0) continue;
    strongest.emplace_back(energy_of(data, plain, k), k);
  }
  std::sort(strongest.rbegin(), strongest.rend());
  std::vector<DecayFactor> factors = plain.factors;
  for (std::size_t i = 0; i < std::min(kWithProducts, strongest.size()); ++i) {
    factors[strongest[i].second].has_products = true;
  }
  return fit_decays(data, factors, plain.noise, kProductIterations);
}

/// The search is among the records that move most: more records do not show more modes.
std::vector<MotionRecord> strongest(const std::vector<MotionRecord>& records,
                                    const VectorXd& noise) {
  if (records.size() <= kMostSearched) return records;
  std::vector<std::pair<double, std::size_t>> motion;
  for (std::size_t r = 0; r < records.size(); ++r) {
    const DecayData alone({records[r]});
    motion.emplace_back(-alone.motion.cwiseQuotient(noise).squaredNorm(), r);
  }
  std::sort(motion.begin(), motion.end());
  std::vector<MotionRecord> chosen;
  for (std::size_t i = 0; i < kMostSearched; ++i) chosen.push_back(records[motion[i].second]);
  return chosen;
}

/// Fits models of rising order, plain ones once, and takes the best one.
void choose_order(Search& search, const VectorXd& noise, bool products) {
  FoundModel& found = search.found;
  std::vector<DecayFit> all(found.by_order.size());
  double least = std::numeric_limits<double>::infinity();
  int worse = 0;
  const auto orders = static_cast<double>(all.size());
  for (std::size_t n = 0; n < all.size() && worse < search.limits.worse; ++n) {
    if (std::isfinite(least) && !search.goes_on(kOrdersDone * static_cast<double>(n) / orders))
      break;
    if (n == search.plain_by_order.size()) {
      const std::vector<DecayFactor> factors = factors_of(found.by_order[n], search.duration);
      search.plain_by_order.push_back(
          factors.empty() ? DecayFit{}
                          : fit_decays(found.data, factors, noise, search.limits.iterations));
    }
    all[n] = search.plain_by_order[n];
    if (all[n].factors.empty()) continue;  // no decay
    if (products) {
      DecayFit bent = with_products(found.data, all[n]);
      if (bent.criterion < all[n].criterion) all[n] = std::move(bent);
    }
    ++worse;
    if (all[n].criterion < least) least = all[n].criterion, worse = 0;
  }
  search.colour = std::numeric_limits<double>::infinity();
  for (const DecayFit& there : all) {
    if (!there.factors.empty()) search.colour = std::min(search.colour, there.whiteness);
  }
  check_that(std::isfinite(search.colour), "no decay is to be seen");
  least = std::numeric_limits<double>::infinity();
  for (std::size_t n = 0; n < all.size(); ++n) {
    if (all[n].factors.empty() || search.score(all[n]) >= least) continue;
    least = search.score(all[n]);
    found.fit = all[n];
    found.order = static_cast<int>(n) + 1;
  }
}

/// More eigenvalues than a linear arm of as many joints as channels has are products, if these
/// explain the records better.
void try_products(Search& search, const VectorXd& noise) {
  FoundModel plain = search.found;
  search.found.larger.reset();
  choose_order(search, noise, true);
  improve(search);
  if (!(search.score(search.found.fit) < search.score(plain.fit))) search.found = std::move(plain);
}

/// Each record with a slope of its own, as slow drift of the sensors, if that explains more.
void try_drift(Search& search) {
  FoundModel& found = search.found;
  FoundModel before = found;
  std::vector<DecayFactor> kept;
  for (const DecayFactor& factor : found.fit.factors) {
    const double slowest = factor.eigenvalues()[0].real() * search.duration;
    if (factor.pair || slowest < -kDrifts) kept.push_back(factor);
  }
  if (kept.empty()) kept = found.fit.factors;
  found.data.set_drifts(true);
  found.fit = fit_decays(found.data, kept, before.fit.noise, search.limits.iterations);
  if (search.score(found.fit) < search.score(before.fit)) {
    found.larger.reset();
    drop_useless(search);
  } else {
    found = std::move(before);
  }
}

/// Forgets a larger model that fits no better.
void forget_useless_larger(FoundModel& found) {
  if (!found.larger) return;
  const double gained = found.larger->criterion - found.fit.criterion;
  if (!found.larger->covariance.allFinite() ||
      gained >
          parameter_penalty(*found.larger, found.data) - parameter_penalty(found.fit, found.data)) {
    found.larger.reset();
  }
}

/// Refines the model of the cells of some records on the samples of all, as they are.
void refine_on_samples(FoundModel& found, DecayData samples, const DecayCells& cells) {
  samples.rounding = found.data.rounding;
  samples.set_drifts(found.data.drifts());
  found.data = std::move(samples);
  if (found.data.records > cells.records.size()) {
    for (DecayFactor& factor : found.fit.factors) factor.scale.clear();
    found.larger.reset();
  }
  DecayFit& fit = found.fit;
  std::optional<DecayFit>& larger = found.larger;
  fit = fit_decays(found.data, fit.factors, fit.noise / cells.noise_factor(), kLastIterations);
  if (larger) larger = fit_decays(found.data, larger->factors, fit.noise, kLastIterations);
  if (larger && larger->criterion < fit.criterion) fit = std::move(*larger), larger.reset();
  forget_useless_larger(found);
}

}  // namespace

FoundModel find_model(const std::vector<MotionRecord>& all, const IdentifyOptions& options) {
  DecayData samples(all);
  VectorXd rounding;
  const VectorXd noise = first_noise(all, &rounding);
  const std::vector<MotionRecord> records = strongest(all, noise);
  const DecayCells cells(records, noise, noise.cwiseMax(DecayData::kLinear * samples.motion),
                         options.refine ? kSearchCells : 0);
  const Index channels = samples.channels;
  Search search{.cells = cells.records,
                .duration = cells.duration,
                .limits = options.refine ? kOfDecays : kRough,
                .poles_of_rest =
                    [step = cells.step, channels](const std::vector<MatrixXd>& rest) {
                      return rest_poles(rest, step, channels);
                    },
                .stop = options.stop,
                .found = {.data = DecayData(cells.records)}};
  search.found.data.rounding = rounding;
  const Realization realization(cells.weighted(), cells.step, channels, search.limits.rows);
  const int wanted =
      options.max_order > 0
          ? options.max_order
          : static_cast<int>(std::clamp<Index>(2 * channels, kLeastOrder, kMostOrder));
  const int most = std::min({wanted, realization.max_order(),
                             static_cast<int>(cells.shortest() * channels / kCellsOfOrder)});
  check_that(most >= 1, "nothing moves");
  for (int n = 1; n <= most; ++n) {
    search.found.by_order.push_back(in_units_of(noise, realization.poles(n)));
  }
  choose_order(search, cells.noise, false);
  if (!options.refine) return std::move(search.found);
  improve(search);
  if (factor_width(search.found.fit.factors) > 2 * channels) try_products(search, cells.noise);
  try_drift(search);
  keep_repeated(search);
  refine_on_samples(search.found, std::move(samples), cells);
  widen(search.found, usual_noise(all, noise, search.found.data.motion));
  return std::move(search.found);
}

FoundModel find_model(const ExcitedCells& cells, const IdentifyOptions& options) {
  Search search{.cells = cells.records,
                .duration = cells.duration,
                .limits = kDriven,
                .poles_of_rest =
                    [&cells](const std::vector<MatrixXd>& rest) {
                      std::vector<MotionRecord> records = cells.bridged;
                      for (std::size_t r = 0; r < records.size(); ++r) records[r].output = rest[r];
                      return common_denominator_poles(records, cells.step, kOrdersOfRest,
                                                      cells.highest);
                    },
                .stop = options.stop,
                .found = {.data = DecayData(cells.records, cells.driven)}};
  FoundModel& found = search.found;
  const Index channels = found.data.channels;
  const int most =
      options.max_order > 0
          ? options.max_order
          : static_cast<int>(std::min<Index>(2 * channels + kOrdersOfInputs, kMostOrder));
  for (auto& poles : common_denominator_poles(cells.bridged, cells.step, most, cells.highest)) {
    found.by_order.push_back(in_units_of(cells.noise, std::move(poles)));
  }
  choose_order(search, cells.noise, false);
  improve(search);
  while (factor_width(found.fit.factors) < 2 * channels - 1 && split_one(search)) {
    drop_useless(search);
  }
  // A model is only known to be large enough beside a larger one.
  for (int k = 0; k < kSearchedOn && !found.larger && add_from_rest(search); ++k) {
    drop_useless(search);
  }
  forget_useless_larger(found);
  found.scatter.resize(found.fit.factors.size());
  widen(found, cells.noise);
  return std::move(found);
}

void refine(const ExcitedCells& all, FoundModel& found) {
  found.data = DecayData(all.records, all.driven);
  found.fit = fit_decays(found.data, found.fit.factors, all.noise, kDriven.iterations);
  found.larger.reset();
  widen(found, all.noise);
}

}  // namespace dashpot::identification
