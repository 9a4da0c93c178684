#pragma once
#include <dashpot/analysis/damping_target.hpp>
#include <dashpot/analysis/spectrum/spectrum_result.hpp>
#include <dashpot/analysis/task_space.hpp>

#include <optional>
#include <vector>

namespace dashpot::analysis {

/// A mode whose ratio is not the one wanted.
struct DampingMiss {
  /// Why it cannot be had, as far as it is known.
  enum class Reason {
    kSoft,       ///< slower than the target's soft frequency: next to a singularity
    kOverdone,   ///< what is there already damps some direction more than is wanted
    kStructure,  ///< no matrix of the structure asked for was found that gives it
    kCoupling,   ///< what is there already couples modes, and no exact matrix was found
    kLoop,       ///< period and delay of the loop do not bear more (damping_sampled.hpp)
  };
  int mode = 0;                  ///< index in the spectrum
  double natural_frequency = 0;  ///< rad/s
  double wanted = 0;
  double obtained = 0;
  Reason reason = Reason::kSoft;
};

/// "soft", "overdone", ...
const char* to_text(DampingMiss::Reason reason) noexcept;

/// A damping matrix, which is always positive semidefinite, and what it does.
struct DampingDesign {
  /// C_C, m x m, where the stiffness is given in task space; C, n x n, where it is given in joint
  /// space only. It comes on top of the damping that is there already.
  Eigen::MatrixXd damping;
  System<> system;      ///< with all damping
  Spectrum<> spectrum;  ///< of it
  /// Empty if every mode has its ratio to 1e-9, or to the proved bound of its computed ratio where
  /// that is larger.
  std::vector<DampingMiss> misses;
  /// Where misses are kOverdone: the most negative eigenvalue (1/s, mass-normalised modal
  /// coordinates) of the exact answer, which therefore is no damping matrix; zero otherwise.
  double indefinite_by = 0;
};

/// Full damping matrix that gives every mode its target ratio, where the stiffness K_C = F F' and
/// the Jacobian J are those of `impedance`, on top of its `damping` D (joint friction, null-space
/// damping). An impedance without jacobian is designed in joint space: J = I, K_C = stiffness.
///
/// With M = L L' and F' J L^-T = U diag(omega) V':
///
///     C_C = F U S T S U' F',   S = diag(1 / omega),   T = diag(2 zeta omega) - V' L^-1 D L^-T V.
///
/// Without D this is exact. With a D that couples the zero modes, or with a joint stiffness besides
/// K_C, it is the start of a Newton iteration to the exact answer. Where T is not positive
/// semidefinite, no PSD matrix decouples the modes with these ratios; T is then replaced by the PSD
/// matrix nearest to it in the Frobenius norm, that is: of all PSD matrices the one is given whose
/// total damping comes nearest to the wanted in mass-normalised modal coordinates, and `misses`
/// says by how much each mode misses.
///
/// Soft modes (see DampingTarget) are damped less, so that
/// |C_C| <= 2 max(zeta) kPeak |K_C| / soft_frequency. Directions that K_C leaves free get no
/// damping. Computed in extended precision (long double). A `task_damping` in the impedance is
/// ignored.
///
/// Throws InvalidSystem as damping_sample does, and for a stiffness that is not positive
/// semidefinite; std::invalid_argument for a ratio that is negative or not finite.
DampingDesign design_damping(const TaskImpedance& impedance, const DampingTarget& target);

/// The same with the entries outside `structure` zero, or with a damping matrix near `start` (a
/// positive semidefinite one that the user likes), or both. There is no closed form: a search along
/// the sensitivities (DampingFit) starts from `start`, or from what the exact answer has inside the
/// structure, and ends at a solution near it. Where it finds none, the sum of the squared
/// differences of ratios is (locally) least, and `misses` names the modes.
DampingDesign design_damping(const TaskImpedance& impedance, const DampingTarget& target,
                             DampingStructure structure,
                             const std::optional<Eigen::MatrixXd>& start = {});

/// The impedance with `damping` for its C_C, or added to its joint damping if it has no jacobian.
TaskImpedance with_damping(const TaskImpedance& impedance, const Eigen::MatrixXd& damping);

/// The modes of `spectrum` that miss `target`, with `reason` for those that are not soft.
std::vector<DampingMiss> find_misses(const Spectrum<>& spectrum, const DampingTarget& target,
                                     DampingMiss::Reason reason);

/// The eigenvalues of a symmetric matrix that are negative beyond rounding, rising: a damping
/// matrix that has any feeds energy in.
Eigen::VectorXd negative_eigenvalues(const Eigen::MatrixXd& damping);

}  // namespace dashpot::analysis
