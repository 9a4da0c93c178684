#include <dashpot/analysis/linalg/double_double.hpp>
#include <dashpot/analysis/mode_tracker.hpp>
#include <dashpot/analysis/tracker/cluster_separation.hpp>
#include <dashpot/analysis/tracker/tracked_modes.hpp>
#include <dashpot/analysis/tracker/tracked_start.hpp>

#include <algorithm>
#include <cmath>
#include <cstring>
#include <limits>
#include <stdexcept>

namespace dashpot::analysis {
namespace {

/// Steps this small leave eigenvectors right to their square once they are taken.
constexpr double kLastStep = 1e-7;
/// Below this, nothing but rounding errors is left to improve.
constexpr double kConverged = 1e-11;
constexpr double kInfinity = std::numeric_limits<double>::infinity();
/// A change of the coefficients that none is as small as.
constexpr double kNothing = -1;
/// A proportional basis stays one as long as no more than this of elastic coordinates and
/// velocities mixes: what eigenvectors then lack, to its square.
constexpr double kLeastMixing = 1e-9;
/// Times the step squared: a step mixes as much by itself.
constexpr double kStepMixing = 4;
/// From this pass on a basis is not kept proportional: nothing may slow Newton's method down.
constexpr int kPurePasses = 4;
/// Updates between two looks whether the damping is proportional.
constexpr int kLookEvery = 64;
/// Blocks are balanced again when their columns lean this much towards each other.
constexpr double kBalanced = 0.6;
/// Units of Work of separating two blocks.
constexpr std::int64_t kPartingWork = 60'000;

std::size_t at(int i) {
  return static_cast<std::size_t>(i);
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

/// Work of evaluating a basis, and of the step that follows.
std::int64_t iteration_work(const BlockEigenbasis& basis) {
  return cubed(basis.columns(), 16) + squared(basis.columns(), 60);
}

/// Work of the enclosure, the modes and their shapes, of n joints.
std::int64_t publishing_work(int n) {
  return squared(n, 900) + 6000;
}

/// Work of a basis from a direct solution, with its modes matched to the last ones.
std::int64_t restart_work(int n) {
  return cubed(n, 360) + publishing_work(n);
}

bool sizes_agree(const System<kMaxDof>& system) {
  const Eigen::Index n = system.dof();
  const Eigen::Index rows = system.stiffness_factor.rows();
  const bool factored = rows > 0 && rows <= n;
  const auto is_square = [n](const auto& matrix) {
    return matrix.rows() == n && matrix.cols() == n;
  };
  return is_square(system.mass) && is_square(system.damping) &&
         (factored ? system.stiffness_factor.cols() == n : is_square(system.stiffness));
}

/// K = W'W with about 32 digits: the stiffness and its low word.
void form_stiffness(System<kMaxDof>& system) {
  const auto& W = system.stiffness_factor;
  const Eigen::Index n = system.dof();
  system.stiffness.resize(n, n);
  system.stiffness_low.resize(n, n);
  system.damping_low.setZero(n, n);
  for (Eigen::Index j = 0; j < n; ++j) {
    for (Eigen::Index i = 0; i <= j; ++i) {
      DotAccumulator sum;
      for (Eigen::Index k = 0; k < W.rows(); ++k) sum.add(W(k, i), W(k, j));
      system.stiffness(i, j) = system.stiffness(j, i) = sum.value().high;
      system.stiffness_low(i, j) = system.stiffness_low(j, i) = sum.value().low;
    }
  }
  system.has_low_words = true;
}

void copy(const PackedMatrix& from, int columns, PackedMatrix& to) {
  to.width = from.width;
  std::copy_n(from.items.begin(), columns * from.width, to.items.begin());
}

/// The parts that say something, of n joints.
void copy(const TrackedSpectrum& from, int n, bool shapes, TrackedSpectrum& to) {
  to.status = from.status;
  to.origin = from.origin;
  to.mode_count = from.mode_count;
  to.epoch = from.epoch;
  to.zero_mode_count = from.zero_mode_count;
  to.zero_mode_rates = from.zero_mode_rates;
  to.order = from.order;
  std::copy_n(from.modes.begin(), from.mode_count, to.modes.begin());
  for (int i = 0; shapes && i < from.mode_count; ++i) {
    const TrackedShapes& source = from.shapes[at(i)];
    TrackedShapes& target = to.shapes[at(i)];
    target.slope = source.slope;
    for (std::size_t k = 0; k < 2; ++k) {
      target.u[k].resize(n);
      std::copy_n(source.u[k].data(), n, target.u[k].data());
    }
  }
}

/// Whether all coefficients agree to the last bit.
bool identical(const SymmetricPencil& a, const SymmetricPencil& b) {
  const auto same = [](const double* x, const double* y, int count) {
    return std::memcmp(x, y, static_cast<std::size_t>(count) * sizeof(double)) == 0;
  };
  const int n = a.joints;
  return same(a.M, b.M, n * n) && same(a.C, b.C, n * n) && same(a.W, b.W, a.rank * n);
}

/// The largest error bound of a mode, relative to its eigenvalues; at critical damping of its
/// frequency, because eigenvalues are worth half the digits there.
double worst_bound(const TrackedSpectrum& spectrum) {
  double worst = 0;
  for (int i = 0; i < spectrum.mode_count; ++i) {
    const ModeNumbers& mode = spectrum.modes[at(i)];
    if (mode.kind == ModeKind::kSoft) continue;
    const double size = modulus(mode.eigenvalues[0]) + modulus(mode.eigenvalues[1]);
    const double bound =
        mode.kind == ModeKind::kCritical ? mode.natural_frequency_bound : mode.error_bound;
    if (!(bound <= worst * size)) worst = bound / size;
  }
  return worst;
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
  ++counters_.updates;
  if (!sizes_agree(system)) {
    ++counters_.failed;
    out.mode_count = out.zero_mode_count = 0;
    return out.status = Status::kWrongSize;
  }
  const SymmetricPencil pencil = symmetric_pencil(system);
  const SymmetricPencil last = symmetric_pencil(last_);
  const bool alike = has_basis_ && last.joints == pencil.joints && last.rank == pencil.rank &&
                     last.factored == pencil.factored;
  if (alike && evaluated_ && identical(pencil, last) && reuse(pencil, 0, out)) return out.status;
  const bool symmetric = is_symmetric(system.mass) && is_symmetric(system.damping) &&
                         (pencil.factored || is_symmetric(system.stiffness));
  if (!symmetric) return solve_directly(system, pencil, Fallback::kNotSymmetric, out, work);
  Fallback reason = Fallback::kStart;
  if (alike) {
    const double change = distance(pencil, last, sizes_, options_.reuse_tolerance);
    if (evaluated_ && reuse(pencil, change, out)) return out.status;
    if (follow(pencil, out, reason, work)) {
      evaluated_ = true;
      last_.mass = system.mass;
      last_.damping = system.damping;
      if (pencil.factored) {
        last_.stiffness_factor = system.stiffness_factor;
      } else {
        last_.stiffness = system.stiffness;
      }
      return out.status;
    }
    evaluated_ = false;
    if (work.over()) return give_up(out);  // the next update goes on from the last basis
  }
  return solve_directly(system, pencil, reason, out, work);
}

/// Bounds the errors of the basis and reads its modes; false if a relative bound exceeds `target`
/// or nothing is proved. The system is at this `distance` from the one that the basis was evaluated
/// for; `fresh` if it was so just now.
bool ModeTracker::publish(const SymmetricPencil& pencil, double distance, double target, bool fresh,
                          TrackedSpectrum& out) noexcept {
  enclose(pencil, sizes_, distance, basis_, residual_, enclosure_);
  std::array<bool, kMaxDof> soft = soft_;
  read_numbers(basis_, enclosure_, options_.soft_frequency, soft, out);
  const double worst = worst_bound(out);
  if (!(worst <= target) || out.status != Status::kOk) return false;
  soft_ = soft;
  if (fresh) kept_for_ = kNothing;
  out.epoch = epoch_;
  out.origin = fresh ? SpectrumOrigin::kTracked : SpectrumOrigin::kReused;
  if (fresh) bound_ = worst;
  if (!options_.shapes) {
    ++counters_.shapes_skipped;
    return true;
  }
  if (fresh) stepped_velocities(basis_, E_, velocities_);
  read_shapes(pencil, basis_, E_, velocities_, work_, out);
  return true;
}

/// With the bounds that were proved when it was first used again, if the system has not changed
/// more than these allow for; else proves them for all that may be reused, or at least for this
/// one.
bool ModeTracker::reuse(const SymmetricPencil& pencil, double change,
                        TrackedSpectrum& out) noexcept {
  const double tolerance = options_.reuse_tolerance;
  if (!(change <= tolerance)) return false;
  if (!(change <= kept_for_)) {
    const double target = std::max(options_.target_bound, 2 * bound_);
    kept_for_ = change > 0 ? tolerance : 0;
    if (!publish(pencil, kept_for_, target, false, kept_)) {
      kept_for_ = kNothing;
      if (!(change > 0) || !publish(pencil, change, target, false, out)) return false;
      ++counters_.reused;
      return true;
    }
  } else if (!options_.shapes) {
    ++counters_.shapes_skipped;
  }
  copy(kept_, pencil.joints, options_.shapes, out);
  ++counters_.reused;
  return true;
}

bool ModeTracker::follow(const SymmetricPencil& pencil, TrackedSpectrum& out, Fallback& reason,
                         Work& work) noexcept {
  const int columns = basis_.columns(), width = basis_.Z.width;
  before_.modes = basis_.modes;
  before_.zeros = basis_.zeros;
  before_.proportional = basis_.proportional;
  copy(basis_.Z, columns, before_.Z);
  if (prediction_.ready()) {
    ++counters_.predicted;
    add(prediction_.next(), columns, E_);
    copy(prediction_.next(), columns, step_);
  } else {
    set_zero(width, columns, step_);
  }
  HyperbolicAngles angles;
  const bool pure =
      --look_in_ <= 0 && !basis_.proportional && decouples_damping(residual_, basis_, angles);
  if (look_in_ <= 0) look_in_ = kLookEvery;
  take_step(E_, basis_);
  turned_ = !basis_.proportional && ((pure && make_proportional(angles, basis_)) ||
                                     rotate_hyperbolically(residual_, kBalanced, basis_));
  sizes_ = coefficient_sizes(pencil);
  if (!refine(pencil, out, reason, work)) {
    copy(before_.Z, columns, basis_.Z);  // the last one that was right still names the modes
    basis_.proportional = before_.proportional;
    set_zero(width, columns, E_);
    return false;
  }
  if (turned_) {
    prediction_.forget(width, columns);
  } else {
    prediction_.learn(step_, columns);
  }
  ++counters_.tracked;
  if (basis_.proportional) ++counters_.proportional;
  return true;
}

/// Newton's method from the basis as it is. Leaves the last step to be taken.
bool ModeTracker::refine(const SymmetricPencil& pencil, TrackedSpectrum& out, Fallback& reason,
                         Work& work) noexcept {
  const int columns = basis_.columns();
  reason = Fallback::kNotConverged;
  for (int pass = 1; pass <= options_.max_iterations; ++pass) {
    if (!work.take(iteration_work(basis_))) return false;
    ++counters_.iterations;
    counters_.most_iterations = std::max(counters_.most_iterations, pass);
    evaluate(pencil, basis_, residual_);
    double size = 0;
    const CloseBlocks close = newton_step(basis_, residual_, enclosure_.roundoff_bound, E_, size);
    add(E_, columns, step_);
    if (!(size < 1)) return false;
    const double mixed = kLeastMixing + kStepMixing * size * size;
    basis_.proportional =
        basis_.proportional && pass < kPurePasses && coupling_norm(basis_, E_) <= mixed;
    if (!close && size <= kLastStep && work.take(publishing_work(pencil.joints)) &&
        publish(pencil, 0, size <= kConverged ? kInfinity : options_.target_bound, true, out)) {
      return true;
    }
    if (pass < options_.max_iterations) take_step(E_, basis_);
    if (!close) continue;
    reason = Fallback::kCoincidence;
    turned_ = true;
    if (!separate(close, work)) return false;
    basis_.proportional = basis_.proportional && coupling_norm(basis_, basis_.Z) == 0;
    ++counters_.separations;
  }
  return false;
}

bool ModeTracker::separate(const CloseBlocks& close, Work& work) noexcept {
  if (!work.take(kPartingWork)) return false;
  if (close.first >= basis_.modes) return separate_zero_modes(residual_, basis_);
  return separate_coinciding(residual_, basis_, work) || separate_blocks(residual_, close, basis_);
}

Status ModeTracker::solve_directly(const System<kMaxDof>& system, const SymmetricPencil& pencil,
                                   Fallback reason, TrackedSpectrum& out, Work& work) noexcept {
  ++counters_.fallbacks[static_cast<std::size_t>(reason)];
  direct_ = system;
  direct_.has_low_words = false;
  if (!pencil.factored) direct_.stiffness_factor.resize(0, pencil.joints);
  if (pencil.factored) form_stiffness(direct_);
  const SymmetricPencil last = symmetric_pencil(last_);
  has_indices_ = has_indices_ && last.joints == pencil.joints && last.rank == pencil.rank &&
                 last.factored == pencil.factored;
  has_basis_ = false;
  prediction_.pause();
  last_ = direct_;
  out.origin = SpectrumOrigin::kDirect;
  if (work.over()) return give_up(out);
  out.status = solver_.solve(direct_, spectrum_, work);
  if (work.over()) return give_up(out);
  if (out.status != Status::kOk && out.status != Status::kUncertified) {
    ++counters_.failed;
    out.mode_count = out.zero_mode_count = 0;
    return out.status;
  }
  if (!work.take(restart_work(pencil.joints))) return give_up(out);
  const bool followed =
      reason != Fallback::kNotSymmetric && pencil.joints > 0 && restart(pencil, out, work);
  if (work.over()) return give_up(out);
  ++counters_.direct;
  if (followed) {
    out.origin = SpectrumOrigin::kDirect;
  } else {
    publish_direct(pencil, reason != Fallback::kNotSymmetric, out);
  }
  return out.status;
}

Status ModeTracker::give_up(TrackedSpectrum& out) noexcept {
  ++counters_.unfinished;
  out.mode_count = out.zero_mode_count = 0;
  return out.status = Status::kUnfinished;
}

/// Makes the direct solution the basis to follow from now on.
bool ModeTracker::restart(const SymmetricPencil& pencil, TrackedSpectrum& out,
                          Work& work) noexcept {
  before_ = basis_;
  if (!start_basis(pencil, spectrum_, basis_)) {
    basis_ = before_;
    return false;
  }
  evaluate(pencil, basis_, residual_);
  if (separate_coinciding(residual_, basis_, work)) evaluate(pencil, basis_, residual_);
  HyperbolicAngles angles;
  if (!decouples_damping(residual_, basis_, angles) || !make_proportional(angles, basis_)) {
    rotate_hyperbolically(residual_, 0, basis_);
  }
  has_indices_ = has_indices_ && before_.modes == basis_.modes;
  if (has_indices_) match_modes(pencil, before_, basis_);
  sizes_ = coefficient_sizes(pencil);
  prediction_.forget(basis_.Z.width, basis_.columns());
  set_zero(basis_.Z.width, basis_.columns(), step_);
  if (!has_indices_) {
    evaluate(pencil, basis_, residual_);
    enclose(pencil, sizes_, 0, basis_, residual_, enclosure_);
    soft_ = {};
    read_numbers(basis_, enclosure_, 0, soft_, out);
    std::array<int, kMaxDof> index{};
    for (int i = 0; i < basis_.modes; ++i) index[at(out.order[at(i)])] = i;
    permute_modes(index, basis_);
    soft_ = {};
    has_indices_ = true;
    ++epoch_;
  }
  Fallback unused{};
  has_basis_ = evaluated_ = refine(pencil, out, unused, work);
  return has_basis_;
}

/// Publishes the direct solution as it is, with the indices of the modes that were found last.
void ModeTracker::publish_direct(const SymmetricPencil& pencil, bool symmetric,
                                 TrackedSpectrum& out) noexcept {
  std::array<int, kMaxDof> index{};
  if (!has_indices_ || !match_shapes(pencil, basis_, spectrum_, index)) {
    ++epoch_;
    for (int i = 0; i < kMaxDof; ++i) index[at(i)] = i;
  }
  set_planes(pencil, spectrum_, index, basis_);
  has_indices_ = true;
  out.status = spectrum_.status;  // not that of an attempt to follow
  out.epoch = epoch_;
  out.mode_count = spectrum_.modes.size();
  for (int i = 0; i < out.mode_count; ++i) {
    const Mode<kMaxDof>& mode = spectrum_.modes[i];
    ModeNumbers& numbers = out.modes[at(index[at(i)])];
    numbers.eigenvalues = mode.eigenvalues;
    numbers.natural_frequency = mode.natural_frequency;
    numbers.damping_ratio = mode.damping_ratio;
    numbers.damped_frequency = mode.damped_frequency;
    numbers.kind = mode.kind;
    numbers.error_bound = mode.error_bound;
    numbers.natural_frequency_bound = mode.natural_frequency_bound;
    numbers.damping_ratio_bound = mode.damping_ratio_bound;
    if (!options_.shapes) continue;
    TrackedShapes& shapes = out.shapes[at(index[at(i)])];
    shapes.u = mode.shapes;
    shapes.slope = {};
    for (std::size_t k = 0; symmetric && k < 2; ++k) {
      const ComplexVector<kMaxDof> Mu = direct_.mass * mode.shapes[k];
      const ComplexVector<kMaxDof> Cu = direct_.damping * mode.shapes[k];
      shapes.slope[k] =
          (mode.shapes[k].transpose() * (2.0 * mode.eigenvalues[k] * Mu + Cu)).value();
    }
  }
  out.zero_mode_count = spectrum_.zero_modes.count;
  for (int k = 0; k < out.zero_mode_count; ++k) {
    out.zero_mode_rates[at(k)] = spectrum_.zero_mode_rates[k];
  }
  sort_by_frequency(out);
}

}  // namespace dashpot::analysis
