#pragma once
#include <dashpot/analysis/borne_damping.hpp>
#include <dashpot/analysis/damping_target.hpp>
#include <dashpot/analysis/matrix_types.hpp>
#include <dashpot/analysis/solver_status.hpp>

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

/// Computes the damping matrix with which every mode of an impedance-controlled arm keeps its
/// target ratio, in the control loop. For mass M (n x n), and k springs of stiffness K = F F' whose
/// deflections have the Jacobian J (k x n), it is the one C (k x k) in the range of K with which
/// M q'' + J' C J q' + J' K J q = 0  has the damping ratios of the target. The springs act in the
/// task (K_C, C_C, k = 6), or in the joints (k = n, J the identity); n and k are at most 16.
///
/// With M = L L' and the singular value decomposition F' J L^-T = U diag(omega) V',
///
///     C = F U diag(c(omega)) U' F',    c = 2 zeta / omega,
///
/// by one-sided Jacobi rotations of the columns of L^-1 J' F, and of the columns of F with them.
/// Neither the task-space inertia nor any square of a frequency is formed. For one zeta C is 2 zeta
/// (Lambda # K), the geometric mean with the inertia Lambda that the springs feel.
///
/// C is symmetric and positive semidefinite to rounding. It is continuously differentiable in M, J
/// and K (as long as the rank of K stays the same), also where modes cross. It is bounded:
/// |C| <= 2 max(zeta) kPeak |K| / soft_frequency, whatever the singularity. Directions that K
/// leaves free, or that no joint moves, get no damping.
///
/// With viscous friction D = diag(d) in the joints, the damping by friction is subtracted:
///     C = F U R U' F',    R as in modal_damping.hpp.
/// This is exact for as many joints as springs. The friction of a redundant arm couples vibrations
/// with free motions as well, and the ratios are then right to first order in that coupling. If
/// friction exceeds the wanted damping, C is a semidefinite matrix near the exact one, and
/// `overdone` is true. Its bound is larger than the bound without friction by a factor of a few.
///
/// For a sampled loop (`set_loop`) each mode gets the share of its damping 2 zeta omega that the
/// loop tolerates, see BorneDamping. C is then continuous, with kinks where the share leaves 1.
///
/// For fewer task directions, leave rows of J and K_C zero. Nothing here allocates or throws (as
/// long as matrices, not expressions, are passed), and the work is bounded. Each step starts from
/// the rotations of the last one, which changes the result by rounding only.
class RatioDamping {
 public:
  using ConstMatrix = Eigen::Ref<const Eigen::MatrixXd>;

  explicit RatioDamping(const DampingTarget& target = {}) noexcept : target_(target) {}

  void set_target(const DampingTarget& target) noexcept { target_ = target; }
  const DampingTarget& target() const noexcept { return target_; }

  /// Sets d, n, N m s/rad, not negative; without entries: none.
  void set_friction(const Vector<kMaxDof>& friction) noexcept { friction_ = friction; }

  /// Sets the damping that the loop tolerates; the object has to outlive this; null: any damping.
  /// `in_force`, above 0 and at most 1, is the share of springs that are only partly active.
  void set_loop(const BorneDamping* borne, double in_force = 1) noexcept {
    borne_ = borne;
    in_force_ = in_force;
  }

  /// Factors K, of which only the lower triangle is read. On kWrongSize, kStiffnessIndefinite or
  /// kNotFinite the previous stiffness stays.
  Status set_stiffness(const ConstMatrix& K) noexcept;

  /// Computes C for the present M (of which the lower triangle is read) and J. On any status but
  /// kOk, `C`, which has to be k x k, keeps its value. kNotConverged cannot be excluded, but was
  /// never seen.
  Status update(const ConstMatrix& M, const ConstMatrix& J, Eigen::Ref<Eigen::MatrixXd> C) noexcept;
  /// Does the same for springs in the joints.
  Status update(const ConstMatrix& M, Eigen::Ref<Eigen::MatrixXd> C) noexcept;

  /// True if friction was too much for the target at the last good update.
  bool overdone() const noexcept { return overdone_; }
  /// The part of the target that the loop tolerated at the last good update.
  const DampingLevel& level() const noexcept { return level_; }

 private:
  using Factor = std::array<double, kMaxDof * kMaxDof>;  // by rows, see ratio_damping.cpp

  Status design(const ConstMatrix& M, const double* J, Eigen::Index stride,
                Eigen::Ref<Eigen::MatrixXd>& C) noexcept;

  DampingTarget target_;
  Vector<kMaxDof> friction_;
  Eigen::Index springs_ = 0;  // k
  int updates_ = 0;           // since rotated_ was F
  bool overdone_ = false;
  DampingLevel level_;
  const BorneDamping* borne_ = nullptr;
  double in_force_ = 1;
  alignas(64) Factor factor_{};   // F
  alignas(64) Factor rotated_{};  // F U of the last update
};

}  // namespace dashpot::analysis
