#include <dashpot/identification/records/ambient_correlations.hpp>
#include <dashpot/identification/records/common.hpp>
#include <dashpot/identification/records/decay_cells.hpp>
#include <dashpot/identification/records/motion_kind.hpp>
#include <dashpot/identification/search/measured_modes.hpp>
#include <dashpot/identification/search/rubbing_decay.hpp>

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <numbers>
#include <unsupported/Eigen/LevenbergMarquardt>
#include <utility>

namespace dashpot::identification {
namespace {

constexpr int kFewestTurns = 4;        ///< fewer show friction and damping as one
constexpr double kSureFriction = 0.4;  ///< relative deviation: known less well, it is not believed
constexpr double kLikelyFriction = 0.5;  ///< relative deviation: it is there, whatever its size
constexpr double kSureFrequency = 0.05;  ///< relative deviation, and of the ratio
constexpr double kNoiseWhiteness = 1.5;  ///< growth of variances: with more it is not noise
constexpr double kMostRatio = 0.98;      ///< with more it does not turn
constexpr double kFirstMotion = 0.12;    ///< of a period: position and speed are read there
constexpr double kSearchSamples = 2000;  ///< of a record, for a start
constexpr double kStep = 1e-6;           ///< of all parameters, for differences
constexpr double kOnlyRounding = 1e-8;   ///< of the motion: a smaller residual is rounding
constexpr Index kFarthestLag = 2000;
constexpr std::size_t kMostRecords = 8;  ///< more take long and add little
constexpr double kOfChange = 2;          ///< deviations: by which fewer samples show otherwise
constexpr double kNotCompared = 2;       ///< factor on deviations that fewer samples cannot check
constexpr int kRefined = 4;              ///< of the starts
constexpr double kFirstPeriods = 4;      ///< over which a coarse frequency is a start
/// Starts: of the pace, damping ratios, and shares of the motion.
constexpr auto kFrequencies =
    std::to_array<double>({0.75, 0.82, 0.9, 0.95, 1, 1.05, 1.1, 1.2, 1.3});
constexpr auto kRatios = std::to_array<double>({0.003, 0.02, 0.08, 0.2, 0.45});
constexpr auto kFrictions = std::to_array<double>({0.003, 0.01, 0.03, 0.1, 0.25});
/// Sizes at a turn, in frictions: samples after a smaller one are left out. Tried in this order.
constexpr auto kLeastSizes = std::to_array<double>({0, 1.5, 2, 3, 4, 6, 9});

/// Deviations, because no friction is constant: relative, of the damping ratio, relative.
constexpr auto kNotConstant = std::to_array<double>({2e-4, 3e-4, 0.01});

// The parameters: log(omega), zeta and log(friction), then of each record rest, position and speed
// / omega at its beginning, and a drift in 1/s; all lengths in units of the largest motion.
constexpr Index kCommon = 3, kOwn = 4;

struct Samples {
  VectorXd time, output;  ///< s, from the record's beginning
};

struct Turn {
  double time = 0, size = 0;  ///< s; distance from rest
};

/// The exact motion at the samples' times, and its turns.
VectorXd motion_of(const VectorXd& p, Index record, const VectorXd& time,
                   std::vector<Turn>* turns = nullptr) {
  const double omega = std::exp(p[0]), zeta = std::clamp(p[1], -kMostRatio, kMostRatio);
  const double friction = std::exp(p[2]), rest = p[kCommon + kOwn * record];
  const double decay = zeta * omega, turning = omega * std::sqrt(1 - zeta * zeta);
  double at = p[kCommon + kOwn * record + 1], speed = omega * p[kCommon + kOwn * record + 2],
         begin = 0;
  VectorXd y(time.size());
  Index i = 0;
  for (Index most = time.size(); most > 0 && i < time.size(); --most) {
    if (speed == 0 && !(std::abs(at - rest) > friction)) break;
    const double middle = rest - std::copysign(friction, speed != 0 ? speed : rest - at);
    const double c = at - middle, s = (speed + decay * c) / turning;
    const auto there = [&](double t) {
      return middle +
             std::exp(-decay * t) * (c * std::cos(turning * t) + s * std::sin(turning * t));
    };
    double angle = std::atan2(speed, decay * s + turning * c);
    if (angle <= 0) angle += std::numbers::pi;
    const double end = begin + angle / turning;
    for (; i < time.size() && time[i] < end; ++i) y[i] = there(time[i] - begin);
    at = there(end - begin), speed = 0, begin = end;
    if (turns != nullptr) turns->push_back({end, std::abs(at - rest)});
  }
  y.tail(time.size() - i).setConstant(at);
  return y + p[kCommon + kOwn * record + 3] * time;
}

Index count_of(const std::vector<Samples>& all) {
  Index count = 0;
  for (const Samples& samples : all) count += samples.time.size();
  return count;
}

struct Misfit : Eigen::DenseFunctor<double> {
  explicit Misfit(const std::vector<Samples>& samples)
      : DenseFunctor(static_cast<int>(kCommon + kOwn * static_cast<Index>(samples.size())),
                     static_cast<int>(count_of(samples))),
        all(&samples) {}

