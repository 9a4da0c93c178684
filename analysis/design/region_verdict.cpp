#include <dashpot/analysis/base/arithmetic.hpp>
#include <dashpot/analysis/base/require.hpp>
#include <dashpot/analysis/design/region_verdict.hpp>
#include <dashpot/analysis/spectrum.hpp>

#include <algorithm>
#include <cmath>

namespace dashpot::analysis {
namespace {

RegionSample read_spectrum(const Spectrum<>& spectrum, const DampingTarget& target) {
  RegionSample result;
  const double fastest = spectrum.modes.empty() ? 0 : spectrum.modes[0].natural_frequency;
  const double soft = target.soft_limit(fastest);
  double least = kInfinity;
  for (int i = 0; i < spectrum.modes.size(); ++i) {
    const Mode<>& mode = spectrum.modes[i];
    if (!(mode.natural_frequency >= soft)) {
      ++result.soft_modes;
      continue;
    }
    result.largest_ratio = std::max(result.largest_ratio, mode.damping_ratio);
    const double wanted = target.ratio;
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

/// The worst first; of equal ones that with the lower number, wherever they were judged.
void keep_worst(RegionVerdict& verdict) {
  std::sort(verdict.binding.begin(), verdict.binding.end());
  verdict.binding.resize(std::min(verdict.binding.size(), kJoining));
}

/// Takes the least value and its configuration: of several that are equal to rounding, as a search
/// leaves them, the first.
void take_less(double& least, std::int64_t& sample, double value, std::int64_t number) {
  constexpr double kEqual = 1e-12;
  if (number < 0 || !(value <= least + kEqual * std::abs(least)) || value == kInfinity) return;
  const bool equal = sample >= 0 && value >= least - kEqual * std::abs(least);
  if (!equal || number < sample) sample = number;
  least = std::min(least, value);
}

}  // namespace

RegionSample judge_sample(const DampingSample& sample, std::size_t number,
                          const RegionQuestion& question, const LoopOf& loop) {
  System<> system = sample.system;
  const Eigen::MatrixXd C = sample.map * question.damping * sample.map.transpose();
  system.damping += 0.5 * (C + C.transpose());
  system.has_low_words = false;
  const Spectrum<> spectrum = analyze(system);
  RegionSample result = read_spectrum(spectrum, question.target);
  if (question.most_margin > 0) {
    result.gain_margin = gain_margin(system, spectrum, loop(number), question.most_margin);
  }
  return result;
}

RegionVerdict verdict_of(const std::vector<RegionSample>& samples, std::size_t first,
                         const RegionQuestion& question) {
  RegionVerdict verdict;
  for (std::size_t i = 0; i < samples.size(); ++i) {
    const RegionSample& sample = samples[i];
    const std::size_t number = first + i;
    verdict.largest_ratio = std::max(verdict.largest_ratio, sample.largest_ratio);
    const bool counts = sample.worst_mode >= 0 && sample.wanted > 0;
    const auto here = static_cast<std::int64_t>(number);
    if (counts) take_less(verdict.level, verdict.worst_sample, level_of(sample), here);
    take_less(verdict.gain_margin, verdict.margin_sample, sample.gain_margin, here);
    const double missed = question.level - level_of(sample);
    const double over = sample.largest_ratio - question.ceiling;
    const bool margins = question.most_margin > 0;
    const bool binds =
        margins ? sample.gain_margin < kInfinity : missed > kLevelMissed || over > kLevelMet;
    const std::vector<std::size_t>& members = question.members;
    if (binds && std::find(members.begin(), members.end(), number) == members.end()) {
      verdict.binding.emplace_back(margins ? sample.gain_margin : -std::max(missed, over), number);
    }
  }
  keep_worst(verdict);
  return verdict;
}

void RegionVerdict::add(const RegionVerdict& other) {
  take_less(level, worst_sample, other.level, other.worst_sample);
  take_less(gain_margin, margin_sample, other.gain_margin, other.margin_sample);
  largest_ratio = std::max(largest_ratio, other.largest_ratio);
  binding.insert(binding.end(), other.binding.begin(), other.binding.end());
  keep_worst(*this);
}

RegionVerdict judge_region(const std::vector<TaskImpedance>& configurations, std::size_t first,
                           const RegionQuestion& question, const LoopOf& loop) {
  require("damping", question.most_margin == 0 || loop, "a gain margin needs the loops");
  std::vector<RegionSample> samples;
  samples.reserve(configurations.size());
  for (const TaskImpedance& one : configurations) {
    samples.push_back(judge_sample(damping_sample(one), first + samples.size(), question, loop));
  }
  return verdict_of(samples, first, question);
}

}  // namespace dashpot::analysis
