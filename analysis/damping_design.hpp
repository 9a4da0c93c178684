#pragma once
#include <dashpot/analysis/damping_target.hpp>
#include <dashpot/analysis/spectrum/spectrum_result.hpp>
#include <dashpot/analysis/task_space.hpp>

#include <optional>
#include <vector>

namespace dashpot::analysis {

/// A mode that misses its target ratio.
struct DampingMiss {
  /// Why the mode misses its ratio, as far as the reason is known.
  enum class Reason {
    kSoft,       ///< slower than the target's soft frequency: next to a singularity
    kOverdone,   ///< the given damping damps some direction more than is wanted
    kStructure,  ///< no matrix of the requested structure was found that gives the ratio
    kCoupling,   ///< the given damping couples modes, and no exact matrix was found
    kLoop,       ///< period and delay of the loop allow no more (damping_sampled.hpp)
  };
  int mode = 0;                  ///< index in the spectrum
  double natural_frequency = 0;  ///< rad/s
  double wanted = 0;
  double obtained = 0;
  Reason reason = Reason::kSoft;
};

/// Returns "soft", "overdone", ...
const char* to_text(DampingMiss::Reason reason) noexcept;

/// A damping matrix, which is always positive semidefinite, and what it does.
struct DampingDesign {
  /// C_C, m x m, if the stiffness is given in task space; C, n x n, if the stiffness is given in
  /// joint space only. It is added to the given damping.
  Eigen::MatrixXd damping;
  System<> system;      ///< with all damping
  Spectrum<> spectrum;  ///< of `system`
  /// Empty if every mode has its ratio to 1e-9, or to the proved bound of its computed ratio if the
  /// bound is larger.
  std::vector<DampingMiss> misses;
  /// If misses are kOverdone: the most negative eigenvalue (1/s, mass-normalised modal coordinates)
  /// of the exact answer, which therefore cannot serve as a damping matrix; zero otherwise.
  double indefinite_by = 0;
};

/// Designs the full damping matrix that gives every mode its target ratio. The stiffness K_C = F F'
/// and the Jacobian J are taken from `impedance`. The matrix is added to the impedance's `damping`
/// D (joint friction, null-space damping). An impedance without jacobian is designed in joint
/// space: J = I, K_C = stiffness.
///
/// With M = L L' and F' J L^-T = U diag(omega) V':
///
///     C_C = F U S T S U' F',   S = diag(1 / omega),   T = diag(2 zeta omega) - V' L^-1 D L^-T V.
///
/// Without D this is exact. With a D that couples the zero modes, or with a joint stiffness in
/// addition to K_C, it is the start of a Newton iteration to the exact answer.
///
/// If T is not positive semidefinite, no PSD matrix decouples the modes with these ratios. T is
/// then replaced by the PSD matrix nearest to it in the Frobenius norm: of all PSD matrices, the
/// result is the one whose total damping is nearest to the wanted damping in mass-normalised modal
/// coordinates. `misses` says by how much each mode misses.
///
/// Soft modes (see DampingTarget) are damped less, so that |C_C| <= 2 max(zeta) kPeak |K_C| /
/// soft_frequency. Directions that K_C leaves free get no damping. The design is computed in
/// extended precision (long double). A `task_damping` in the impedance is ignored.
///
/// Throws InvalidSystem as damping_sample does, and for a stiffness that is not positive
/// semidefinite. Throws std::invalid_argument for a ratio that is negative or not finite.
DampingDesign design_damping(const TaskImpedance& impedance, const DampingTarget& target);

/// Designs a damping matrix whose entries outside `structure` are zero, or one near `start` (a
/// positive semidefinite matrix that the user likes), or both. A search along the derivatives
/// (DampingFit) does this, because there is no closed form. It starts from `start`, or from the
/// part of the exact answer inside the structure, and ends at a solution near its start. If it
/// finds none, `misses` names the modes. With a `start` the sum of the squared differences of
/// ratios is then (locally) least. Without one the smallest ratio, relative to its target, is
/// (locally) largest, and no smaller than with the part of the exact answer inside the structure.
DampingDesign design_damping(const TaskImpedance& impedance, const DampingTarget& target,
                             DampingStructure structure,
                             const std::optional<Eigen::MatrixXd>& start = {});

/// Returns the impedance with `damping` as its C_C, or added to its joint damping if it has no
/// jacobian.
TaskImpedance with_damping(const TaskImpedance& impedance, const Eigen::MatrixXd& damping);

/// Returns the modes of `spectrum` that miss `target`, with `reason` for those that are not soft.
std::vector<DampingMiss> find_misses(const Spectrum<>& spectrum, const DampingTarget& target,
                                     DampingMiss::Reason reason);

/// Returns the eigenvalues of a symmetric matrix that are negative beyond rounding, in rising
/// order. A damping matrix that has any feeds energy in.
Eigen::VectorXd negative_eigenvalues(const Eigen::MatrixXd& damping);

}  // namespace dashpot::analysis
