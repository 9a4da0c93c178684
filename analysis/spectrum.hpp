#pragma once
#include <dashpot/analysis/spectrum/enclosure.hpp>
#include <dashpot/analysis/spectrum/spectrum_result.hpp>
#include <dashpot/analysis/work.hpp>

namespace dashpot::analysis {

struct SpectrumOptions {
  /// Modes with a natural frequency below this are called soft, rad/s.
  double soft_frequency = 1e-6;
  /// Precision of the residuals: working precision (kWorking), twice that (kExtended), or
  /// kAutomatic. kAutomatic evaluates in working precision first. It then evaluates all modes in
  /// extended precision if for one of them the proved bound exceeds `target_bound` times
  /// |lambda_1| + |lambda_2|, the backward error exceeds 2e-14, or only the bound decides the kind
  /// (critical; undamped in spite of damping).
  enum class Residual { kAutomatic, kWorking, kExtended } residual = Residual::kAutomatic;
  double target_bound = 1e-10;  ///< relative, no unit
};

/// Computes spectra of systems of up to N coordinates, in storage of its own.
template <int N = kDynamic>
class SpectrumSolver {
 public:
  explicit SpectrumSolver(SpectrumOptions options = {}) : options_(options) {}

  /// Analyses `system` into `out` and returns out.status. The work is bounded (see
  /// hessenberg_eigenvalues; four bases at most, 9 refinement steps each). For a fixed N there is
  /// no allocation. On a status other than kOk and kUncertified `out` has no modes.
  Status solve(const System<N>& system, Spectrum<N>& out) noexcept {
    Work work;
    return solve(system, out, work);
  }
  /// Does the same with no more work than `work` grants; the status is kUnfinished if that is not
  /// enough.
  Status solve(const System<N>& system, Spectrum<N>& out, Work& work) noexcept;

 private:
  Status find_modes(const System<N>& system, Spectrum<N>& out, Work& work) noexcept;
  bool good(const Spectrum<N>& spectrum) const noexcept;
  /// Evaluates the basis, bounds its errors and reads the modes; improves the basis while that
  /// helps.
  void refine(const System<N>& system, Spectrum<N>& out, Work& work) noexcept;

  SpectrumOptions options_;
  bool damped_ = true;
  BasisResidual<N> residual_;
  BlockEnclosure<N> enclosure_;
  ModalBasis<N> before_step_;
};

/// Validates the system (throws InvalidSystem), solves it, and returns the spectrum, whose status
/// is kOk or kUncertified. This is the function to start with. Throws std::runtime_error if the
/// solver fails.
Spectrum<> analyze(const System<>& system, const SpectrumOptions& options = {});

}  // namespace dashpot::analysis
