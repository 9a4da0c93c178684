#include <dashpot/analysis/identification/model_search.hpp>

#include <algorithm>
#include <cmath>
#include <stdexcept>
#include <string>

namespace dashpot::analysis {
namespace {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

void require(bool condition, const std::string& message) {
  if (!condition) throw std::invalid_argument("identify: " + message);
}

/// Those that a record of this length (s) can tell from a constant, as factors.
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

double sample_count(const DecayData& data) {
  double count = 0;
  for (const DecayPart& part : data.parts) count += static_cast<double>(part.output.size());
  return count;
}

}  // namespace

ModelSearch::ModelSearch(const std::vector<MotionRecord>& records, int max_order, bool refine)
    : data(records) {
  const VectorXd noise = first_noise(records);
  const DecayCells cells(records, noise);
  const Index channels = data.channels;
  const Realization realization(cells.weighted(), cells.step, channels, 300);
  const int wanted =
      max_order > 0 ? max_order : static_cast<int>(std::clamp<Index>(2 * channels, 12, 32));
  const int most = std::min(
      {wanted, realization.max_order(), static_cast<int>(cells.shortest() * channels / 4)});
  require(most >= 1, "nothing moves");
  for (int n = 1; n <= most; ++n) {
    by_order.push_back(realization.poles(n));
    for (RealizedPole& pole :
         by_order.back()) {  // from units of the noise to those of the channels
      pole.shape = pole.shape.cwiseProduct(noise.cast<Complex>()).normalized();
    }
  }
  data = DecayData(cells.records);
  choose_order(cells);
  if (!refine) return;
  for (int k = 0; k < 6 && add_from_rest(cells); ++k) continue;
  while (drop_one()) continue;
  untangle(cells);

  data = DecayData(records);
  fit = fit_decays(data, fit.factors, fit.noise / cells.noise_factor(), 30);
  if (larger) larger = fit_decays(data, larger->factors, fit.noise, 30);
  if (larger && larger->criterion < fit.criterion) fit = std::move(*larger), larger.reset();
  // Of one that fits no better nothing is learnt.
  const double gained = larger ? larger->criterion - fit.criterion : 0;
  if (larger && (!larger->covariance.allFinite() ||
                 gained > parameter_penalty(*larger, data) - parameter_penalty(fit, data))) {
    larger.reset();
  }
}

void ModelSearch::choose_order(const DecayCells& cells) {
  std::optional<DecayFit> best;
  int worse = 0;
  for (std::size_t n = 0; n < by_order.size() && worse < 6; ++n) {
    const std::vector<DecayFactor> factors = factors_of(by_order[n], cells.duration);
    if (factors.empty()) continue;
    DecayFit there = fit_decays(data, factors, cells.noise, 12);
    ++worse;
    if (best && there.criterion >= best->criterion) continue;
    best = std::move(there);
    order = static_cast<int>(n) + 1;
    worse = 0;
  }
  require(best.has_value(), "no decay is to be seen");
  fit = std::move(*best);
}

bool ModelSearch::change(const std::vector<DecayFactor>& factors) {
  // In units of its own noise the present model leaves over one for each sample.
  const double samples = sample_count(data);
  const double width = 40 * static_cast<double>(data.channels * fit.amplitudes.rows());
  DecayFit there = fit_decays(data, factors, fit.noise, 40, samples + width);
  if (there.criterion < fit.criterion) {
    fit = std::move(there);
    larger.reset();
    return true;
  }
  if (factors.size() > fit.factors.size() && (!larger || there.criterion < larger->criterion)) {
    larger = std::move(there);
  }
  return false;
}

/// What is left over, of the whole and of the beginning, where fast decays are, has these.
std::vector<DecayFactor> ModelSearch::candidates(const DecayCells& cells) const {
  std::vector<MatrixXd> rest;
  for (const MotionRecord& record : cells.records) {
    rest.emplace_back(MatrixXd::Zero(record.output.rows(), record.output.cols()));
  }
  const auto over = left_over(data, fit);
  for (std::size_t k = 0; k < over.size(); ++k) {
    for (std::size_t c = 0; c < data.parts[k].channels.size(); ++c) {
      const Index channel = data.parts[k].channels[c];
      Index at = 0;
      for (std::size_t r = 0; r < rest.size(); ++r) {
        for (Index i = 0; i < rest[r].cols(); ++i) {
          if (!std::isfinite(cells.records[r].output(channel, i))) continue;
          rest[r](channel, i) = over[k](at++, static_cast<Index>(c)) / fit.noise[channel];
        }
      }
    }
  }
  std::vector<DecayFactor> result;
  for (const Index part : {1, 8}) {
    std::vector<MatrixXd> beginning;
    for (const MatrixXd& record : rest) {
      const Index columns = record.cols() / part;
      if (columns >= 10) beginning.emplace_back(record.leftCols(columns));
    }
    if (beginning.empty()) continue;
    const Realization realization(beginning, cells.step, data.channels, 100);
    for (int n = 1; n <= std::min(2, realization.max_order()); ++n) {
      for (const DecayFactor& factor : factors_of(realization.poles(n), cells.duration)) {
        const bool known = std::any_of(result.begin(), result.end(), [&](const DecayFactor& other) {
          const Complex a = factor.eigenvalues()[0], b = other.eigenvalues()[0];
          return factor.pair == other.pair && std::abs(a - b) < 0.1 * std::abs(a);
        });
        if (!known) result.push_back(factor);
      }
    }
  }
  return result;
}

bool ModelSearch::add_from_rest(const DecayCells& cells) {
  for (const DecayFactor& factor : candidates(cells)) {
    std::vector<DecayFactor> factors = fit.factors;
    factors.push_back(factor);
    if (change(factors)) return true;
  }
  return false;
}

bool ModelSearch::drop_one() {
  Index at = 0;
  for (std::size_t k = 0; k < fit.factors.size() && fit.factors.size() > 1; ++k) {
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
      factors[k] = DecayFactor::of_single(one.real());
      if (change(factors)) return true;
    }
  }
  return false;
}

/// Factors that cancel against each other are where a search got lost: begins again without them.
void ModelSearch::untangle(const DecayCells& cells) {
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
    double energy = 0;
    const std::vector<MatrixXd> motion = factor_motion(data, fit, k);
    for (std::size_t i = 0; i < motion.size(); ++i) {
      const auto& channels = data.parts[i].channels;
      for (std::size_t c = 0; c < channels.size(); ++c) {
        energy += motion[i].col(static_cast<Index>(c)).squaredNorm() /
                  std::pow(fit.noise[channels[c]], 2);
      }
    }
    if (energy < kCancels * all) kept.push_back(fit.factors[k]);
  }
  if (kept.size() == fit.factors.size() || kept.empty()) return;
  DecayFit before = fit;
  std::optional<DecayFit> larger_before = larger;
  fit = fit_decays(data, kept, before.noise, 40);
  for (int k = 0; k < 8 && add_from_rest(cells); ++k) continue;
  while (drop_one()) continue;
  if (fit.criterion < before.criterion) return;
  fit = std::move(before);
  larger = std::move(larger_before);
}

}  // namespace dashpot::analysis
