#pragma once
#include <dashpot/analysis/matrix_types.hpp>

#include <array>
#include <limits>

namespace dashpot::analysis {

/// Kind of a mode. The proved bounds decide it, or the computed numbers alone if no bound could be
/// proved.
enum class ModeKind {
  kUnderdamped,  ///< a complex pair, 0 < zeta < 1
  kCritical,     ///< a double real eigenvalue, as far as the error bound can tell
  kOverdamped,   ///< two real eigenvalues
  kUndamped,     ///< a purely imaginary pair, as far as the error bound can tell
  kUnstable,     ///< an eigenvalue with positive real part, beyond its error bound
  kSoft,         ///< below SpectrumOptions::soft_frequency, or without a frequency because an
                 ///< eigenvalue may be zero: its damping ratio means nothing
  kAlternating,  ///< of a sampled loop: it changes its sign with every tick
};

/// Returns "underdamped", "critical", ...
const char* to_text(ModeKind kind) noexcept;

/// Where a spectrum comes from.
enum class SpectrumOrigin {
  kTracked,  ///< the previous spectrum, refined
  kReused,   ///< the previous spectrum, because the system is the same to the last bit
  kDirect,   ///< solved directly
};

/// The numbers that follow from a mode's two eigenvalues.
struct ModeNumbers {
  /// A complex pair (positive imaginary part first) or two real ones (slower, nearer zero, first),
  /// 1/s
  std::array<Complex, 2> eigenvalues{};
  /// sqrt(lambda_1 lambda_2), rad/s; NaN if the product is negative (static instability)
  double natural_frequency = 0;
  /// -(lambda_1 + lambda_2) / (2 natural_frequency); above 1 if overdamped
  double damping_ratio = 0;
  /// Imaginary part of the first eigenvalue, rad/s; zero if real
  double damped_frequency = 0;
  ModeKind kind = ModeKind::kUnderdamped;
  /// Proved bounds of |computed - true|; infinite if none could be proved. They are also infinite
  /// where frequencies leave 1e-60 .. 1e60 rad/s or masses 1e-120 .. 1e120, because underflow is
  /// not counted there.
  /// Bound of either eigenvalue, 1/s (the distance of the computed from the nearest true one).
  double error_bound = std::numeric_limits<double>::infinity();
  /// Bound of each eigenvalue, 1/s; error_bound is the larger one.
  std::array<double, 2> eigenvalue_bounds = {std::numeric_limits<double>::infinity(),
                                             std::numeric_limits<double>::infinity()};
  double natural_frequency_bound = std::numeric_limits<double>::infinity();  ///< rad/s
  double damping_ratio_bound = std::numeric_limits<double>::infinity();
};

/// One vibration mode: a pair of eigenvalues of  (lambda^2 M + lambda C + K) u = 0.
template <int N = kDynamic>
struct Mode : ModeNumbers {
  /// Right eigenvectors u of the two eigenvalues in joint coordinates, n each, u^H M u = 1, largest
  /// entry real and positive. At critical damping both are the only eigenvector.
  std::array<ComplexVector<N>, 2> shapes;
  /// Left eigenvectors y, y^T (lambda^2 M + lambda C + K) = 0; equal to `shapes` if symmetric.
  std::array<ComplexVector<N>, 2> left_shapes;
  /// Normwise backward error of the worse eigenpair (Tisseur 2000):
  /// |Q(lambda) u| / ((|lambda|^2 |M| + |lambda| |C| + |K|) |u|), Frobenius norms of the
  /// coefficients
  double backward_error = 0;
  /// Condition number of the worse eigenvalue in the same measure (Tisseur 2000); infinite at
  /// critical damping
  double condition = 0;
  /// Columns of ModalBasis::U that span the mode's plane; equal if it shares a larger block.
  std::array<int, 2> columns{};
};

template <int N>
using ModeList = BoundedList<Mode<N>, N>;

}  // namespace dashpot::analysis
