#include <dashpot/identification/identification.hpp>
#include <dashpot/identification/records/ambient_correlations.hpp>
#include <dashpot/identification/records/common.hpp>
#include <dashpot/identification/records/decay_cells.hpp>
#include <dashpot/identification/records/motion_kind.hpp>
#include <dashpot/identification/search/rubbing_decay.hpp>

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <numbers>
#include <stdexcept>

namespace dashpot::identification {
namespace {

constexpr double kMoves = 3;   // in units of the noise
constexpr double kStrong = 5;  // worth a decay
constexpr double kRise = 3;    // a new push
// In periods of the motion's pace: motion slower by a few times still has one envelope.
constexpr double kStandstill = 1;  // within a motion
constexpr double kEnvelope = 1.5;  // window
// Times over which positions are compared; the first that shows a push counts. Short ones show fast
// motion, long ones show slow motion in more noise.
constexpr std::array kLags = {0.025, 0.1, 0.4, 1.6};
constexpr Index kLeast = 20;         // samples of a decay
constexpr Index kRestPart = 10;      // part of an event at its end, where the arm rests
constexpr double kTop = 0.97;        // of the largest energy: the same, but for noise
constexpr Index kStepsOfWindow = 8;  // of the envelope
constexpr double kBegins = 1.5;      // times the least speed before it: a push
// Where a decay may begin: points of its rise, and shares of what follows its peak.
constexpr int kRisePoints = 6;
constexpr std::array kAfterPeak = {0.0, 0.02, 0.05, 0.1, 0.2, 0.3};
// Large motions are not linear, but only they show fast decays. A start is too early if its
// residual exceeds the best start's by kMore (logarithm), beyond kEnough of the motion.
constexpr double kEnough = 1e-3, kMore = 0.03;
constexpr double kSeen = 8;  // times the noise: motion of a decay

/// How fast the channels move: root mean square of differences over `lag`, in units of their noise.
VectorXd speed_of(const MatrixXd& grid, const VectorXd& noise, Index lag) {
  const Index N = grid.cols();
  VectorXd squares = VectorXd::Zero(N);
  for (Index k = 0; k + lag < N; ++k) {
    squares[k] = (grid.col(k + lag) - grid.col(k)).cwiseQuotient(noise).squaredNorm() / 2 /
                 static_cast<double>(grid.rows());
  }
  VectorXd speed = VectorXd::Zero(N);
  double sum = 0;  // over the last samples, as many as the lag
  for (Index k = 0; k < N; ++k) {
    sum += squares[k];
    if (k >= lag) sum -= squares[k - lag];
    speed[k] = std::sqrt(std::max(0.0, sum) / static_cast<double>(std::min(k + 1, lag)));
  }
  return speed;
}

/// The point from which an event may be free: the last at which its energy, or an estimate of it,
/// is at its top. The kinetic part is scaled so that both parts are equal on the whole.
Index top_of_energy(const MatrixXd& grid, const VectorXd& size, Index from, Index to, Index lag) {
  const Index quiet = std::max<Index>(1, (to - from) / kRestPart);
  const VectorXd rest = grid.middleCols(to - quiet, quiet).rowwise().mean();
  const Index N = to - from - lag;
  VectorXd potential(N), kinetic(N);
  for (Index k = 0; k < N; ++k) {
    const auto here = grid.col(from + k), there = grid.col(from + k + lag);
    potential[k] = ((here + there) / 2 - rest).cwiseQuotient(size).squaredNorm();
    kinetic[k] = (there - here).cwiseQuotient(size).squaredNorm();
  }
  const VectorXd energy = potential + kinetic * (potential.sum() / std::max(kTiny, kinetic.sum()));
  const double top = kTop * energy.maxCoeff();
  for (Index k = N; k-- > 0;) {
    if (energy[k] >= top) return from + k;
  }
  return from;
}

/// A push and what follows, in points of the grid.
struct Event {
  Index begin, peak, end;
};

/// The pushes within a motion from `begin` to `end`: where the envelope of the speed rises again.
void add_events(const VectorXd& speed, Index begin, Index end, Index window,
                std::vector<Event>& events) {
  Index peak = begin, low = begin;
  double least = 0;
  bool falling = false;
  const auto envelope = [&](Index k) {
    const Index from = std::max(begin, k - window / 2), to = std::min(end, k + window / 2 + 1);
    return speed.segment(from, to - from).maxCoeff();
  };
  Index start = begin;
  for (Index k = begin; k < end; k += std::max<Index>(1, window / kStepsOfWindow)) {
    const double now = envelope(k);
    if (!falling) {
      if (now >= speed[peak]) {
        const Index from = std::max(begin, k - window / 2);
        Index at = 0;
        speed.segment(from, std::min(end, k + window / 2 + 1) - from).maxCoeff(&at);
        peak = from + at;
      }
      if (now < speed[peak] / 2) falling = true, least = now, low = k;
      continue;
    }
    if (now < least) least = now, low = k;
    if (now > kRise * std::max(least, kMoves)) {
      // Begins before the envelope, which looks ahead.
      Index rise = std::min(end - 1, low + window / 2);
      while (rise > low && speed[rise] > kBegins * least) --rise;
      events.push_back({start, peak, rise});
      start = rise, peak = rise, falling = false;
      k = rise;
    }
  }
  events.push_back({start, peak, end});
}

/// `period` in points of the grid.
std::vector<Event> find_events(const VectorXd& speed, double period) {
  const auto points = [period](double periods) {
    return std::max<Index>(1, static_cast<Index>(std::lround(periods * period)));
  };
  std::vector<Event> events;
  const Index N = speed.size();
  for (Index k = 0; k < N;) {
    if (speed[k] <= kMoves) {
      ++k;
      continue;
    }
    Index last = k;
    for (Index i = k; i < N && i - last <= points(kStandstill); ++i) {
      if (speed[i] > kMoves) last = i;
    }
    const std::size_t before = events.size();
    add_events(speed, k, last + 1, points(kEnvelope), events);
    events.erase(
        std::remove_if(events.begin() + static_cast<std::ptrdiff_t>(before), events.end(),
                       [&speed](const Event& event) { return speed[event.peak] < kStrong; }),
        events.end());
    k = last + 1;
  }
  return events;
}

/// Slow motion continues after its speed is lost in noise, and the samples at rest show the
/// equilibrium: ends each event by its positions, before the next one.
void extend(const MatrixXd& grid, const VectorXd& noise, std::vector<Event>& events) {
  for (std::size_t i = 0; i < events.size(); ++i) {
    auto& [begin, peak, end] = events[i];
    const Index next = i + 1 < events.size() ? events[i + 1].begin : grid.cols();
    const Index heard = audible(grid.middleCols(begin, next - begin), noise);
    end = std::max(end, std::min(next, begin + heard + heard / 3));
  }
}

/// Returns the standard deviation of each channel.
VectorXd motion_of(const MotionRecord& record) {
  VectorXd motion(record.output.rows());
  for (Index c = 0; c < motion.size(); ++c) {
    double sum = 0, squares = 0, count = 0;
    for (const double y : record.output.row(c)) {
      if (std::isfinite(y)) sum += y, ++count;
    }
    for (const double y : record.output.row(c)) {
      if (std::isfinite(y)) squares += std::pow(y - sum / count, 2);
    }
    motion[c] = std::sqrt(squares / count);
  }
  return motion;
}

/// The begin of an event's decay: the earliest of some points from which a sum of decays explains
/// it.
FreeDecay decay_of(const MotionRecord& record, const VectorXd& noise, Index from, Index peak,
                   Index to) {
  FreeDecay decay{peak, to, {}};
  std::vector<Index> starts;
  starts.reserve(kRisePoints + std::size(kAfterPeak));
  for (int k = 0; k < kRisePoints; ++k) starts.push_back(from + (peak - from) * k / kRisePoints);
  for (const double share : kAfterPeak) {
    starts.push_back(peak + static_cast<Index>(share * static_cast<double>(to - peak)));
  }
  starts.erase(std::unique(starts.begin(), starts.end()), starts.end());
  // A joint that rubs may be taken from the first.
  if (record.output.rows() == 1 && to - from >= kLeast) {
    for (const Index start : {from, peak}) {
      const auto rubbing =
          to - start < kLeast ? std::nullopt : identify_rubbing({part_of(record, start, to)});
      if (rubbing && !rubbing->modes.empty()) {
        decay.from = start;
        return decay;
      }
    }
  }
  // Digits that do not change do not mean motion without noise.
  const VectorXd enough = (kEnough * motion_of(part_of(record, from, to))).cwiseMax(noise);
  // Mean logarithm of a model's residual from a start on; none if too little follows.
  const auto rest = [&](Index start) {
    if (to - start < kLeast) return std::numeric_limits<double>::infinity();
    try {
      const Identification found =
          identify_decays({part_of(record, start, to)}, {.max_order = 0, .refine = false});
      return found.noise.cwiseMax(enough).array().log().mean();
    } catch (const std::invalid_argument&) {
      return std::numeric_limits<double>::infinity();
    }
  };
  double least = std::numeric_limits<double>::infinity();
  while (!starts.empty() && !std::isfinite(least = rest(starts.back()))) starts.pop_back();
  if (starts.empty()) {
    decay.reason = "too short";
    return decay;
  }
  // A model of the motion from some start on explains it from later ones: by halving.
  std::size_t good = starts.size() - 1, bad = 0;
  if (rest(starts[0]) <= least + kMore) good = 0;
  while (good > bad + 1) {
    const std::size_t middle = (good + bad) / 2;
    const double there = rest(starts[middle]);
    least = std::min(least, there);
    (there <= least + kMore ? good : bad) = middle;
  }
  decay.from = starts[good];
  const VectorXd motion = motion_of(part_of(record, decay.from, to));
  if (motion.cwiseQuotient(noise).maxCoeff() < kSeen) decay.reason = "lost in noise";
  return decay;
}

}  // namespace

std::vector<FreeDecay> find_decays(const MotionRecord& record, const std::vector<bool>& free) {
  const Index N = record.time.size();
  if (!free.empty() && free.size() != static_cast<std::size_t>(N)) {
    throw std::invalid_argument("find_decays: free has to have an entry for each sample");
  }
  check_records({record});
  const VectorXd noise = first_noise({record});
  const double step = typical_step({record});
  MatrixXd grid = on_grid(record, step);
  take_steady_lines(grid, step, true);
  const double pace = pace_of(grid, step, noise);
  if (!(pace > 0)) return {};
  const double period = 2 * std::numbers::pi / (pace * step);
  Index lag = 1;
  std::vector<Event> events;
  for (const double share : kLags) {
    if (!events.empty()) break;
    lag = std::max<Index>(1, static_cast<Index>(std::lround(share * period)));
    events = find_events(speed_of(grid, noise, lag), period);
  }
  std::vector<FreeDecay> decays;
  const auto sample_at = [&record, step](Index point) {
    const double t = record.time[0] + (static_cast<double>(point) - 0.5) * step;
    const auto* const first = record.time.data();
    return static_cast<Index>(std::lower_bound(first, first + record.time.size(), t) - first);
  };
  extend(grid, noise, events);
  for (const Event& event : events) {
    if (event.end - event.begin < 4 * lag) continue;
    const auto whole = grid.middleCols(event.begin, event.end - event.begin);
    const VectorXd size =
        (whole.colwise() - VectorXd(whole.rowwise().mean())).rowwise().norm().cwiseMax(noise);
    const Index top = top_of_energy(grid, size, event.begin, event.end, lag);
    Index from = sample_at(top), to = sample_at(event.end);
    Index peak = std::max(from, sample_at(event.peak));
    if (!free.empty()) {
      // The longest free stretch of it.
      Index best_from = from, best_to = from;
      for (Index k = from, begin = from; k <= to; ++k) {
        if (k < to && free[static_cast<std::size_t>(k)]) continue;
        if (k - begin > best_to - best_from) best_from = begin, best_to = k;
        begin = k + 1;
      }
      from = best_from, to = best_to;
      peak = std::clamp(peak, from, to);
    }
    if (to - from < kLeast) {
      decays.push_back({from, to, "too short"});
      continue;
    }
    decays.push_back(decay_of(record, noise, from, peak, to));
  }
  return decays;
}

}  // namespace dashpot::identification
