#include <dashpot/analysis/base/require.hpp>
#include <dashpot/analysis/contact_limit.hpp>
#include <dashpot/analysis/sampled/circle_count.hpp>
#include <dashpot/analysis/sampled/margin_search.hpp>

#include <Eigen/Cholesky>
#include <array>
#include <numbers>

namespace dashpot::analysis {
namespace {

using Eigen::MatrixXd;
using Eigen::VectorXd;

/// A loop that touches something, with the stiffness of the touch as the parameter.
class TouchedLoop {
 public:
  TouchedLoop(const System<>& system, const Spectrum<>& spectrum, const SampledLoop& loop,
              const Touch& touch)
      : period_(loop.period),
        slowest_(loop.slowest * loop.period),
        free_(checked(system, touch), spectrum, with_damper(loop, system.dof(), touch)) {
    const Eigen::LLT<MatrixXd> mass(added(system.mass, touch.mass, touch));
    a_ = period_ * mass.matrixL().solve(touch.direction);
    free_.K = free_.P + touch.stiffness_share * (free_.K - free_.P);
    free_.C = free_.D + touch.damping_share * (free_.C - free_.D);
    touched_ = free_;
    free_.touch(VectorXd::Zero(a_.size()));
    touched_.touch(a_);
    units_[0] = free_.unit_motions();
    units_[1] = touched_.unit_motions();
  }

  /// Returns the stiffness with which the touch alone makes the arm move at `omega` rad/s.
  double stiffness_at(double omega) const {
    return omega * omega * period_ * period_ / a_.squaredNorm();
  }
  /// Returns by how many half turns the touch alone makes the arm turn in a tick.
  double half_turns(double stiffness) const {
    return std::floor(std::sqrt(stiffness / stiffness_at(1 / period_)) / std::numbers::pi);
  }
  double period() const { return period_; }
  /// Whether the state is too large for its eigenvalues.
  bool counted() const { return free_.rows() > kDenseRows; }
  SampledDataModel pressed(double stiffness) const {
    SampledDataModel model = stiffness > 0 ? touched_ : free_;
    model.press(a_, stiffness);
    return model;
  }
  Trial solve(double stiffness) const {
    return solve(pressed(stiffness), units_[stiffness > 0 ? 1 : 0], stiffness);
  }
  /// The loop is stable if the excess is negative.
  Trial at(double stiffness) const {
    if (!counted()) return solve(stiffness);
    return {stiffness, CircleCount(pressed(stiffness), slowest_).excess(1)};
  }
  bool stable_if_rigid() const {
    SampledDataModel model = free_;
    model.hold(a_);
    if (model.n == 0) return true;
    if (model.rows() > kDenseRows) return CircleCount(model, slowest_).excess(1) < 0;
    return solve(model, model.unit_motions(), 0).excess < 0;
  }
  /// Whether the count of all eigenvalues proves the verdict, with none too near to the circle.
  bool proves(double stiffness, bool stable) const {
    constexpr double kClear = 1e-8;  // above what CircleCount takes for a zero on its path
    const double excess = CircleCount(pressed(stiffness), slowest_).excess(1);
    return stable ? excess < 0 : excess > kClear;
  }

 private:
  static MatrixXd added(const MatrixXd& A, double factor, const Touch& touch) {
    return A + factor * touch.direction * touch.direction.transpose();
  }
  static System<> checked(System<> system, const Touch& touch) {
    require("contact", touch.direction.size() == system.dof() && touch.direction.allFinite(),
            "direction has to have n finite entries");
    require("contact", !touch.direction.isZero(0), "direction must not be zero");
    for (const auto& [name, value] : {std::pair("damping", touch.damping),
                                      {"mass", touch.mass},
                                      {"most", touch.most},
                                      {"coarse", touch.coarse}}) {
      require("contact", std::isfinite(value) && value >= 0,
              std::string(name) + " must be finite and not negative");
    }
    system.mass = added(system.mass, touch.mass, touch);
    system.damping = added(system.damping, touch.damping, touch);
    return system;
  }
  static SampledLoop with_damper(SampledLoop loop, Eigen::Index n, const Touch& touch) {
    if (touch.damping == 0) return loop;
    if (loop.friction.size() == 0) loop.friction = MatrixXd::Zero(n, n);
    loop.friction = added(loop.friction, touch.damping, touch);
    return loop;
  }
  Trial solve(const SampledDataModel& model, const MatrixXd& units, double stiffness) const {
    MatrixXd A = model.on_other_motions(model.transition(), units);
    return Trial::solve(stiffness, A, slowest_);
  }

