#include <dashpot/analysis/damping_design.hpp>
#include <dashpot/analysis/damping_region.hpp>
#include <dashpot/analysis/spectrum.hpp>

#include <algorithm>
#include <cmath>
#include <limits>
#include <stdexcept>
#include <string>
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
constexpr std::size_t kMembers = kFirst + kRounds * kJoining;  // at most

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

RegionSample read(const DampingSample& sample, const MatrixXd& damping,
                  const DampingTarget& target) {
  System<> system = sample.system;
  const MatrixXd C = sample.map * damping * sample.map.transpose();
  system.damping += 0.5 * (C + C.transpose());
  system.has_low_words = false;
  return read(analyze(system), target);
}

std::vector<RegionSample> read_all(const std::vector<DampingSample>& samples,
                                   const MatrixXd& damping, const RegionOptions& options) {
  std::vector<RegionSample> found(samples.size());
  for_each_in_parallel(samples.size(), options.threads, [&](std::size_t i) {
    found[i] = read(samples[i], damping, options.target);
  });
  return found;
}

/// The worst first; of equal ones that with the lower number, wherever they were judged.
void keep_worst(RegionVerdict& verdict) {
  std::sort(verdict.binding.begin(), verdict.binding.end());
  verdict.binding.resize(std::min(verdict.binding.size(), kJoining));
}

RegionVerdict verdict_of(const std::vector<RegionSample>& samples, std::size_t first,
                         const RegionQuestion& question) {
  RegionVerdict verdict;
  for (std::size_t i = 0; i < samples.size(); ++i) {
    const RegionSample& sample = samples[i];
    const std::size_t number = first + i;
    verdict.largest_ratio = std::max(verdict.largest_ratio, sample.largest_ratio);
    const bool counts = sample.worst_mode >= 0 && sample.wanted > 0;
    if (counts && level_of(sample) < verdict.level) {
      verdict.level = level_of(sample);
      verdict.worst_sample = static_cast<std::int64_t>(number);
    }
    const double missed = question.level - level_of(sample);
    const double over = sample.largest_ratio - question.ceiling;
    if (missed <= kLevelMissed && over <= kMet) continue;
    const std::vector<std::size_t>& members = question.members;
    if (std::find(members.begin(), members.end(), number) == members.end()) {
      verdict.binding.emplace_back(-std::max(missed, over), number);
    }
  }
  keep_worst(verdict);
  return verdict;
}

/// What all configurations say of one damping matrix.
using Judge = std::function<RegionVerdict(const MatrixXd&)>;

