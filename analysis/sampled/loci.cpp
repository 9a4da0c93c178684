#include <dashpot/analysis/sampled/loci.hpp>

#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>

namespace dashpot::analysis {
namespace {

using Eigen::Index;
using Eigen::VectorXcd;

constexpr double kPi = std::numbers::pi;
/// Where the border turns from the arc to the circle, so that no step may pass it.
constexpr double kCorner = kPi / 2;
constexpr double kFirstStep = 0.02, kLongestStep = 0.25, kShortestStep = 1e-4;
/// Change of log(eigenvalue) in a step beyond what the last step lets expect.
constexpr double kLargestChange = 0.3;
/// Phase of h between two looks for a crossing.
constexpr double kLook = 0.5;
/// Factors above the one of interest by less are kept, because they are known to a percent.
constexpr double kMore = 1.05;

/// The difference of two logarithms with its imaginary part in (-pi, pi].
Complex turn(Complex difference) {
  return {difference.real(), std::remainder(difference.imag(), 2 * kPi)};
}

VectorXcd logs(const VectorXcd& values) {
  VectorXcd result(values.size());
  for (Index i = 0; i < values.size(); ++i) {
    result[i] = values[i] == 0.0 ? Complex(-700) : std::log(values[i]);
  }
  return result;
}

/// The differences between `from` and the nearest of `to`, nearest pairs first.
VectorXcd differences(const VectorXcd& from, const VectorXcd& to) {
  const Index count = from.size();
  VectorXcd result(count);
  std::vector<bool> used(static_cast<std::size_t>(count)), done(used);
  for (Index round = 0; round < count; ++round) {
    double least = std::numeric_limits<double>::infinity();
    Index at = 0, next = 0;
    for (Index i = 0; i < count; ++i) {
      for (Index j = 0; j < count && !done[static_cast<std::size_t>(i)]; ++j) {
        const double distance = std::norm(turn(to[j] - from[i]));
        if (!used[static_cast<std::size_t>(j)] && distance < least)
          least = distance, at = i, next = j;
      }
    }
    done[static_cast<std::size_t>(at)] = used[static_cast<std::size_t>(next)] = true;
    result[at] = turn(to[next] - from[at]);
  }
  return result;
}

/// Odd multiple of pi below or at a phase: its number.
double odd_below(double phase) {
  return std::floor((phase - kPi) / (2 * kPi));
}

}  // namespace

double Border::end() const {
  return kCorner + std::log(kPi / slowest_);
}

Complex Border::at(double t) const {
  if (t <= 0) return slowest_;
  if (t < kCorner) return std::polar(slowest_, t);
  return {0, t >= end() ? kPi : slowest_ * std::exp(t - kCorner)};
}

/// One eigenvalue from t to t + length.
struct Loci::Piece {
  double t, length;
  Complex log_value, change;
  double most;  ///< largest factor that counts
  bool starts, ends;
};

void Loci::scan_end(double t, const Piece& piece, std::vector<Crossing>& found) const {
  // Where z is real so is R: an eigenvalue that is negative there is a real root.
  const double share = t > piece.t ? 1 : 0;
  const Complex value = piece.log_value + share * piece.change + log_actuation_(border_.at(t));
  const double off = std::remainder(value.imag() - kPi, 2 * kPi);
  const double factor = std::exp(-value.real());
  if (std::abs(off) > 1e-6 || factor > piece.most) return;
  const double inside = t > piece.t ? piece.t + 0.99 * piece.length : piece.t + 0.01 * piece.length;
  const Complex near = piece.log_value + (inside - piece.t) / piece.length * piece.change +
                       log_actuation_(border_.at(inside));
  const bool falls = (near.imag() > value.imag()) == (inside < t);
  found.push_back({factor, falls ? 1 : -1, t, value, 0, 0, true});
}

void Loci::scan(const Piece& piece, std::vector<Crossing>& found) const {
  const auto total = [&](double share) {
    return piece.log_value + share * piece.change +
           log_actuation_(border_.at(piece.t + share * piece.length));
  };
  const Complex begin = total(0), end = total(1);
  const double lag = end.imag() - begin.imag() - piece.change.imag();
  const double low = piece.starts ? 1e-7 : 0, high = piece.ends ? 1 - 1e-7 : 1;
  const int looks = 1 + static_cast<int>(std::abs(lag) / kLook);
  double left = low;
  Complex at_left = total(low);
  for (int k = 1; k <= looks; ++k) {
    const double right = low + (high - low) * k / looks;
    const Complex at_right = total(right);
    const double below = odd_below(at_left.imag()), above = odd_below(at_right.imag());
    if (below != above && std::exp(-std::max(at_left.real(), at_right.real())) <= piece.most) {
      const double odd = (2 * std::max(below, above) + 1) * kPi;
      double a = left, b = right;
      for (int i = 0; i < 40; ++i) {
        const double middle = 0.5 * (a + b);
        ((total(middle).imag() < odd) == (at_left.imag() < odd) ? a : b) = middle;
      }
      const double share = 0.5 * (a + b), factor = std::exp(-total(share).real());
      if (factor <= piece.most) {
        found.push_back({factor, above < below ? 2 : -2, piece.t + share * piece.length,
                         piece.log_value + share * piece.change, piece.change / piece.length,
                         (at_right.imag() - at_left.imag()) / ((right - left) * piece.length)});
      }
    }
    left = right, at_left = at_right;
  }
}

std::vector<Crossing> Loci::crossings(double most) const {
  std::vector<Crossing> found;
  const double end = border_.end();
  double t = 0, step = kFirstStep;
  VectorXcd here = logs(values_(border_.at(0))), rate = VectorXcd::Zero(here.size());
  while (t < end) {
    double next = std::min(t + step, t < kCorner ? kCorner : end);
    if (next > end - kShortestStep) next = end;
    const VectorXcd there = logs(values_(border_.at(next)));
    if (here.size() != there.size()) {  // one of them does not matter
      here = there, t = next, step = kFirstStep;
      rate = VectorXcd::Zero(here.size());
      continue;
    }
    const VectorXcd expected = (next - t) * rate;
    const VectorXcd beyond = differences(here + expected, there), change = expected + beyond;
    const double h_here = log_actuation_(border_.at(t)).real();
    const double h_there = log_actuation_(border_.at(next)).real();
    const double quiet = -std::log(most) - 1;
    const auto counts = [&](Index i) {
      return std::max(here[i].real() + h_here, here[i].real() + change[i].real() + h_there) > quiet;
    };
    double largest = 0;
    for (Index i = 0; i < here.size(); ++i) {
      if (counts(i)) largest = std::max(largest, modulus(beyond[i]));
    }
    if (largest > kLargestChange && next - t > 1.5 * kShortestStep) {
      step = std::max(0.5 * (next - t), kShortestStep);
      continue;
    }
    for (Index i = 0; i < here.size(); ++i) {
      if (!counts(i)) continue;
      const Piece piece{t, next - t, here[i], change[i], most, t == 0, next == end};
      if (piece.starts) scan_end(t, piece, found);
      scan(piece, found);
      if (piece.ends) scan_end(next, piece, found);
    }
    for (const Crossing& crossing : found) {
      if (crossing.factor > kMore) most = std::min(most, kMore * crossing.factor);
    }
    step = next == kCorner ? kFirstStep : std::min(kLongestStep, 1.5 * (next - t));
    rate =
        next == kCorner ? VectorXcd(VectorXcd::Zero(here.size())) : VectorXcd(change / (next - t));
    here += change, t = next;
  }
  return found;
}

Crossing Loci::refined(Crossing crossing) const {
  if (crossing.exact) return crossing;
  double t_before = 0, off_before = 0;
  for (int i = 0; i < 12; ++i) {
    const Complex zeta = border_.at(crossing.t);
    const VectorXcd values = logs(values_(zeta));
    if (values.size() == 0) break;
    Complex nearest = values[0];
    for (const Complex value : values) {
      if (std::norm(turn(value - crossing.log_value)) <
          std::norm(turn(nearest - crossing.log_value))) {
        nearest = value;
      }
    }
    crossing.log_value = nearest;
    const Complex total = nearest + log_actuation_(zeta);
    crossing.factor = std::exp(-total.real());
    const double off = std::remainder(total.imag() - kPi, 2 * kPi);
    if (i > 0 && off != off_before) crossing.slope = (off - off_before) / (crossing.t - t_before);
    t_before = crossing.t, off_before = off;
    if (crossing.slope == 0) break;
    const double step = std::clamp(-off / crossing.slope, -0.1, 0.1);
    crossing.t = std::clamp(crossing.t + step, 0.0, border_.end());
    crossing.log_value += (crossing.t - t_before) * crossing.rate;
    if (std::abs(step) < 1e-11 || crossing.t == t_before) break;
  }
  crossing.exact = true;
  return crossing;
}

}  // namespace dashpot::analysis
