// Compares parts of the records with the model of the whole, with deviations.
#include <dashpot/identification/records/common.hpp>
#include <dashpot/identification/records/decay_cells.hpp>
#include <dashpot/identification/search/model_parts.hpp>

#include <Eigen/SVD>
#include <algorithm>
#include <array>
#include <cmath>
#include <utility>

namespace dashpot::identification {
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