  double period_, slowest_;
  SampledDataModel free_, touched_{free_};
  MatrixXd units_[2];  ///< SampledDataModel::unit_motions of the two
  VectorXd a_;         ///< a' y T is the deflection of the touch, y in the coordinates of free_
};

/// The least damped motion of a trial; a ratio is negative if the motion grows.
ContactPoint point_of(const Trial& trial, double period) {
  ContactPoint point{trial.factor, 1, 0};
  for (const Complex z : trial.values) {
    if (z == 0.0) continue;
    const Complex lambda(0.5 * std::log(std::norm(z)), std::arg(z));  // faster than std::log(z)
    const double ratio = -lambda.real() / std::max(modulus(lambda), kEps);
    if (ratio < point.damping_ratio) point = {trial.factor, ratio, modulus(lambda) / period};
  }
  return point;
}

double least_ratio(const Trial& trial) {
  return point_of(trial, 1).damping_ratio;
}

/// Looks for an unstable stiffness where the least ratio has its minimum between trials, by
/// golden section. Returns the last trial, unstable or not.
Trial look_between(const TouchedLoop& loop, double low, double high) {
  constexpr double kGolden = 0.381966;
  constexpr int kLooks = 5;
  Trial a = loop.at(low * std::pow(high / low, kGolden));
  Trial b = loop.at(low * std::pow(high / low, 1 - kGolden));
  for (int i = 0; i < kLooks && a.excess < 0 && b.excess < 0; ++i) {
    if (least_ratio(a) < least_ratio(b)) {
      high = b.factor;
      b = a;
      a = loop.at(low * std::pow(high / low, kGolden));
    } else {
      low = a.factor;
      a = b;
      b = loop.at(low * std::pow(high / low, 1 - kGolden));
    }
  }
  return a.excess < 0 ? b : a;
}

/// Looks for an unstable stiffness near which the touch alone would turn by `turn`, a multiple of
/// pi, in a tick: there the two eigenvalues of its motion meet on the real axis, and one of them
/// may leave the circle, in a band much narrower than a step. Returns a stable trial below it and
/// the last trial, unstable or not.
std::array<Trial, 2> look_at_axis(const TouchedLoop& loop, double turn) {
  constexpr double kAround = 0.3;  // rad
  constexpr int kLooks = 6;
  constexpr double kMet = 1e-7;  // rad, where the eigenvalues are one
  const double unit = loop.stiffness_at(1 / loop.period());
  const auto at = [&](double angle) { return loop.at(angle * angle * unit); };
  const auto distance = [&](const Trial& trial) {
    Eigen::Index nearest = 0;
    const Complex there = std::polar(1.0, std::sqrt(trial.factor / unit));
    (trial.values.array() - there).abs2().minCoeff(&nearest);
    return std::abs(std::arg(std::cos(turn) * trial.values[nearest]));
  };
  Trial low = at(turn - kAround);
  if (low.excess >= 0 || low.values.size() == 0) return {low, low};
  Trial last = low;
  double begin = turn - kAround, end = turn + kAround;
  double before = distance(low), after = distance(at(end));
  for (int i = 0; i < kLooks; ++i) {
    const double angle = begin + (end - begin) * before / std::max(before + after, kEps);
    last = at(angle);
    const double now = distance(last);
    if (last.excess >= 0 || now < kMet) break;
    // the motion turns about as the touch alone would
    if (std::abs(now - before + (angle - begin)) < std::abs(now - after + (end - angle))) {
      begin = angle, before = now;
    } else {
      end = angle, after = now;
    }
  }
  return {low, last};
}

/// Returns the next stiffness that is tried: kLeap times the last one up to `coarse`, then 2.25
/// times, or less where that takes the touch further than a turn of `kMostTurn` rad a tick.
double next_stiffness(const TouchedLoop& loop, double last, double first, double coarse) {
  constexpr double kLeap = 16;
  constexpr double kMostTurn = 0.5;  // rad
  constexpr double kRatio = 1.5;     // factor on the frequency of the touch
  if (last < first) return first;
  if (last < coarse) return std::min(kLeap * last, std::max(coarse, first));
  const double turn = std::sqrt(last / loop.stiffness_at(1 / loop.period()));
  const double next = std::min(kRatio * turn, turn + kMostTurn);
  return last * (next / turn) * (next / turn);
}

/// Sets the first boundary.
void find_limit(const TouchedLoop& loop, const Touch& touch, ContactLimit& result) {
  constexpr double kSlowTouch = 3;     // rad/s, with which the search begins
  constexpr double kSmallRatio = 0.1;  // below which a minimum between trials may be below zero
  const double first = loop.stiffness_at(kSlowTouch);
  std::array<Trial, 2> before{loop.at(touch.coarse > 0 ? first : 0), {-1, 0}};
  if (!(before[0].excess < 0) && touch.coarse > 0) before[0] = loop.at(0);
  result.stiffness = before[0].excess < 0 ? kInfinity : 0;
  while (result.stiffness > 0 && before[0].factor < touch.most) {
    Trial here =
        loop.at(std::min(touch.most, next_stiffness(loop, before[0].factor, first, touch.coarse)));
    if (here.excess < 0 && before[1].factor > 0 && before[0].values.size() > 0) {
      const double middle = least_ratio(before[0]);
      if (middle < kSmallRatio && middle < least_ratio(before[1]) && middle <= least_ratio(here)) {
        Trial found = look_between(loop, before[1].factor, here.factor);
        if (!(found.excess < 0)) {
          here = found;
          if (here.factor < before[0].factor) before[0] = before[1];
        }
      }
    }
    const double turns = loop.half_turns(here.factor);
    if (turns > loop.half_turns(before[0].factor) && here.values.size() > 0) {
      const auto [low, found] = look_at_axis(loop, std::numbers::pi * turns);
      const bool sooner = here.excess < 0 || found.factor < here.factor;
      if (low.excess < 0 && !(found.excess < 0) && sooner) {
        before[0] = low;
        here = found;
      }
    }
    if (!(here.excess < 0)) {
      result.stiffness = boundary(loop, before[0], here);
      if (result.stiffness > touch.most) result.stiffness = kInfinity;
      return;
    }
    before = {here, before[0]};
  }
}

/// Sets the frequency of the motion that grows beyond a boundary, and interpolates the boundary.
void polish(const TouchedLoop& loop, ContactLimit& result) {
  constexpr double kAside = 1e-6;
  constexpr double kSame = 1e-3;  // distance of one eigenvalue on both sides
  const double k = result.stiffness;
  Trial beyond = loop.solve((1 + kAside) * k), before = loop.solve((1 - kAside) * k);
  if (!(beyond.excess > 0 && before.excess < 0)) return;
  const Complex z = beyond.follow(0);
  result.frequency = modulus(std::log(z)) / loop.period();
  if (!(modulus(before.follow(z) - z) < kSame)) return;
  const double a = beyond.excess, b = before.excess;
  result.stiffness *= 1 - kAside * (a + b) / (a - b);
}

/// Sets the nearest stiffnesses on both sides of a boundary at which the verdict is proved.
void prove(const TouchedLoop& loop, ContactLimit& result) {
  constexpr double kNearest = 1e-6, kFurthest = 0.02;
  for (const bool stable : {true, false}) {
    for (double off = kNearest; off < kFurthest; off *= 10) {
      const double there = result.stiffness * (stable ? 1 - off : 1 + off);
      if (!loop.proves(there, stable)) continue;
      (stable ? result.lower : result.upper) = there;
      break;
    }
  }
}

}  // namespace

ContactLimit contact_limit(const System<>& system, const Spectrum<>& spectrum,
                           const SampledLoop& loop, const Touch& touch, bool proved) {
  const TouchedLoop touched(system, spectrum, loop, touch);
  ContactLimit result;
  find_limit(touched, touch, result);
  const bool none = std::isinf(result.stiffness);
  result.stable_if_rigid = !(none && touch.coarse > 0) && touched.stable_if_rigid();
  if (!(result.stiffness > 0) || none) {
    result.lower = result.upper = result.stiffness;
    return result;
  }
  if (proved || !touched.counted()) polish(touched, result);
  if (proved) prove(touched, result);
  return result;
}

std::vector<ContactPoint> contact_curve(const System<>& system, const Spectrum<>& spectrum,
                                        const SampledLoop& loop, const Touch& touch,
                                        const std::vector<double>& stiffness) {
  const TouchedLoop touched(system, spectrum, loop, touch);
  std::vector<ContactPoint> points;
  for (const double k : stiffness) {
    require("contact", std::isfinite(k) && k >= 0, "stiffness must be finite and not negative");
    points.push_back(point_of(touched.solve(k), touched.period()));
  }
  return points;
}

}  // namespace dashpot::analysis
