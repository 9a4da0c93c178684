#include <dashpot/analysis/base/arithmetic.hpp>
#include <dashpot/analysis/linalg/small_dense.hpp>
#include <dashpot/analysis/spectrum.hpp>
#include <dashpot/analysis/spectrum/modes.hpp>
#include <dashpot/analysis/spectrum/starting_basis.hpp>
#include <dashpot/analysis/system/energy_form.hpp>

#include <Eigen/Cholesky>
#include <array>
#include <cmath>
#include <stdexcept>
#include <utility>

namespace dashpot::analysis {
namespace {

/// Times the basis is evaluated with residuals of working precision and extended ones, with a
/// refinement step between each two; the last evaluation is taken as it is.
constexpr int kMaxEvaluations = 4, kMaxExtendedEvaluations = 7;
/// Refinement goes on until every mode's backward error is below this.
constexpr double kTargetBackwardError = 2e-14;
/// With a relative bound above this, residuals of working precision are not worth a step.
constexpr double kHopeless = 1e-6;
/// Relative distances of eigenvalues that share a block, and whether modes near critical damping
/// are taken to coincide, tried in turn until the result is proved and its backward error is below
/// the next number.
constexpr std::array<std::pair<double, bool>, 4> kAttempts = {
    {{0.02, false}, {0.02, true}, {0.2, true}, {3, true}}};
constexpr double kAcceptableBackwardError = 1e-12;

template <int N>
Status check(const System<N>& system) {
  if (!is_finite(system.mass) || !is_finite(system.damping) || !is_finite(system.stiffness)) {
    return Status::kNotFinite;
  }
  return system.mass == system.mass.transpose() ? Status::kOk : Status::kNotSymmetric;
}

/// Work of what comes before the basis: the zero modes' singular value decomposition above all.
std::int64_t form_work(Eigen::Index n) {
  return cubed(n, 260) + 6000;
}

/// Work of enclose and read_modes; blocks of more than two columns have an iteration of their own.
template <int N>
std::int64_t reading_work(Eigen::Index n, const BlockList<N>& blocks) {
  std::int64_t units = squared(n, 1500) + cubed(n, 20) + sylvester_work<N>(blocks);
  for (const Block& block : blocks) {
    if (block.size > 2) units += cubed(block.size, 60) + squared(block.size, 1500);
  }
  return units;
}

/// Whether rates are numbers whose products neither overflow nor underflow.
template <int N>
bool computable(const EnergyForm<N>& form) {
  constexpr double kSlowest = 1e-100;  // rad/s
  if (!is_finite(form.damping) || !is_finite(form.stiffness)) return false;
  const double rate = form.damping.cwiseAbs().sum() + std::sqrt(form.stiffness.cwiseAbs().sum());
  return rate == 0 || rate >= kSlowest;
}

/// Work of a Newton step.
template <int N>
std::int64_t step_work(Eigen::Index n, const BlockList<N>& blocks) {
  return cubed(n, 180) + 3 * sylvester_work<N>(blocks);
}

/// Quality of a spectrum, at its worst mode.
struct Quality {
  double bound = 0;  ///< error bound / (|lambda_1| + |lambda_2|); infinite if one is missing
  double backward_error = 0;
};

template <int N>
Quality worst_quality(const Spectrum<N>& spectrum) {
  Quality worst;
  for (const Mode<N>& mode : spectrum.modes) {
    worst.bound = std::max(worst.bound, relative_bound(mode));
    worst.backward_error = std::max(worst.backward_error, mode.backward_error);
  }
  return worst;
}

bool is_better(const Quality& a, const Quality& b) {
  return a.bound < b.bound || (a.bound == b.bound && a.backward_error < b.backward_error);
}

/// Evaluates the basis of `out`, bounds its errors and reads the modes; false without the work.
template <int N>
bool read_basis(const System<N>& system, double soft_frequency, BasisResidual<N>& residual,
                BlockEnclosure<N>& enclosure, Spectrum<N>& out, Work& work) {
  evaluate_residual<N>(system, out.symmetric, out.extended, out.basis, residual, work);
  if (!work.take(reading_work<N>(system.dof(), out.basis.blocks))) return false;
  enclose<N>(residual, out.basis, enclosure);
  read_modes<N>(system, residual, enclosure, soft_frequency, out);
  return true;
}

}  // namespace

template <int N>
Status SpectrumSolver<N>::solve(const System<N>& system, Spectrum<N>& out, Work& work) noexcept {
  out.modes.resize(0);
  out.extended = false;
  out.status = check(system);
  if (out.status == Status::kOk) out.status = find_modes(system, out, work);
  if (out.status != Status::kOk && out.status != Status::kUncertified) out.modes.resize(0);
  return out.status;
}

template <int N>
Status SpectrumSolver<N>::find_modes(const System<N>& system, Spectrum<N>& out,
                                     Work& work) noexcept {
  if (!work.take(form_work(system.dof()))) return Status::kUnfinished;
  const Eigen::LLT<Square<N>> cholesky(system.mass);
  if (system.dof() > 0 && cholesky.info() != Eigen::Success) {
    return Status::kMassNotPositiveDefinite;
  }
  const Square<N> L = system.dof() > 0 ? Square<N>(cholesky.matrixL()) : Square<N>(0, 0);
  out.zero_modes = find_zero_modes<N>(system, L);
  if (!std::isfinite(out.zero_modes.floor) || !is_finite(out.zero_modes.coordinates)) {
    return Status::kOverflow;
  }
  const EnergyForm<N> form = to_energy_form<N>(system, out.zero_modes);
  if (!computable(form)) return Status::kOverflow;
  damped_ = !system.damping.isZero(0);
  out.symmetric = form.symmetric;
  out.proportional = form.proportional;
  out.coupling = form.coupling;
  out.coupled = form.coupled_zeros > 0;
  ModalBasis<N> best;
  Quality best_quality{kInfinity, kInfinity};
  bool best_extended = false;
  for (const auto& [cluster, coinciding] : kAttempts) {
    const Status started =
        build_starting_basis<N>(form, out.zero_modes, cluster, coinciding, out.basis, work);
    if (started != Status::kOk) return started;
    out.extended = options_.residual == SpectrumOptions::Residual::kExtended;
    refine(system, out, work);
    if (!work.over() && !good(out) && options_.residual == SpectrumOptions::Residual::kAutomatic) {
      out.extended = true;
      refine(system, out, work);
    }
    if (work.over()) return Status::kUnfinished;
    const bool last = cluster == kAttempts.back().first;
    Quality quality = worst_quality(out);
    if (!is_finite(out.basis.Lambda) || !is_finite(out.basis.U)) {
      quality = {kInfinity, kInfinity};
      if (last && best.blocks.size() == 0) return Status::kOverflow;
    } else if (std::isfinite(quality.bound) && quality.backward_error <= kAcceptableBackwardError) {
      break;
    }
    if (is_better(quality, best_quality)) {
      if (!last) best = out.basis, best_quality = quality, best_extended = out.extended;
    } else if (last && best.blocks.size() > 0) {  // a wider cluster was no better
      out.basis = best;
      out.extended = best_extended;
      if (!read_basis(system, options_.soft_frequency, residual_, enclosure_, out, work)) {
        return Status::kUnfinished;
      }
    }
  }
  for (const Mode<N>& mode : out.modes) {
    if (!std::isfinite(modulus(mode.eigenvalues[0]) + modulus(mode.eigenvalues[1]))) {
      return Status::kNotConverged;
    }
  }
  // All 2n eigenvalues: r zeros, the rates that are numbers, and two a mode. Real eigenvalues of a
  // larger block may be left without a partner.
  const Eigen::Index unrated = (out.zero_mode_rates.array() != out.zero_mode_rates.array()).count();
  const bool complete = 2 * out.modes.size() == 2 * (system.dof() - out.zero_modes.count) + unrated;
  const bool proved = complete && std::isfinite(worst_quality(out).bound);
  return proved ? Status::kOk : Status::kUncertified;
}

template <int N>
bool SpectrumSolver<N>::good(const Spectrum<N>& spectrum) const noexcept {
  const Quality quality = worst_quality(spectrum);
  if (quality.bound > options_.target_bound || quality.backward_error > kTargetBackwardError) {
    return false;
  }
  // A kind that only the error bound decides is worth a better bound, once.
  for (const Mode<N>& mode : spectrum.modes) {
    const bool undecided =
        mode.kind == ModeKind::kCritical || (mode.kind == ModeKind::kUndamped && damped_);
    if (undecided && !spectrum.extended) return false;
  }
  return true;
}

template <int N>
void SpectrumSolver<N>::refine(const System<N>& system, Spectrum<N>& out, Work& work) noexcept {
  Quality previous{kInfinity, kInfinity};
  bool restored = false;
  for (int evaluation = 1;; ++evaluation) {
    if (!read_basis(system, options_.soft_frequency, residual_, enclosure_, out, work)) return;
    const Quality quality = worst_quality(out);
    const int most = out.extended ? kMaxExtendedEvaluations : kMaxEvaluations;
    if (good(out) || restored || evaluation == most) return;
    if (quality.bound > 2 * previous.bound) {  // the step did harm: back, and be done
      out.basis = before_step_;
      restored = true;
      continue;
    }
    const bool better = quality.bound < 0.5 * previous.bound ||
                        quality.backward_error < 0.5 * previous.backward_error;
    // Where rounding errors of the residual are all there is to see, a step would only add to them.
    const bool noise = !out.extended && (quality.bound > kHopeless ||
                                         (quality.backward_error <= kTargetBackwardError &&
                                          residual_.F.norm() <= residual_.F_error.norm()));
    if (!better || noise) return;
    previous = quality;
    if (!work.take(step_work<N>(system.dof(), out.basis.blocks))) return;
    before_step_ = out.basis;
    newton_step<N>(residual_, out.basis);
  }
}

Spectrum<> analyze(const System<>& system, const SpectrumOptions& options) {
  validate(system);
  System<> symmetrized = system;
  make_symmetric(symmetrized.mass, symmetrized.mass_error);
  SpectrumSolver<> solver(options);
  Spectrum<> spectrum;
  const Status status = solver.solve(symmetrized, spectrum);
  // The entries are finite: what is not was too large.
  if (status == Status::kOverflow || status == Status::kNotFinite) {
    throw InvalidSystem("system", to_text(Status::kOverflow));
  }
  if (status != Status::kOk && status != Status::kUncertified) {
    throw std::runtime_error(to_text(status));
  }
  return spectrum;
}

template class SpectrumSolver<kDynamic>;
template class SpectrumSolver<kMaxDof>;

}  // namespace dashpot::analysis