  int operator()(const VectorXd& p, VectorXd& rest) const {
    Index at = 0;
    for (std::size_t r = 0; r < all->size(); ++r) {
      const Samples& samples = (*all)[r];
      rest.segment(at, samples.time.size()) =
          motion_of(p, static_cast<Index>(r), samples.time) - samples.output;
      at += samples.time.size();
    }
    return 0;
  }

  int df(const VectorXd& p, MatrixXd& slopes) const {
    VectorXd step = p, up(values()), down(values());
    for (Index i = 0; i < p.size(); ++i) {
      step[i] = p[i] + kStep;
      (*this)(step, up);
      step[i] = p[i] - kStep;
      (*this)(step, down);
      slopes.col(i) = (up - down) / (2 * kStep);
      step[i] = p[i];
    }
    return 0;
  }

  const std::vector<Samples>* all;
};

double squares_at(const std::vector<Samples>& all, const VectorXd& p) {
  VectorXd rest(count_of(all));
  Misfit{all}(p, rest);
  return rest.allFinite() ? rest.squaredNorm() : std::numeric_limits<double>::infinity();
}

VectorXd refined(const std::vector<Samples>& all, VectorXd p) {
  Misfit misfit(all);
  Eigen::LevenbergMarquardt<Misfit>(misfit).minimize(p);
  return p;
}

/// Position and speed at the beginning, by a parabola or a line.
Eigen::Vector2d beginning_of(const Samples& samples, double frequency) {
  const double span = kFirstMotion * 2 * std::numbers::pi / frequency;
  const Index near = std::max<Index>(3, (samples.time.array() <= span).count());
  MatrixXd powers(near, near > 3 ? 3 : 2);
  for (Index k = 0; k < powers.cols(); ++k) {
    powers.col(k) = samples.time.head(near).array().pow(static_cast<double>(k));
  }
  const VectorXd fit = powers.colPivHouseholderQr().solve(samples.output.head(near));
  return {fit[0], fit[1] / frequency};
}

/// The motion's beginnings of so many periods; of a long one every few samples.
std::vector<Samples> beginnings(const std::vector<Samples>& all, double period, double periods) {
  std::vector<Samples> some;
  for (const Samples& samples : all) {
    const Index n = (samples.time.array() <= periods * period).count();
    const auto step = static_cast<Index>(std::ceil(static_cast<double>(n) / kSearchSamples));
    const auto every = Eigen::seqN(0, (n + step - 1) / step, step);
    some.push_back({samples.time(every), samples.output(every)});
  }
  return some;
}

/// The best of all starts on the first periods, refined on more and more of them.
VectorXd started(const std::vector<Samples>& all, double frequency) {
  const double period = 2 * std::numbers::pi / frequency;
  double longest = 0;
  VectorXd p(kCommon + kOwn * static_cast<Index>(all.size()));
  for (std::size_t r = 0; r < all.size(); ++r) {
    const double last = all[r].time(Eigen::last) - period;
    longest = std::max(longest, all[r].time(Eigen::last));
    auto own = p.segment<kOwn>(kCommon + kOwn * static_cast<Index>(r));
    own << all[r].output.tail((all[r].time.array() >= last).count()).mean(),
        beginning_of(all[r], frequency), 0;
  }
  double periods = kFirstPeriods;
  std::vector<Samples> some = beginnings(all, period, periods);
  std::vector<std::pair<double, Eigen::Vector3d>> starts;  // the squares there
  for (const double share : kFrequencies) {
    for (const double ratio : kRatios) {
      for (const double friction : kFrictions) {
        p.head(kCommon) << std::log(share * frequency), ratio, std::log(friction);
        starts.emplace_back(squares_at(some, p), p.head(kCommon));
      }
    }
  }
  const auto first = [](const auto& a, const auto& b) { return a.first < b.first; };
  std::partial_sort(starts.begin(), starts.begin() + kRefined, starts.end(), first);
  std::pair<double, VectorXd> best{std::numeric_limits<double>::infinity(), p};
  for (int k = 0; k < kRefined; ++k) {
    p.head(kCommon) = starts[static_cast<std::size_t>(k)].second;
    const VectorXd found = refined(some, p);
    best = std::min(best, {squares_at(some, found), found}, first);
  }
  p = best.second;
  for (; periods * period < longest; periods *= 2) {
    p = refined(beginnings(all, period, 2 * periods), p);
  }
  return p;
}

/// The factor by which the correlation of a residual enlarges the variance of its means; 1 where
/// the residual is rounding.
double growth_of(const VectorXd& rest) {
  double growth = 1;
  if (rest.cwiseAbs().maxCoeff() < kOnlyRounding) return growth;
  for (Index lag = 1; lag < std::min(rest.size() / 4, kFarthestLag); ++lag) {
    const double like = rest.head(rest.size() - lag).dot(rest.tail(rest.size() - lag));
    if (like <= 0) break;
    growth += 2 * like / rest.squaredNorm();
  }
  return growth;
}

/// The samples of each record up to its last turn that is larger than so many frictions; empty if
/// fewer turns are.
std::vector<Samples> before_turns(const std::vector<Samples>& all, const VectorXd& p, double least,
                                  int fewest) {
  std::vector<Samples> used;
  for (std::size_t r = 0; r < all.size(); ++r) {
    const VectorXd& time = all[r].time;
    std::vector<Turn> turns;
    motion_of(p, static_cast<Index>(r), time, &turns);
    const auto large = std::count_if(turns.begin(), turns.end(), [&](const Turn& turn) {
      return turn.size > least * std::exp(p[2]) && turn.time <= time(Eigen::last);
    });
    const double last = large < fewest ? -1 : turns[static_cast<std::size_t>(large) - 1].time;
    const Index n = (time.array() <= last).count();
    used.push_back({time.head(n), all[r].output.head(n)});
  }
  return used;
}

struct RubbingFit {
  VectorXd parameters, std;  ///< std of the common ones
  double correlation = 0;    ///< of the first two
  double growth = 0, variance = 0, explained = 0;
};

/// Refines a fit on the samples before the turns whose size is `least` frictions.
std::optional<RubbingFit> fit_until(const std::vector<Samples>& all, VectorXd p, double least,
                                    int fewest = kFewestTurns) {
  const std::vector<Samples> used = before_turns(all, p, least, fewest);
  double motion = 0;
  for (const Samples& there : used) {
    if (there.time.size() == 0) return {};
    motion += (there.output.array() - there.output.mean()).square().sum();
  }
  p = refined(used, p);
  const Index n = count_of(used);
  if (n <= p.size()) return {};
  VectorXd rest(n);
  MatrixXd slopes(n, p.size());
  const Misfit misfit(used);
  misfit(p, rest);
  misfit.df(p, slopes);
  RubbingFit fit{p,
                 {},
                 0,
                 growth_of(rest),
                 rest.squaredNorm() / static_cast<double>(n - p.size()),
                 1 - rest.squaredNorm() / motion};
  const MatrixXd covariance =
      fit.variance * fit.growth *
      (slopes.transpose() * slopes).inverse().topLeftCorner(kCommon, kCommon);
  fit.std = covariance.diagonal().cwiseSqrt();
  fit.correlation = covariance(0, 1) / (fit.std[0] * fit.std[1]);
  return fit;
}

/// The fit of as many samples as leave noise alone; none if even few of them do not.
std::optional<RubbingFit> white_fit(const std::vector<Samples>& all, VectorXd p) {
  std::size_t k = 0;
  std::optional<RubbingFit> fit;
  for (; k < kLeastSizes.size(); ++k) {
    fit = fit_until(all, p, kLeastSizes[k]);
    if (!fit) return {};
    p = fit->parameters;
    if (fit->growth < kNoiseWhiteness) break;
  }
  if (k == kLeastSizes.size()) return {};
  // A change of the estimate with fewer samples widens its deviations: friction that fades at low
  // speed hides in noise.
  bool compared = false;
  for (++k; k < kLeastSizes.size(); ++k) {
    const auto other = fit_until(all, p, kLeastSizes[k]);
    if (!other) break;
    if (other->variance == fit->variance) continue;  // of the same samples
    fit->std = fit->std.cwiseMax(kOfChange * (other->parameters - p).head(kCommon).cwiseAbs());
    compared = true;
  }
  if (!compared) fit->std *= kNotCompared;
  for (Index i = 0; i < kCommon; ++i) {
    fit->std[i] = std::hypot(fit->std[i], kNotConstant[static_cast<std::size_t>(i)]);
  }
  const bool grows = p[1] < -2 * fit->std[1], turns = std::abs(p[1]) < kMostRatio;
  const bool determined =
      fit->std[0] < kSureFrequency && fit->std[1] < kSureFrequency && fit->std[2] < kSureFriction;
  return determined && turns && !grows ? fit : std::nullopt;
}

Identification described(const RubbingFit& fit, double unit) {
  Identification result;
  const VectorXd& p = fit.parameters;
  MeasuredMode mode;
  mode.natural_frequency = std::exp(p[0]);
  mode.damping_ratio = std::clamp(p[1], -kMostRatio, kMostRatio);
  const double turning = std::sqrt(1 - mode.damping_ratio * mode.damping_ratio);
  mode.eigenvalues[0] = mode.natural_frequency * Complex(-mode.damping_ratio, turning);
  mode.eigenvalues[1] = std::conj(mode.eigenvalues[0]);
  mode.natural_frequency_std = mode.natural_frequency * fit.std[0];
  mode.damping_ratio_std = fit.std[1];
  mode.covariance = fit.correlation * mode.natural_frequency_std * mode.damping_ratio_std;
  mode.shape = VectorXcd::Ones(1);
  mode.stability = 1;
  mode.energy = result.explained = fit.explained;
  result.modes = {mode};
  result.order = 2;
  result.noise = VectorXd::Constant(1, unit * std::sqrt(fit.variance));
  result.whiteness = fit.growth;
  result.friction = unit * std::exp(p[2]);
  result.friction_std = result.friction * fit.std[2];
  return result;
}

/// The friction's mode in records of one channel.
std::optional<Identification> rubbing_mode(const std::vector<MotionRecord>& records) {
  std::vector<Samples> all;
  double unit = 0, pace = 0;
  for (const MotionRecord& record : records) {
    if (all.size() == kMostRecords) break;
    std::vector<Index> there;
    for (Index i = 0; i < record.time.size(); ++i) {
      if (std::isfinite(record.output(0, i))) there.push_back(i);
    }
    const VectorXd time = record.time(there), output = record.output.row(0)(there);
    all.push_back({(time.array() - time[0]).matrix(), output});
    const double size = (output.array() - output(Eigen::last)).abs().maxCoeff();
    if (size <= unit) continue;
    unit = size;
    const double step = typical_step({record});
    pace = pace_of(on_grid(record, step), step, first_noise({record}));
  }
  if (!(pace > 0)) return {};
  for (Samples& samples : all) samples.output /= unit;
  VectorXd p = started(all, pace);
  // A weak push does not spoil the others.
  const std::vector<Samples> before = before_turns(all, p, 0, kFewestTurns);
  std::vector<Samples> turning;
  for (std::size_t r = 0; r < all.size(); ++r) {
    if (before[r].time.size() > 0) turning.push_back(all[r]);
  }
  if (!turning.empty() && turning.size() < all.size()) {
    all = turning;
    p = started(all, pace);
  }
  if (const auto fit = white_fit(all, p)) return described(*fit, unit);
  // The mode is not determined, but friction may explain all.
  const auto fit = fit_until(all, p, 0, 1);
  if (!fit || !(fit->growth < kNoiseWhiteness && fit->std[2] < kLikelyFriction)) return {};
  Identification result = described(*fit, unit);
  result.rejected = std::exchange(result.modes, {});
  result.friction = result.friction_std = 0;
  return result;
}

}  // namespace

std::optional<Identification> identify_rubbing(const std::vector<MotionRecord>& records) {
  std::optional<Identification> result = rubbing_mode(records);
  if (result && !result->modes.empty()) return result;
  std::vector<MotionRecord> cleaned = records;
  std::vector<SteadyLine> hums;
  for (MotionRecord& record : cleaned) {
    for (SteadyLine& hum : take_hums(record)) hums.push_back(std::move(hum));
  }
  if (hums.empty()) return result;
  result = rubbing_mode(cleaned);
  if (!result || result->modes.empty()) return result;
  for (const SteadyLine& hum : hums) result->rejected.push_back(to_mode(hum));
  return result;
}

}  // namespace dashpot::identification
