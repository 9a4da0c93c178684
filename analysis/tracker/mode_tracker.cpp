#include <dashpot/analysis/base/arithmetic.hpp>
#include <dashpot/analysis/mode_tracker.hpp>
#include <dashpot/analysis/tracker/tracked_start.hpp>

#include <algorithm>
#include <cmath>
#include <cstring>
#include <stdexcept>

namespace dashpot::analysis {
namespace {

/// Steps this small that do not get smaller are rounding errors: modes near each other can be told
/// apart no better.
constexpr double kStalled = 1e-3;
/// What is worse then is solved directly.
constexpr double kStalledBound = 1e-6;
/// Relative bound from which on the slow eigenvalue of a mode is buried by a fast one, and the
/// ratio from which on the two are far apart.
constexpr double kBuried = 1e-6, kFarApart = 1e-6;
/// Units of Work of separating two blocks.
constexpr std::int64_t kPartingWork = 60'000;

/// Work of the enclosure, the modes and their shapes, of n joints.
std::int64_t publishing_work(int n) {
  return squared(n, 900) + 6000;
}

/// Work of a basis from a direct solution, with its modes matched to the last ones.
std::int64_t restart_work(int n) {
  return cubed(n, 360) + publishing_work(n);
}

/// Whether the matrix equals its transpose and its entries are finite.
bool is_symmetric(const Square<kMaxDof>& matrix) {
  const auto n = static_cast<int>(matrix.rows());
  const double* const a = matrix.data();
  bool differs = false;  // comparisons do not wait for each other, as the terms of a sum would
  for (int j = 0; j < n; ++j) {
    for (int i = 0; i < j; ++i) differs |= !(a[i + j * n] - a[j + i * n] == 0);
    differs |= !(0 * a[j + j * n] == 0);
  }
  return !differs;
}

/// Whether the symmetric matrix M (n x n) has a Cholesky factor.
bool is_positive_definite(const double* M, int n) {
  std::array<double, static_cast<std::size_t>(kMaxDof) * kMaxDof> L;  // by rows
  for (int i = 0; i < n; ++i) {
    double* const row = &L[at(i * kMaxDof)];
    double diagonal = M[i + i * n];
    for (int j = 0; j < i; ++j) {
      const double* const other = &L[at(j * kMaxDof)];
      double sum = M[i + j * n];
      for (int k = 0; k < j; ++k) sum -= row[k] * other[k];
      row[j] = sum * other[j];  // the inverses of the diagonal are kept
      diagonal -= row[j] * row[j];
    }
    if (!(diagonal > 0)) return false;
    row[i] = 1 / std::sqrt(diagonal);
  }
  return true;
}

/// Whether a basis can follow the system, which is symmetric or not, from one that was. A basis of
/// one side is dearer to find than to follow: a symmetric system gets it back at once.
bool can_follow(const BlockEigenbasis& basis, const System<kMaxDof>& system,
                const SymmetricPencil& pencil, bool symmetric, bool was_symmetric) {
  if (!basis.two_sided) return symmetric;
  return (!symmetric || was_symmetric) && is_symmetric(system.mass) &&
         is_positive_definite(pencil.M, pencil.joints);
}

/// Whether two systems have the same states.
bool same_form(const SymmetricPencil& a, const SymmetricPencil& b) {
  return a.joints == b.joints && a.rank == b.rank && a.factored == b.factored;
}

/// Whether all matrices that are read have the sizes that they need.
bool sizes_agree(const System<kMaxDof>& system) {
  const Eigen::Index n = system.dof();
  const Eigen::Index rows = system.stiffness_factor.rows();
  const bool factored = rows > 0 && rows <= n;
  const auto is_square = [n](const auto& matrix) {
    return matrix.rows() == n && matrix.cols() == n;
  };
  const auto is_bound = [&](const auto& matrix) { return matrix.size() == 0 || is_square(matrix); };
  return is_square(system.mass) && is_square(system.damping) && is_bound(system.mass_error) &&
         is_bound(system.damping_error) && is_bound(system.stiffness_error) &&
         (factored ? system.stiffness_factor.cols() == n : is_square(system.stiffness));
}

/// Whether coefficients are given with errors, which the bounds of a tracked basis do not count.
bool has_errors(const System<kMaxDof>& system) {
  return !system.mass_error.isZero(0) || !system.damping_error.isZero(0) ||
         !system.stiffness_error.isZero(0);
}

/// Whether all coefficients, of the same form, agree to the last bit.
bool identical(const SymmetricPencil& a, const SymmetricPencil& b) {
  const auto same = [](const double* x, const double* y, int count) {
    return std::memcmp(x, y, static_cast<std::size_t>(count) * sizeof(double)) == 0;
  };
  const int n = a.joints;
  return same(a.M, b.M, n * n) && same(a.C, b.C, n * n) && same(a.W, b.W, a.rank * n);
}

bool has_modes(Status status) {
  return status == Status::kOk || status == Status::kUncertified;
}

/// The largest relative bound of a mode that is not soft.
double worst_bound(const TrackedSpectrum& spectrum) {
  double worst = 0;
  for (int i = 0; i < spectrum.mode_count; ++i) {
    const ModeNumbers& mode = spectrum.modes[at(i)];
    if (mode.kind != ModeKind::kSoft) worst = std::max(worst, relative_bound(mode));
  }
  return worst;
}

/// True if rounding errors of a mode's fast real eigenvalue bury its slow one, unless the mode is
/// soft for all that. The direct solver keeps the two apart.
bool is_buried(const ModeNumbers& mode, double soft_frequency) {
  const double slow = modulus(mode.eigenvalues[0]), fast = modulus(mode.eigenvalues[1]);
  return mode.eigenvalues[0].imag() == 0 && slow < kFarApart * fast &&
         mode.error_bound > kBuried * slow &&
         slow * fast + mode.error_bound * (slow + fast) > 4 * soft_frequency * soft_frequency;
}

}  // namespace

ModeTracker::ModeTracker(const TrackerOptions& options)
    : options_(options), solver_([&] {
        SpectrumOptions direct;
        direct.soft_frequency = options.soft_frequency;
        return direct;
      }()) {
  if (!(options.soft_frequency >= 0)) throw std::invalid_argument("soft_frequency: is negative");
  if (!(options.target_bound > 0)) throw std::invalid_argument("target_bound: is not positive");
  if (options.max_iterations < 1) throw std::invalid_argument("max_iterations: is not positive");
}

Status ModeTracker::update(const System<kMaxDof>& system, TrackedSpectrum& out,
                           Work& work) noexcept {
  if (!sizes_agree(system)) {
    out.mode_count = out.zero_mode_count = 0;
    ++counters_.failed;
    return out.status = Status::kWrongSize;
  }
  const SymmetricPencil pencil = symmetric_pencil(system), last = symmetric_pencil(last_);
  if (!same_form(pencil, last)) forget_solution(State::kEmpty);
  const bool exact = !has_errors(system);
  if (exact && (kept_known_ || state_ == State::kCurrent) && identical(pencil, last)) {
    if (!kept_known_) {
      read(kept_);
      publish(pencil, SpectrumOrigin::kReused, kept_);
      kept_known_ = true;
    }
    out = kept_;
    ++counters_.reused;
    return out.status;
  }
  kept_known_ = false;
  const bool symmetric = is_symmetric(system.mass) && is_symmetric(system.damping) &&
                         (pencil.factored || is_symmetric(system.stiffness));
  const bool fits = can_follow(basis_, system, pencil, symmetric, symmetric_);
  symmetric_ = symmetric;
  if (fits && exact && follows() && follow(pencil, out, work)) {
    last_.mass = system.mass;
    last_.damping = system.damping;
    if (pencil.factored) {
      last_.stiffness_factor = system.stiffness_factor;
    } else {
      last_.stiffness = system.stiffness;
    }
    ++counters_.tracked;
    return out.status;
  }
  if (!work.over()) solve_directly(system, pencil, out, work);
  if (work.over()) out.status = Status::kUnfinished;  // what is known serves the next update
  kept_known_ &= exact && !work.over();
  if (!has_modes(out.status)) out.mode_count = out.zero_mode_count = 0;
  ++(work.over()             ? counters_.unfinished
     : has_modes(out.status) ? counters_.direct
                             : counters_.failed);
  return out.status;
}

/// Follows the modes from the last basis. Where that fails, the basis stays as it was.
bool ModeTracker::follow(const SymmetricPencil& pencil, TrackedSpectrum& out, Work& work) noexcept {
  state_ = State::kFollowing;
  extrapolation_.apply(basis_);
  recondition(pencil, residual_, basis_);
  if (refine(pencil, out, work)) {
    publish(pencil, SpectrumOrigin::kTracked, out);
    return true;
  }
  extrapolation_.go_back(basis_);
  return false;
}

/// Newton's method from the basis as it is, until its modes can be published.
bool ModeTracker::refine(const SymmetricPencil& pencil, TrackedSpectrum& out, Work& work) noexcept {
  double last_size = 1;
  for (int iteration = 1; iteration <= options_.max_iterations; ++iteration) {
    if (!work.take(iteration_work(basis_))) return false;
    ++counters_.iterations;
    evaluate(pencil, basis_, residual_);
    double size = 0;
    const CloseBlocks close = newton_step(basis_, residual_, enclosure_.roundoff_bound, E_, size);
    if (!(size < 1)) return false;
    const bool stalled = size < kStalled && size > last_size / 2;
    last_size = size;
    Verdict verdict = Verdict::kImprove;
    if (!close && (size <= kLastStep || stalled) && work.take(publishing_work(pencil.joints))) {
      verdict = judge(pencil, size, stalled, out);
    }
    if (verdict == Verdict::kGiveUp) return false;
    take_step(E_, residual_, basis_);
    if (verdict == Verdict::kPublish) {
      state_ = State::kCurrent;
      return true;
    }
    if (!close) continue;
    if (!work.take(kPartingWork) || !separate_blocks(residual_, close, basis_)) return false;
    extrapolation_.forget();
  }
  return false;
}

/// Bounds the errors of basis_ before a step of this size, and reads its numbers.
ModeTracker::Verdict ModeTracker::judge(const SymmetricPencil& pencil, double size, bool stalled,
                                        TrackedSpectrum& out) noexcept {
  enclose(pencil, basis_, residual_, enclosure_);
  if (!read(out)) return Verdict::kGiveUp;
  const double worst = worst_bound(out);
  const bool last = size <= basis_.converged();
  if (basis_.two_sided && last && worst > kStalledBound) return Verdict::kGiveUp;
  const bool converged = last || (stalled && worst <= kStalledBound);
  const bool buried =
      std::any_of(out.modes.begin(), out.modes.begin() + out.mode_count,
                  [this](const auto& m) { return is_buried(m, options_.soft_frequency); });
  if (buried) return converged ? Verdict::kGiveUp : Verdict::kImprove;
  const bool good = out.status == Status::kOk && (converged || worst <= options_.target_bound);
  return good ? Verdict::kPublish : Verdict::kImprove;
}

/// Reads the numbers of basis_; false if what is a zero mode is to be decided again.
bool ModeTracker::read(TrackedSpectrum& out) noexcept {
  return read_numbers(basis_, enclosure_, options_.soft_frequency, labels_.soft, out);
}

/// Completes `out`, which has the numbers of basis_.
void ModeTracker::publish(const SymmetricPencil& pencil, SpectrumOrigin origin,
                          TrackedSpectrum& out) noexcept {
  out.epoch = labels_.epoch;
  out.origin = origin;
  if (options_.shapes) read_shapes(pencil, symmetric_, basis_, E_, momenta_, out);
}

void ModeTracker::solve_directly(const System<kMaxDof>& system, const SymmetricPencil& pencil,
                                 TrackedSpectrum& out, Work& work) noexcept {
  reset();
  last_ = system;
  last_.has_low_words = false;
  if (pencil.factored) {
    form_stiffness(last_);
  } else {
    last_.stiffness_factor.resize(0, pencil.joints);
  }
  out.status = solver_.solve(last_, spectrum_, work);
  if (!has_modes(out.status) || !work.take(restart_work(pencil.joints))) return;
  if (has_errors(system) || pencil.joints == 0 || !restart(pencil, out, work)) {
    publish_direct(pencil, out);
  }
}

/// Continues from the direct solution as if it had been followed; false if that is not possible.
bool ModeTracker::restart(const SymmetricPencil& pencil, TrackedSpectrum& out,
                          Work& work) noexcept {
  for (const auto& mode : spectrum_.modes) {
    if (is_buried(mode, options_.soft_frequency)) return false;
  }
  const BlockEigenbasis before = basis_;
  if (!start_basis(pencil, spectrum_, symmetric_, residual_, basis_)) {
    basis_ = before;
    return false;
  }
  enclose(pencil, basis_, residual_, enclosure_);  // for its roundoff_bound
  match(before);
  extrapolation_.forget();
  if (!refine(pencil, out, work)) return false;
  publish(pencil, SpectrumOrigin::kDirect, out);
  return true;
}

/// Gives the modes of basis_ their indices; returns the index that each mode gets.
std::array<int, kMaxDof> ModeTracker::match(const BlockEigenbasis& before) noexcept {
  const bool any_before = state_ == State::kMatching;
  state_ = State::kMatching;
  return labels_.match(last_, symmetric_, any_before, before, basis_);
}

/// Publishes the direct solution as it is.
void ModeTracker::publish_direct(const SymmetricPencil& pencil, TrackedSpectrum& out) noexcept {
  const BlockEigenbasis before = basis_;
  set_planes(pencil, spectrum_, basis_);
  const std::array<int, kMaxDof> index = match(before);
  out.status = spectrum_.status;  // not the status of an attempt to follow
  out.origin = SpectrumOrigin::kDirect;
  out.epoch = labels_.epoch;
  out.mode_count = spectrum_.modes.size();
  for (int i = 0; i < out.mode_count; ++i) {
    const Mode<kMaxDof>& mode = spectrum_.modes[i];
    out.modes[at(index[at(i)])] = static_cast<const ModeNumbers&>(mode);
    if (options_.shapes) out.shapes[at(index[at(i)])].u = mode.shapes;
  }
  if (options_.shapes) read_slopes(pencil, symmetric_, out);
  out.zero_mode_count = spectrum_.zero_modes.count;
  for (int k = 0; k < out.zero_mode_count; ++k) {
    out.zero_mode_rates[at(k)] = spectrum_.zero_mode_rates[k];
  }
  sort_by_frequency(out);
  kept_ = out;
  kept_.origin = SpectrumOrigin::kReused;
  kept_known_ = true;
}

}  // namespace dashpot::analysis
