#pragma once
// The first value of a parameter at which a sampled loop loses its stability.

#include <dashpot/analysis/base/arithmetic.hpp>
#include <dashpot/analysis/sampled/sampled_data_model.hpp>

#include <algorithm>
#include <cmath>

namespace dashpot::analysis {

/// Loops with more states are counted, not solved, which takes longer for fewer of them.
inline constexpr Eigen::Index kDenseRows = 100;

/// A factor and the excess there, and the eigenvalues that count, where they are solved.
struct Trial {
  double factor, excess = 0;
  Eigen::VectorXcd values = {};

  /// Solves the transition A of a tick, which is destroyed. The excess is the largest |z|, less 1:
  /// the loop is stable if it is negative. Motions with |log z| below `slowest`, per tick, do not
  /// count. Throws std::runtime_error.
  static Trial solve(double factor, Eigen::MatrixXd& A, double slowest) {
    Trial trial{factor, 0, eigenvalues_of(A)};
    Eigen::Index count = 0;
    for (const Complex z : Eigen::VectorXcd(trial.values)) {
      const bool near = slowest > 0 && modulus(z - 1.0) < std::expm1(slowest);
      if (near && z != 0.0 && modulus(std::log(z)) < slowest) continue;
      trial.values[count++] = z;
      trial.excess = std::max(trial.excess, modulus(z));
    }
    trial.values.conservativeResize(count);
    trial.excess -= 1;
    return trial;
  }

  /// Takes the excess of the eigenvalue nearest to `z`, and returns that: it changes smoothly with
  /// the factor, where the largest of all has kinks. A trial that is not stable has the largest.
  Complex follow(Complex z) {
    if (values.size() == 0) return z;
    Eigen::Index at = 0;
    if (!(excess < 0)) {
      values.cwiseAbs2().maxCoeff(&at);
      return values[at];
    }
    (values.array() - z).abs2().minCoeff(&at);
    excess = modulus(values[at]) - 1;
    return values[at];
  }
};

/// Where the excess of loop.at(factor) changes its sign between two trials, to 1e-7 of the factor:
/// inverse quadratic interpolation where it is safe, bisection elsewhere (Chandrupatla 1997).
template <class Loop>
double boundary(const Loop& loop, Trial inside, Trial outside) {
  constexpr double kPrecision = 0.5e-7;
  Complex z = outside.follow(0);
  inside.follow(z);
  Trial a = outside, b = inside, c = inside;
  double share = 0.5;  // of the way from a to b
  const double secant = a.excess / (a.excess - b.excess);
  if (secant > 0 && secant < 1) share = secant;
  for (;;) {
    const double least = kPrecision * outside.factor / std::abs(b.factor - a.factor);
    if (least > 0.5) return 0.5 * (a.factor + b.factor);
    share = std::clamp(share, least, 1 - least);
    Trial next = loop.at(a.factor + share * (b.factor - a.factor));
    z = next.follow(z);
    if ((next.excess < 0) == (a.excess < 0)) {
      c = a;
    } else {
      c = b;
      b = a;
    }
    a = next;
    const double xi = (a.factor - b.factor) / (c.factor - b.factor);
    const double phi = (a.excess - b.excess) / (c.excess - b.excess);
    share = 0.5;
    if (phi * phi < xi && (1 - phi) * (1 - phi) < 1 - xi) {
      const double ab = a.excess - b.excess, ac = a.excess - c.excess, bc = b.excess - c.excess;
      share = a.excess / -ab * c.excess / bc +
              (c.factor - a.factor) / (b.factor - a.factor) * a.excess / -ac * b.excess / -bc;
    }
  }
}

}  // namespace dashpot::analysis
