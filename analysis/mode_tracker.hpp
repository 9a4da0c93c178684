#pragma once
#include <dashpot/analysis/spectrum.hpp>
#include <dashpot/analysis/tracked_spectrum.hpp>
#include <dashpot/analysis/tracker/step_prediction.hpp>
#include <dashpot/analysis/tracker/tracked_enclosure.hpp>

#include <cstdint>

namespace dashpot::analysis {

struct TrackerOptions {
  /// A mode becomes soft below this natural frequency and stays soft up to twice it, rad/s.
  double soft_frequency = 1e-6;
  /// Wanted: error bound / (|lambda_1| + |lambda_2|). A mode with a larger value is refined while
  /// there is more than rounding errors to refine.
  double target_bound = 1e-10;
  /// Largest number of evaluations of the basis in one update, before the direct solver is called.
  int max_iterations = 6;
  /// Relative change of the coefficients up to which the last spectrum is used again, with bounds
  /// that include the change: see distance() in coefficient_sizes.hpp. Negative: never.
  double reuse_tolerance = 1e-14;
  bool shapes = true;  ///< fill TrackedSpectrum::shapes
};

/// Why the direct solver was called.
enum class Fallback {
  kStart,         ///< nothing to start from: the first call, other sizes, after a failure
  kNotSymmetric,  ///< damping or stiffness is not symmetric: always solved directly
  kNotConverged,  ///< max_iterations did not reach the target: a jump
  kCoincidence,   ///< modes that could not be told apart
};
inline constexpr std::size_t kFallbackCount = 4;

struct TrackerCounters {
  std::int64_t updates = 0;
  /// These counts add up to `updates`.
  std::int64_t tracked = 0, reused = 0, direct = 0, failed = 0, unfinished = 0;
  std::array<std::int64_t, kFallbackCount> fallbacks{};  ///< calls of the direct solver
  /// Tracked updates with damping that the undamped modes decouple, so that elastic coordinates and
  /// velocities are followed separately.
  std::int64_t proportional = 0;
  std::int64_t iterations = 0;   ///< evaluations of the basis, in total
  int most_iterations = 0;       ///< in one update
  std::int64_t separations = 0;  ///< pairs of blocks that were separated
  std::int64_t predicted = 0;    ///< updates that began with an extrapolated basis
  std::int64_t shapes_skipped = 0;

  std::int64_t of(Fallback reason) const { return fallbacks[static_cast<std::size_t>(reason)]; }
};

/// Follows the damped spectrum of a system that changes little from call to call, such as an arm
/// under impedance control: M(t), C(t), K(t) with up to 16 coordinates.
///
///     ModeTracker tracker;
///     while (running) {
///       system.mass = ...; system.damping = ...; system.stiffness_factor = ...;
///       if (tracker.update(system, spectrum) == Status::kOk) use(spectrum.modes);
///     }
///
/// Newton's method refines the basis of the last call. Every number is published with a bound that
/// holds for the coefficients as given, rounding errors included. A system that cannot be followed
/// is solved directly (SpectrumSolver), in bounded time.
class ModeTracker {
 public:
  /// Throws std::invalid_argument for a negative soft_frequency, and for a target_bound or
  /// max_iterations that is not positive.
  explicit ModeTracker(const TrackerOptions& options = {});

  /// Fills `out` and returns out.status: kOk or kUncertified if it has modes. Damping and mass are
  /// read. stiffness_factor W is read if it has 1 to n rows: then K = W'W exactly, and neither
  /// `stiffness` nor low words are read. Otherwise K = stiffness, which has to be positive definite
  /// to be followed; a semidefinite K is solved directly on each call.
  Status update(const System<kMaxDof>& system, TrackedSpectrum& out) noexcept {
    Work work;
    return update(system, out, work);
  }
  /// Does the same with no more work than `work` grants. If that is not enough, the status is
  /// kUnfinished and there are no modes. An update that is granted more then finds the modes, with
  /// the same indices. What could not be followed within the work granted is followed by a later
  /// update, if possible.
  Status update(const System<kMaxDof>& system, TrackedSpectrum& out, Work& work) noexcept;

  /// Makes the next update start from scratch. Modes that it recognises keep their indices.
  void reset() noexcept { has_basis_ = false; }
  /// Forgets everything but the counters: the next update is like the first.
  void forget() noexcept {
    has_basis_ = has_indices_ = false;
    soft_ = {};
    enclosure_.roundoff_bound = 0;
    epoch_ = 0;
    look_in_ = 0;
  }

  /// True if the next update starts from the last one and need not be solved directly.
  bool follows() const noexcept { return has_basis_; }
  const TrackerCounters& counters() const noexcept { return counters_; }

 private:
  bool reuse(const SymmetricPencil& pencil, double change, TrackedSpectrum& out) noexcept;
  bool follow(const SymmetricPencil& pencil, TrackedSpectrum& out, Fallback& reason,
              Work& work) noexcept;
  bool refine(const SymmetricPencil& pencil, TrackedSpectrum& out, Fallback& reason,
              Work& work) noexcept;
  bool separate(const CloseBlocks& close, Work& work) noexcept;
  bool publish(const SymmetricPencil& pencil, double distance, double target, bool fresh,
               TrackedSpectrum& out) noexcept;
  Status solve_directly(const System<kMaxDof>& system, const SymmetricPencil& pencil,
                        Fallback reason, TrackedSpectrum& out, Work& work) noexcept;
  Status give_up(TrackedSpectrum& out) noexcept;
  bool restart(const SymmetricPencil& pencil, TrackedSpectrum& out, Work& work) noexcept;
  void publish_direct(const SymmetricPencil& pencil, bool symmetric, TrackedSpectrum& out) noexcept;

  TrackerOptions options_;
  TrackerCounters counters_;

  // The last spectrum: the basis as it was evaluated, and the step that is still to be taken.
  bool has_basis_ = false;
  bool evaluated_ = false;    ///< blocks and residual belong to the basis and to last_
  bool has_indices_ = false;  ///< the columns of basis_ say which mode has which index
  std::uint64_t epoch_ = 0;
  System<kMaxDof> last_;
  CoefficientSizes sizes_;
  BlockEigenbasis basis_;
  TrackedResidual residual_;
  TrackedEnclosure enclosure_;
  PackedMatrix E_;
  std::array<bool, kMaxDof> soft_{};
  double bound_ = 0;      ///< largest relative error bound of the last spectrum
  TrackedSpectrum kept_;  ///< the last spectrum with bounds that hold for changes up to kept_for_,
  double kept_for_ = -1;  ///< see distance(); none if negative

  PackedMatrix step_;  ///< the whole step of this update so far
  StepPrediction prediction_;
  bool turned_ = false;  ///< columns were rotated or separated, so the step tells nothing
  int look_in_ = 0;      ///< updates until proportional damping is looked for

  PackedMatrix velocities_, work_;
  System<kMaxDof> direct_;
  SpectrumSolver<kMaxDof> solver_;
  Spectrum<kMaxDof> spectrum_;
  BlockEigenbasis before_;  ///< the basis of the last update
};

}  // namespace dashpot::analysis
