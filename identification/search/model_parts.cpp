// Compares parts of the records with the model of the whole, and says how sure that is.
#include <dashpot/identification/search/model_search.hpp>

#include <Eigen/SVD>
#include <algorithm>
#include <array>
#include <cmath>
#include <utility>

namespace dashpot::identification {
namespace {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

/// Parts that are stretches of time, as shares of a record.
constexpr std::array<std::pair<double, double>, 3> kWindows = {
    std::pair(0.0, 0.5), {0.1, 1.0}, {0.25, 1.0}};
constexpr double kColoured = 2;    ///< whiteness above which copies of modes are doubted
constexpr double kWeak = 0.05;     ///< energy, of the strongest: its deviation says enough
constexpr double kCopies = 0.15;   ///< of the logarithm of a frequency
constexpr double kAlike = 0.8;     ///< modal assurance criterion
constexpr double kDeviations = 3;  ///< by which an estimate may be off by chance
/// A part says nothing of a frequency (relative) or ratio with a larger deviation,
constexpr double kVague = 0.05;
/// and does not have a factor that differs by more, unless its deviation explains it.
constexpr double kSame = 0.05, kSameRatio = 0.15;

/// The geometric mean over the records in which a channel moves, as a fit's noise is one; `noise`
/// of all of them where it moves in none alone.
VectorXd usual_noise(const std::vector<MotionRecord>& all, const VectorXd& noise,
                     const VectorXd& motion) {
  constexpr double kAtRest = 1e-9;  // less than this of the motion are digits of a channel at rest
  VectorXd sum = VectorXd::Zero(noise.size()), count = sum;
  for (const MotionRecord& record : all) {
    const VectorXd alone = first_noise({record});
    for (Index c = 0; c < alone.size(); ++c) {
      if (alone[c] > kAtRest * motion[c]) sum[c] += std::log(alone[c]), ++count[c];
    }
  }
  const VectorXd mean = sum.cwiseQuotient(count.cwiseMax(1)).array().exp();
  return (count.array() > 0).select(mean, noise);
}

}  // namespace

/// By how much a model's factors differ in parts of the records: in their beginnings, their ends,
/// and each of several records.
std::vector<DecayStep> ModelSearch::steps_of_parts(const DecayFit& whole) const {
  std::vector<DecayStep> steps;
  const auto add = [&](const std::vector<MotionRecord>& records,
                       const std::vector<DecayFactor>& there) {
    DecayData part(records);
    part.set_drifts(data.drifts());
    steps.push_back(step_of(part, there, whole.noise));
  };
  for (const auto& [from, to] : kWindows) {
    std::vector<MotionRecord> records;
    for (const MotionRecord& cells : cells_) {
      const auto size = static_cast<double>(cells.time.size());
      const auto first = static_cast<Index>(from * size), last = static_cast<Index>(to * size);
      records.push_back(part_of(cells, first, std::max(last, first + 1)));
    }
    add(records, whole.factors);
  }
  for (std::size_t r = 0; cells_.size() > 1 && r < cells_.size(); ++r) {
    std::vector<DecayFactor> alone = whole.factors;
    for (DecayFactor& factor : alone) factor.scale.assign(1, {1, 0}), factor.reference = 0;
    add({cells_[r]}, alone);
  }
  return steps;
}

/// The factor that parts of the records contradict most; none: the number of factors. `shown` gets
/// the variances by which the parts differ beyond their own deviations.
std::size_t ModelSearch::contradicted(const DecayFit& whole,
                                      std::vector<std::array<double, 2>>& shown) const {
  const std::vector<DecayStep> parts = steps_of_parts(whole);
  shown.assign(whole.factors.size(), {});
  // Where what is left over is no noise, no difference comes by chance.
  const double chance = whole.whiteness > kColoured ? 0 : kDeviations * kDeviations;
  std::size_t worst = whole.factors.size();
  double most = 1, strongest = 0;
  std::vector<double> energy;
  for (std::size_t k = 0; k < whole.factors.size(); ++k) {
    energy.push_back(energy_of(data, whole, k));
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
      if (count > 1 && chi > count - 1 + 3 * std::sqrt(2 * (count - 1))) {
        variance += excess / weights * size * size;
      }
    }
  }
  return worst;
}

