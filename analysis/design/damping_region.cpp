#include <dashpot/analysis/damping_design.hpp>
#include <dashpot/analysis/damping_region.hpp>
#include <dashpot/analysis/spectrum.hpp>

#include <algorithm>
#include <cmath>
#include <limits>
#include <stdexcept>
#include <utility>

namespace dashpot::analysis {
namespace {

using Eigen::MatrixXd;

constexpr double kLevelStep = 5e-4;
/// A configuration that misses the level by less need not join the search.
constexpr double kLevelMissed = 2e-4;
/// A search that comes as near as this to its goal has reached it.
constexpr double kMet = 1e-7;
/// Configurations whose exact design is tried, about; and how often one is scaled down.
constexpr std::size_t kStarts = 8;
constexpr int kScalings = 12;
/// Configurations that a search begins with, that join it at a time, and how often some may join.
constexpr std::size_t kFirst = 32;
constexpr std::size_t kJoining = 8;
constexpr int kRounds = 40;

std::vector<DampingSample> samples_of(const std::vector<TaskImpedance>& configurations,
                                      int threads) {
  std::vector<DampingSample> samples(configurations.size());
  for_each_in_parallel(samples.size(), threads,
                       [&](std::size_t i) { samples[i] = damping_sample(configurations[i]); });
  return samples;
}

double ceiling_of(const RegionOptions& options) {
  const double wanted = std::max(options.target.low_ratio, options.target.high_ratio);
  const double ceiling = options.ceiling.value_or(std::max(1.0, 1.5 * wanted));
  if (!(ceiling >= wanted)) {
    throw std::invalid_argument("damping: the largest ratio allowed is below the one wanted");
  }
  return ceiling;
}

RegionSample read(const Spectrum<>& spectrum, const DampingTarget& target) {
  RegionSample result;
  const double fastest = spectrum.modes.empty() ? 0 : spectrum.modes[0].natural_frequency;
  const double soft = target.soft_limit(fastest);
  double least = std::numeric_limits<double>::infinity();
  for (int i = 0; i < spectrum.modes.size(); ++i) {
    const Mode<>& mode = spectrum.modes[i];
    if (!(mode.natural_frequency >= soft)) {
      ++result.soft_modes;
      continue;
    }
    result.largest_ratio = std::max(result.largest_ratio, mode.damping_ratio);
    const double wanted = target.ratio(mode.natural_frequency);
    const double level = wanted > 0 ? mode.damping_ratio / wanted : 1;
    if (level < least) {
      least = level;
      result.worst_mode = i;
      result.natural_frequency = mode.natural_frequency;
      result.damping_ratio = mode.damping_ratio;
      result.wanted = wanted;
    }
  }
  return result;
}

/// Smallest ratio relative to its target; 1 where none counts.
double level_of(const RegionSample& sample) {
  return sample.worst_mode < 0 || !(sample.wanted > 0) ? 1 : sample.damping_ratio / sample.wanted;
}

double largest_ratio(const RegionDesign& design) {
  double largest = 0;
  for (const RegionSample& sample : design.samples) {
    largest = std::max(largest, sample.largest_ratio);
  }
  return largest;
}

RegionDesign evaluate(const std::vector<DampingSample>& samples, const DampingFit& fit,
                      const MatrixXd& damping, const RegionOptions& options) {
  RegionDesign design;
  design.damping = damping;
  design.samples.resize(samples.size());
  for_each_in_parallel(samples.size(), options.threads, [&](std::size_t i) {
    System<> system = samples[i].system;
    const MatrixXd C = samples[i].map * damping * samples[i].map.transpose();
    system.damping += 0.5 * (C + C.transpose());
    system.has_low_words = false;
    design.samples[i] = read(analyze(system), options.target);
  });
  double smallest = std::numeric_limits<double>::infinity();
  for (std::size_t i = 0; i < samples.size(); ++i) {
    const RegionSample& sample = design.samples[i];
    if (sample.worst_mode < 0 || !(sample.wanted > 0)) continue;
    if (level_of(sample) < smallest) {
      smallest = level_of(sample);
      design.worst_sample = static_cast<int>(i);
    }
  }
  design.level = std::min(1.0, smallest);
  design.violation =
      std::max({0.0, largest_ratio(design) - ceiling_of(options), fit.excess(damping)});
  return design;
}

/// Starts of the search: the exact designs of some configurations, and the mean of all.
std::vector<MatrixXd> starts_of(const std::vector<TaskImpedance>& configurations,
                                const RegionOptions& options) {
  std::vector<MatrixXd> all(configurations.size());
  for_each_in_parallel(all.size(), options.threads, [&](std::size_t i) {
    all[i] = design_damping(configurations[i], options.target).damping;
  });
  MatrixXd sum = all.front();
  for (std::size_t i = 1; i < all.size(); ++i) sum += all[i];
  std::vector<MatrixXd> starts = {sum / static_cast<double>(all.size())};
  const std::size_t step = (all.size() + kStarts - 1) / kStarts;
  for (std::size_t i = 0; i < all.size(); i += step) starts.push_back(all[i]);
  return starts;
}

/// A damping matrix that is allowed, and what it reaches.
struct Candidate {
  MatrixXd damping;
  double level = -1;  // none yet
};

/// Keeps the better one of `best` and `damping`, the latter scaled down until it is allowed.
void offer(MatrixXd damping, const std::vector<DampingSample>& samples, const DampingFit& fit,
           const RegionOptions& options, Candidate& best) {
  damping = fit.within_structure(damping);
  const double ceiling = ceiling_of(options);
  for (int k = 0; k < kScalings; ++k) {
    const RegionDesign design = evaluate(samples, fit, damping, options);
    if (design.violation <= kMet) {
      if (design.level > best.level) best = {damping, design.level};
      return;
    }
    damping *= std::min(0.9, ceiling / largest_ratio(design));
  }
}

/// Seeks the largest level of all these configurations, at most `high`, from starts of its own and
/// the one given (no entries: none).
Candidate search_level(const std::vector<TaskImpedance>& configurations, const MatrixXd& given,
                       double high, const RegionOptions& options,
                       const std::function<void(double)>& tell) {
  const double ceiling = ceiling_of(options);
  const std::vector<DampingSample> samples = samples_of(configurations, options.threads);
  const DampingFit fit(samples, options.structure, options.bounds, options.threads);
  std::vector<MatrixXd> starts = starts_of(configurations, options);
  if (given.size() > 0) starts.insert(starts.begin(), given);
  Candidate best;
  for (const MatrixXd& start : starts) offer(start, samples, fit, options, best);
  // Towards the level from where the last search has ended, and from the best so far.
  MatrixXd last = starts.front();
  const auto reach = [&](double level) {
    for (const MatrixXd& start : {last, best.level >= 0 ? best.damping : starts.back()}) {
      last = fit.search(start, {options.target, level, ceiling}).damping;
      offer(last, samples, fit, options, best);
      if (best.level >= level - kMet) return true;
    }
    return false;
  };
  if (!reach(high)) {
    const double halvings = std::log2(high / kLevelStep);
    while (high - std::max(0.0, best.level) > kLevelStep) {
      const double low = std::max(0.0, best.level);
      tell(std::clamp(1 - std::log2((high - low) / kLevelStep) / halvings, 0.0, 1.0));
      const double level = 0.5 * (low + high);
      if (!reach(level)) high = level;
    }
  }
  if (best.level < 0) best.damping = last;
  return best;
}

/// Adds those configurations to `members` that `design` treats worst: with a smaller level than
/// `level` or a ratio above the ceiling. False if there is none.
bool join(const RegionDesign& design, double level, double ceiling,
          std::vector<std::size_t>& members) {
  std::vector<std::pair<double, std::size_t>> worst;
  for (std::size_t i = 0; i < design.samples.size(); ++i) {
    const RegionSample& sample = design.samples[i];
    const double missed = level - level_of(sample), over = sample.largest_ratio - ceiling;
    if (missed <= kLevelMissed && over <= kMet) continue;
    if (std::find(members.begin(), members.end(), i) == members.end()) {
      worst.emplace_back(-std::max(missed, over), i);
    }
  }
  std::sort(worst.begin(), worst.end());
  worst.resize(std::min(worst.size(), kJoining));
  for (const auto& [badness, i] : worst) members.push_back(i);
  return !worst.empty();
}

}  // namespace

RegionDesign design_region(const std::vector<TaskImpedance>& configurations,
                           const RegionOptions& options) {
  const double ceiling = ceiling_of(options);
  double told = 0;
  const auto tell = [&](double done) {
    told = std::max(told, done);
    if (options.progress) options.progress(told);
  };
  tell(0);
  const std::vector<DampingSample> samples = samples_of(configurations, options.threads);
  const DampingFit fit(samples, options.structure, options.bounds, options.threads);
  std::vector<std::size_t> members;
  const std::size_t first = std::min(kFirst, configurations.size());
  for (std::size_t i = 0; i < first; ++i) members.push_back(i * configurations.size() / first);
  Candidate candidate{MatrixXd(), 1}, best;
  RegionDesign design;
  for (int round = 0; round < kRounds; ++round) {
    std::vector<TaskImpedance> chosen;
    chosen.reserve(members.size());
    for (const std::size_t i : members) chosen.push_back(configurations[i]);
    candidate = search_level(chosen, candidate.damping, std::max(0.0, candidate.level), options,
                             [&](double done) { tell(0.9 * (round + done) / (round + 1.0)); });
    design = evaluate(samples, fit, candidate.damping, options);
    if (design.violation <= kMet && design.level > best.level)
      best = {design.damping, design.level};
    if (best.level >= candidate.level - kLevelMissed) break;
    if (!join(design, candidate.level, ceiling, members)) break;
  }
  if (best.level < 0) offer(candidate.damping, samples, fit, options, best);
  tell(1);
  if (best.level >= 0) design = evaluate(samples, fit, best.damping, options);
  return design;
}

RegionDesign evaluate_region(const std::vector<TaskImpedance>& configurations,
                             const MatrixXd& damping, const RegionOptions& options) {
  const std::vector<DampingSample> samples = samples_of(configurations, options.threads);
  return evaluate(samples, DampingFit(samples, options.structure, options.bounds, options.threads),
                  damping, options);
}

}  // namespace dashpot::analysis
