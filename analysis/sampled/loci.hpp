#pragma once
// Where a root of a sampled loop crosses the unit circle, whatever the delay.

#include <dashpot/analysis/types.hpp>

#include <functional>
#include <vector>

namespace dashpot::analysis {

/// The upper half of the border of what counts as unstable, as zeta = log z:
///     |zeta| = slowest from the real axis up, then the unit circle from there to z = -1.
/// Unstable is what lies outside the unit circle with |log z| above `slowest`. The parameter is the
/// angle on the arc, and then pi/2 + log(angle / slowest).
class Border {
 public:
  explicit Border(double slowest) : slowest_(slowest) {}
  double end() const;
  Complex at(double t) const;

 private:
  double slowest_;
};

/// A factor s for which  det(I + s h(z) R(z)) = 0  on the border.
struct Crossing {
  double factor = 0;
  /// Roots (a pair, or one on the real axis) that leave the stable region as s grows; negative if
  /// they enter it.
  int leaving = 0;
  // Where it was found, to be refined:
  double t = 0;
  Complex log_value;  ///< of the eigenvalue of R
  Complex rate;       ///< of the logarithm, by t
  double slope = 0;   ///< of its phase and that of h, by t
  bool exact = false;
};

/// The eigenvalues of R(z) along the border. They move slowly, because R is the open loop without
/// its delay and filter; h, a scalar, has all the phase of these. So the number of eigenproblems
/// does not depend on the delay.
class Loci {
 public:
  using Values = std::function<Eigen::VectorXcd(Complex zeta)>;
  using LogActuation = std::function<Complex(Complex zeta)>;

  /// `values` returns the eigenvalues of R(e^zeta), or no entries where none of them matters.
  Loci(const Border& border, Values values, LogActuation log_actuation)
      : border_(border), values_(std::move(values)), log_actuation_(std::move(log_actuation)) {}

  /// Returns all crossings with factors up to `most`, or, where there are crossings with factors
  /// above 1, all up to the least of these; the factors are good to about a percent.
  std::vector<Crossing> crossings(double most) const;
  /// Returns the crossing with a factor good to about 1e-10.
  Crossing refined(Crossing crossing) const;

 private:
  struct Piece;
  void scan(const Piece& piece, std::vector<Crossing>& found) const;
  void scan_end(double t, const Piece& piece, std::vector<Crossing>& found) const;

  Border border_;
  Values values_;
  LogActuation log_actuation_;
};

}  // namespace dashpot::analysis
