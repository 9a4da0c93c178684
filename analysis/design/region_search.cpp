#include <dashpot/analysis/base/require.hpp>
#include <dashpot/analysis/damping_design.hpp>
#include <dashpot/analysis/damping_region.hpp>
#include <dashpot/analysis/design/level_search.hpp>
#include <dashpot/analysis/design/region_verdict.hpp>

#include <algorithm>
#include <cmath>
#include <string>
#include <utility>

namespace dashpot::analysis {
namespace {

using Eigen::MatrixXd;

constexpr double kLevelStep = 5e-4;
/// Configurations whose exact design is tried, about; and how often one is scaled down.
constexpr std::size_t kStarts = 8;
constexpr int kScalings = 12;
/// Configurations that a search begins with, and how often some may join.
constexpr std::size_t kFirst = 32;
constexpr int kRounds = 40;
constexpr std::size_t kMembers = kFirst + kRounds * kJoining;  // at most
/// Gain margins beyond it count as infinite.
constexpr double kMostMargin = 1e6;

std::vector<DampingSample> samples_of(const std::vector<TaskImpedance>& configurations,
                                      int threads) {
  std::vector<DampingSample> samples(configurations.size());
  for_each_in_parallel(samples.size(), threads,
                       [&](std::size_t i) { samples[i] = damping_sample(configurations[i]); });
  return samples;
}

/// Returns the largest ratio allowed. Throws for options that are not valid.
double ceiling_of(const RegionOptions& options) {
  require("damping", options.gain_margin >= 1, "the gain margin has to be at least 1");
  const double wanted = options.target.ratio;
  const double ceiling = options.ceiling.value_or(std::max(1.0, 1.5 * wanted));
  require("damping", ceiling >= wanted, "the largest ratio allowed is below the one wanted");
  return ceiling;
}

std::vector<RegionSample> read_all(const std::vector<DampingSample>& samples,
                                   const RegionQuestion& question, const RegionOptions& options) {
  std::vector<RegionSample> found(samples.size());
  for_each_in_parallel(samples.size(), options.threads, [&](std::size_t i) {
    found[i] = judge_sample(samples[i], i, question, options.loop);
  });
  return found;
}

/// What all configurations say of one damping matrix.
using Judge = std::function<RegionVerdict(const MatrixXd&)>;

RegionDesign design_of(const MatrixXd& damping, const RegionVerdict& verdict, double ceiling) {
  RegionDesign design;
  design.damping = damping;
  design.level = std::min(1.0, verdict.level);
  design.violation = std::max(0.0, verdict.largest_ratio - ceiling);
  design.worst_sample = static_cast<int>(verdict.worst_sample);
  design.gain_margin = verdict.gain_margin;
  design.margin_sample = static_cast<int>(verdict.margin_sample);
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
    const RegionDesign design = design_of(damping, verdict, ceiling);
    if (design.violation <= kLevelMet) {
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
  const DampingFit fit(samples, options.structure, options.threads);
  const Judge judge = [&](const MatrixXd& damping) {
    const RegionQuestion question{damping, options.target, 0, 0, {}};
    return verdict_of(read_all(samples, question, options), 0, question);
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
      if (best.level >= level - kLevelMet) return true;
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

/// Seeks the largest share of `damping` with which every loop keeps its margin. Loops that lost the
/// margin at one share are asked first at the next.
FoundLevel find_share(const RegionSource& source, const MatrixXd& damping,
                      const RegionOptions& options, const std::function<void()>& tell) {
  std::vector<std::size_t> losing;
  const auto question = [&](double share, double most_margin) {
    return RegionQuestion{share * damping, options.target, 0, 0, losing, most_margin};
  };
  std::pair<double, double> judged{0, 0};  // a share, and its margin
  const auto margin_of = [&](double share) {
    if (judged.first == share) return judged.second;
    tell();
    judged = {share, source.judge(question(share, kMostMargin)).gain_margin};
    return judged.second;
  };
  const auto keeps = [&](double share, double least) {
    if (least < options.gain_margin) return margin_of(share) >= least;
    tell();
    const RegionQuestion asked = question(share, options.gain_margin);
    for (const std::size_t i : losing) {
      const DampingSample one = damping_sample(source.configuration(i));
      if (judge_sample(one, i, asked, options.loop).gain_margin < options.gain_margin) return false;
    }
    const RegionVerdict verdict = source.judge(asked);
    for (const auto& [margin, number] : verdict.binding) losing.push_back(number);
    return verdict.binding.empty();
  };
  return find_level(keeps, margin_of, options.gain_margin);
}

/// A damping matrix, and its share of the matrix for continuous loops.
struct Lowered {
  MatrixXd damping;
  FoundLevel share;
};

/// The best matrix for continuous loops, and the share of it that sampled loops tolerate.
Lowered search_region(const RegionSource& source, const RegionOptions& options) {
  const double ceiling = ceiling_of(options);
  require("damping", source.count > 0, "a region without configurations");
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
  require("damping", DampingFit::fits(std::min(kMembers, source.count), n, k, options.structure),
          "a region of " + std::to_string(source.count) + " configurations of " +
              std::to_string(n) + " coordinates and " + std::to_string(k) +
              " directions would take more than 1 GB");
  const DampingFit fit(one, options.structure, options.threads);  // for the structure
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
    design = design_of(candidate.damping, verdict, ceiling);
    if (design.violation <= kLevelMet && design.level > best.level) {
      best = {design.damping, design.level};
    }
    if (best.level >= candidate.level - kLevelMissed || verdict.binding.empty()) break;
    for (const auto& [badness, number] : verdict.binding) members.push_back(number);
  }
  const Judge judge = [&](const MatrixXd& damping) {
    return source.judge({damping, options.target, 0, ceiling, members});
  };
  if (best.level < 0) offer(candidate.damping, judge, fit, ceiling, best);
  Lowered result{best.level >= 0 ? best.damping : design.damping, {}};
  if (options.loop) {
    double left = 0.1;
    result.share = find_share(source, result.damping, options, [&] { tell(1 - (left *= 0.9)); });
    result.damping *= result.share.level;
  }
  return result;
}

/// The design with the matrix of `found`.
RegionDesign design_of(const Lowered& found, const RegionVerdict& verdict,
                       const RegionOptions& options) {
  RegionDesign design = design_of(found.damping, verdict, ceiling_of(options));
  design.share = found.share.level;
  design.kept =
      found.share.kept && design.gain_margin >= (1 - kMarginPrecision) * options.gain_margin;
  if (design.kept) design.gain_margin = std::max(design.gain_margin, options.gain_margin);
  if (options.progress) options.progress(1);
  return design;
}

RegionQuestion last_question(const MatrixXd& damping, const RegionOptions& options) {
  return {damping, options.target, 0, 0, {}, options.loop ? kMostMargin : 0};
}

RegionDesign evaluate(const std::vector<TaskImpedance>& configurations, const Lowered& found,
                      const RegionOptions& options) {
  require("damping", !configurations.empty(), "a region without configurations");
  const std::vector<DampingSample> samples = samples_of(configurations, options.threads);
  const RegionQuestion question = last_question(found.damping, options);
  std::vector<RegionSample> map = read_all(samples, question, options);
  RegionDesign design = design_of(found, verdict_of(map, 0, question), options);
  design.samples = std::move(map);
  return design;
}

}  // namespace

RegionDesign design_region(const RegionSource& source, const RegionOptions& options) {
  const Lowered found = search_region(source, options);
  const RegionVerdict verdict = source.judge(last_question(found.damping, options));
  return design_of(found, verdict, options);
}

RegionDesign design_region(const std::vector<TaskImpedance>& configurations,
                           const RegionOptions& options) {
  ceiling_of(options);  // is judged first
  const std::vector<DampingSample> samples = samples_of(configurations, options.threads);
  RegionSource source;
  source.count = configurations.size();
  source.configuration = [&](std::size_t i) { return configurations[i]; };
  source.judge = [&](const RegionQuestion& question) {
    return verdict_of(read_all(samples, question, options), 0, question);
  };
  return evaluate(configurations, search_region(source, options), options);
}

RegionDesign evaluate_region(const std::vector<TaskImpedance>& configurations,
                             const MatrixXd& damping, const RegionOptions& options) {
  return evaluate(configurations, {damping, {}}, options);
}

}  // namespace dashpot::analysis
