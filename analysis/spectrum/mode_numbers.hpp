#pragma once
// From two eigenvalues with proved bounds to the numbers of a mode.

#include <dashpot/analysis/mode.hpp>

#include <limits>

namespace dashpot::analysis {

/// Bounds on the sum and product of a mode's two eigenvalues, and on their discriminant
/// ((lambda_1 - lambda_2) / 2)^2.
struct Invariants {
  double sum = 0, product = 0, discriminant = 0;
  double sum_error = std::numeric_limits<double>::infinity();
  double product_error = std::numeric_limits<double>::infinity();
  double discriminant_error = std::numeric_limits<double>::infinity();
};

/// Returns the invariants of the block L = [l00 l01; l10 l11] (1/s), which is known to be within
/// `rho` (Frobenius norm) of the exact one.
Invariants block_invariants(double l00, double l01, double l10, double l11, double rho) noexcept;

/// An eigenvalue and a bound of its error, 1/s.
struct Root {
  Complex value;
  double bound = std::numeric_limits<double>::infinity();
};

/// Returns the invariants of two eigenvalues of which no more is known.
Invariants root_invariants(const Root& a, const Root& b) noexcept;

/// Returns the numbers of a mode. `first` has the positive imaginary part if the two eigenvalues
/// are complex. Modes below `soft_frequency` (rad/s) are called soft.
ModeNumbers mode_numbers(const Root& first, const Root& second, const Invariants& invariants,
                         double soft_frequency) noexcept;

/// Returns error bound / (|lambda_1| + |lambda_2|), infinite if there is none. At critical damping
/// it is the bound of the frequency, because eigenvalues are worth half the digits there.
double relative_bound(const ModeNumbers& mode) noexcept;

}  // namespace dashpot::analysis