/// Prefers a model that all parts of the records have over a larger one that explains the whole
/// better: motion that is not linear looks like many modes, and each part has others. If there is
/// none, removes the factors that the parts contradict, one after the other.
void ModelSearch::keep_repeated() {
  // Motion that no model explains is not noise, and looks like a mode near another one.
  const bool copied =
      std::max(colour_, fit.whiteness) > kColoured && copy_in(fit) < fit.factors.size();
  if (contradicted(fit, scatter) == fit.factors.size() && !copied) {
    if (fit.whiteness > kColoured) add_spread_of_orders();
    return;
  }
  differs = true;
  const DecayFit before = fit;
  larger.reset();
  std::vector<const DecayFit*> models;
  for (const DecayFit& model : plain_by_order_) {
    if (!model.factors.empty() && model.factors.size() < before.factors.size() &&
        std::isfinite(model.criterion)) {
      models.push_back(&model);
    }
  }
  std::sort(models.begin(), models.end(),
            [this](const DecayFit* a, const DecayFit* b) { return score(*a) < score(*b); });
  for (const DecayFit* model : models) {
    fit = data.drifts() ? fit_decays(data, model->factors, model->noise, iterations_) : *model;
    if (copy_in(fit) == fit.factors.size() && contradicted(fit, scatter) == fit.factors.size())
      break;
    fit = before;
  }
  for (;;) {
    std::size_t worst = contradicted(fit, scatter);
    if (worst == fit.factors.size()) worst = copy_in(fit);
    if (worst == fit.factors.size() || fit.factors.size() < 2) break;
    drop(worst);
  }
  for (const DecayFactor& factor : before.factors) {
    const bool kept = std::any_of(fit.factors.begin(), fit.factors.end(), [&](const auto& other) {
      const Complex a = factor.eigenvalues()[0], b = other.eigenvalues()[0];
      return std::abs(a - b) < kSame * std::abs(a);
    });
    if (!kept) not_repeated.push_back(factor);
  }
  add_spread_of_orders();
}

void ModelSearch::drop(std::size_t factor) {
  std::vector<DecayFactor> factors = fit.factors;
  factors.erase(factors.begin() + static_cast<std::ptrdiff_t>(factor));
  fit = fit_decays(data, factors, fit.noise, iterations_);
  larger.reset();
}

/// The weaker of two factors that are one motion which is not linear: near each other, with like
/// shapes.
/// None: the number of factors.
std::size_t ModelSearch::copy_in(const DecayFit& whole) const {
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

/// Where parts differ, or what is left over is no noise, models of other orders differ, too: how
/// they do is part of the deviations.
void ModelSearch::add_spread_of_orders() {
  for (std::size_t k = 0; k < fit.factors.size(); ++k) {
    if (!fit.factors[k].pair) continue;
    std::array<double, 2> sum{};
    double count = 0;
    for (const DecayFit& model : plain_by_order_) {
      const DecayFactor* nearest = nullptr;
      double least = kCopies;
      for (const DecayFactor& factor : model.factors) {
        const double distance = std::abs(factor.first - fit.factors[k].first);
        if (factor.pair && distance < least) least = distance, nearest = &factor;
      }
      if (nearest == nullptr) continue;
      sum[0] += std::pow(nearest->first - fit.factors[k].first, 2);
      sum[1] += std::pow(nearest->second - fit.factors[k].second, 2);
      ++count;
    }
    for (std::size_t i : {0U, 1U}) scatter[k][i] += count > 0 ? sum[i] / count : 0;
  }
}

/// Widens by the noise of the records themselves.
void ModelSearch::widen(const std::vector<MotionRecord>& all, const VectorXd& noise) {
  widen(usual_noise(all, noise, data.motion).cwiseMax(DecayData::kLinear * data.motion));
}

/// Widens the deviations by what the likelihood does not know: that an arm is not quite linear. One
/// record of a decay does not show it, where several differ (measured on arms of another engine:
/// docs/identify.md); and where more is left over than sensors make, it is in the way of all modes.
void ModelSearch::widen(const VectorXd& sensors) {
  constexpr double kAlone = 1.4;
  const double rest = std::max(1.0, fit.noise.cwiseQuotient(sensors).maxCoeff());
  fit.covariance *= rest * (data.sources() == 1 ? kAlone * kAlone : 1);
}

}  // namespace dashpot::identification
