#pragma once
#include <dashpot/analysis/damping_target.hpp>
#include <dashpot/analysis/status.hpp>
#include <dashpot/analysis/types.hpp>

#include <array>

namespace dashpot::analysis {

/// Number of task directions: three linear, then three angular.
inline constexpr int kTaskDirections = 6;

/// K_C, C_C: 6 x 6
using TaskMatrix = Eigen::Matrix<double, kTaskDirections, kTaskDirections>;
/// J: 6 x n
template <int N>
using TaskJacobian =
    Eigen::Matrix<double, kTaskDirections, Eigen::Dynamic, Eigen::ColMajor, kTaskDirections, N>;

/// Computes the damping matrix C_C with which every mode of an impedance-controlled arm keeps its
/// target ratio, in the control loop. For mass M (n x n), Jacobian J (6 x n) and task stiffness
/// K_C = F F', it is the one C_C in the range of K_C with which  M q'' + J' C_C J q' + J' K_C J
/// q = 0  has the damping ratios of the target.
///
/// With M = L L' and the singular value decomposition F' J L^-T = U diag(omega) V',
///
///     C_C = F U diag(c(omega)) U' F',    c = 2 zeta / omega,
///
/// by one-sided Jacobi rotations of the columns of L^-1 J' F, and of the columns of F with them.
/// Neither the task-space inertia nor any square of a frequency is formed. For one zeta C_C is 2
/// zeta (Lambda # K_C), the geometric mean with the task-space inertia Lambda.
///
/// C_C is symmetric and positive semidefinite to rounding. It is continuously differentiable in M,
/// J and K_C (as long as the rank of K_C stays the same), also where modes cross. It is bounded:
/// |C_C| <= 2 max(zeta) kPeak |K_C| / soft_frequency, whatever the singularity. Directions that K_C
/// leaves free, or that no joint moves, get no damping.
///
/// With viscous friction D = diag(d) in the joints, the damping by friction is subtracted:
///     C_C = F U R U' F',    R as in modal_damping.hpp.
/// This is exact for six joints and directions. The friction of a redundant arm couples vibrations
/// with free motions as well, and the ratios are then right to first order in that coupling. Where
/// friction is more than is wanted, C_C is a semidefinite matrix near the exact one, and `overdone`
/// says so. Its bound is larger than the bound without friction by a factor of a few.
///
/// For fewer task directions, leave rows of J and K_C zero. Nothing here allocates or throws, and
/// the work is bounded. Each step starts from the rotations of the last one, which changes the
/// result by rounding only.
class RatioDamping {
 public:
  explicit RatioDamping(const DampingTarget& target = {}) noexcept : target_(target) {}

  void set_target(const DampingTarget& target) noexcept { target_ = target; }
  const DampingTarget& target() const noexcept { return target_; }

  /// Sets d, n, N m s/rad, not negative; without entries: none.
  void set_friction(const Vector<kMaxDof>& friction) noexcept { friction_ = friction; }

  /// Factors K_C, of which only the lower triangle is read. On kStiffnessIndefinite or kNotFinite
  /// the previous stiffness stays.
  Status set_stiffness(const TaskMatrix& K_C) noexcept;

  /// Computes C_C for the present M (of which the lower triangle is read) and J. On any status but
  /// kOk `C_C` keeps its value. kNotConverged cannot be excluded, but was never seen.
  template <int N>
  Status update(const Square<N>& M, const TaskJacobian<N>& J, TaskMatrix& C_C) noexcept;

  /// True if friction was too much for the target at the last good update.
  bool overdone() const noexcept { return overdone_; }

  /// Returns the undamped frequencies of the last good update, rad/s, in no order. Directions
  /// without stiffness or motion are included, with zero frequencies.
  const std::array<double, kTaskDirections>& frequencies() const noexcept { return frequencies_; }

  /// One row of a six-column matrix, as the left and right partners of three pairs of columns; the
  /// fourth lane is empty.
  struct alignas(64) PairedRow {
    std::array<double, 4> left{};
    std::array<double, 4> right{};
  };
  using PairedRows = std::array<PairedRow, kTaskDirections>;

 private:
  DampingTarget target_;
  Vector<kMaxDof> friction_;
  bool overdone_ = false;
  PairedRows factor_{};   // F
  PairedRows rotated_{};  // F U of the last update
  int updates_ = 0;       // since rotated_ was F
  std::array<double, kTaskDirections> frequencies_{};
};

}  // namespace dashpot::analysis