RegionDesign design_of(const MatrixXd& damping, const RegionVerdict& verdict, const DampingFit& fit,
                       double ceiling) {
  RegionDesign design;
  design.damping = damping;
  design.level = std::min(1.0, verdict.level);
  design.violation = std::max({0.0, verdict.largest_ratio - ceiling, fit.excess(damping)});
  design.worst_sample = static_cast<int>(verdict.worst_sample);
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
void offer(MatrixXd damping, const Judge& judge, const DampingFit& fit, double ceiling,
           Candidate& best) {
  damping = fit.within_structure(damping);
  for (int k = 0; k < kScalings; ++k) {
    const RegionVerdict verdict = judge(damping);
    const RegionDesign design = design_of(damping, verdict, fit, ceiling);
    if (design.violation <= kMet) {
      if (design.level > best.level) best = {damping, design.level};
      return;
    }
    damping *= std::min(0.9, ceiling / verdict.largest_ratio);
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
  const Judge judge = [&](const MatrixXd& damping) {
    return verdict_of(read_all(samples, damping, options), 0, {damping, options.target, 0, 0, {}});
  };
  std::vector<MatrixXd> starts = starts_of(configurations, options);
  if (given.size() > 0) starts.insert(starts.begin(), given);
  Candidate best;
  for (const MatrixXd& start : starts) offer(start, judge, fit, ceiling, best);
  // Towards the level from where the last search has ended, and from the best so far.
  MatrixXd last = starts.front();
  const auto reach = [&](double level) {
    for (const MatrixXd& start : {last, best.level >= 0 ? best.damping : starts.back()}) {
      last = fit.search(start, {options.target, level, ceiling}).damping;
      offer(last, judge, fit, ceiling, best);
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

}  // namespace

void RegionVerdict::add(const RegionVerdict& other) {
  const bool earlier = other.level == level && other.worst_sample >= 0 &&
                       (worst_sample < 0 || other.worst_sample < worst_sample);
  if (other.level < level || earlier) worst_sample = other.worst_sample;
  level = std::min(level, other.level);
  largest_ratio = std::max(largest_ratio, other.largest_ratio);
  binding.insert(binding.end(), other.binding.begin(), other.binding.end());
  keep_worst(*this);
}

RegionVerdict judge_region(const std::vector<TaskImpedance>& configurations, std::size_t first,
                           const RegionQuestion& question) {
  std::vector<RegionSample> samples;
  samples.reserve(configurations.size());
  for (const TaskImpedance& one : configurations) {
    samples.push_back(read(damping_sample(one), question.damping, question.target));
  }
  return verdict_of(samples, first, question);
}

RegionDesign design_region(const RegionSource& source, const RegionOptions& options) {
  const double ceiling = ceiling_of(options);
  if (source.count == 0) throw std::invalid_argument("damping: a region without configurations");
  double told = 0;
  const auto tell = [&](double done) {
    told = std::max(told, done);
    if (options.progress) options.progress(told);
  };
  tell(0);
  std::vector<std::size_t> members;
  const std::size_t first = std::min(kFirst, source.count);
  for (std::size_t i = 0; i < first; ++i) members.push_back(i * source.count / first);
  const std::vector<DampingSample> one = {damping_sample(source.configuration(0))};
  const Eigen::Index n = one[0].system.dof(), k = one[0].map.cols();
  if (!DampingFit::fits(std::min(kMembers, source.count), n, k, options.structure)) {
    throw std::invalid_argument("damping: a region of " + std::to_string(source.count) +
                                " configurations of " + std::to_string(n) + " coordinates and " +
                                std::to_string(k) + " directions would take more than 1 GB");
  }
  const DampingFit fit(one, options.structure, options.bounds, options.threads);  // for the limits
  std::vector<TaskImpedance> chosen;
  Candidate candidate{MatrixXd(), 1}, best;
  RegionDesign design;
  for (int round = 0; round < kRounds; ++round) {
    while (chosen.size() < members.size()) {
      chosen.push_back(source.configuration(members[chosen.size()]));
    }
    candidate = search_level(chosen, candidate.damping, std::max(0.0, candidate.level), options,
                             [&](double done) { tell(0.9 * (round + done) / (round + 1.0)); });
    const RegionVerdict verdict =
        source.judge({candidate.damping, options.target, candidate.level, ceiling, members});
    design = design_of(candidate.damping, verdict, fit, ceiling);
    if (design.violation <= kMet && design.level > best.level) {
      best = {design.damping, design.level};
    }
    if (best.level >= candidate.level - kLevelMissed || verdict.binding.empty()) break;
    for (const auto& [badness, number] : verdict.binding) members.push_back(number);
  }
  const Judge judge = [&](const MatrixXd& damping) {
    return source.judge({damping, options.target, 0, ceiling, members});
  };
  if (best.level < 0) offer(candidate.damping, judge, fit, ceiling, best);
  tell(1);
  if (best.level >= 0 && best.damping != design.damping) {
    design = design_of(best.damping, judge(best.damping), fit, ceiling);
  }
  return design;
}

RegionDesign evaluate_region(const std::vector<TaskImpedance>& configurations,
                             const MatrixXd& damping, const RegionOptions& options) {
  const std::vector<DampingSample> samples = samples_of(configurations, options.threads);
  std::vector<RegionSample> map = read_all(samples, damping, options);
  const RegionVerdict verdict = verdict_of(map, 0, {damping, options.target, 0, 0, {}});
  RegionDesign design = design_of(
      damping, verdict, DampingFit(samples, options.structure, options.bounds, options.threads),
      ceiling_of(options));
  design.samples = std::move(map);
  return design;
}

RegionDesign design_region(const std::vector<TaskImpedance>& configurations,
                           const RegionOptions& options) {
  ceiling_of(options);  // is judged first
  const std::vector<DampingSample> samples = samples_of(configurations, options.threads);
  RegionSource source;
  source.count = configurations.size();
  source.configuration = [&](std::size_t i) { return configurations[i]; };
  source.judge = [&](const RegionQuestion& question) {
    return verdict_of(read_all(samples, question.damping, options), 0, question);
  };
  return evaluate_region(configurations, design_region(source, options).damping, options);
}

}  // namespace dashpot::analysis
