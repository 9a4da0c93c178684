#pragma once
#include <dashpot/analysis/spectrum.hpp>
#include <dashpot/analysis/tracked_spectrum.hpp>
#include <dashpot/analysis/tracker/mode_labels.hpp>
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
  bool shapes = true;  ///< fill TrackedSpectrum::shapes
};

/// Numbers of updates by how they ended, and what they took.
struct TrackerCounters {
  std::int64_t tracked = 0, reused = 0, direct = 0, failed = 0, unfinished = 0;
  std::int64_t iterations = 0;  ///< evaluations of the basis, in total

  std::int64_t updates() const { return tracked + reused + direct + failed + unfinished; }
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
/// is solved directly (SpectrumSolver), in bounded time. A system that equals the last one to the
/// last bit has the modes of the last one, which are published again.
class ModeTracker {
 public:
  /// Throws std::invalid_argument for a negative soft_frequency, and for a target_bound or
  /// max_iterations that is not positive.
  explicit ModeTracker(const TrackerOptions& options = {});

  /// Fills `out` and returns out.status: kOk or kUncertified if it has modes. stiffness_factor W is
  /// read if it has 1 to n rows: then K = W'W exactly, and neither `stiffness` nor low words are
  /// read. Otherwise K = stiffness. C and K need not be symmetric. Systems with errors are solved
  /// directly on each call, and the bounds count the errors.
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
  void reset() noexcept {
    forget_solution(state_ == State::kEmpty ? State::kEmpty : State::kMatching);
  }
  /// Forgets everything but the counters: the next update is like the first.
  void forget() noexcept {
    forget_solution(State::kEmpty);
    labels_ = {};
    enclosure_.roundoff_bound = 0;
  }

  /// True if the next update starts from the last one and need not be solved directly.
  bool follows() const noexcept { return state_ >= State::kFollowing; }
  const TrackerCounters& counters() const noexcept { return counters_; }

 private:
  /// Use of the basis.
  enum class State {
    kEmpty,      ///< there is none
    kMatching,   ///< its columns say which mode has which index
    kFollowing,  ///< and Newton's method starts from it
    kCurrent,    ///< and it is the solution for last_, as E_ and enclosure_ are
  };

  enum class Verdict { kImprove, kPublish, kGiveUp };

  bool follow(const SymmetricPencil& pencil, TrackedSpectrum& out, Work& work) noexcept;
  bool refine(const SymmetricPencil& pencil, TrackedSpectrum& out, Work& work) noexcept;
  Verdict judge(const SymmetricPencil& pencil, double size, bool stalled,
                TrackedSpectrum& out) noexcept;
  bool read(TrackedSpectrum& out) noexcept;
  void publish(const SymmetricPencil& pencil, SpectrumOrigin origin, TrackedSpectrum& out) noexcept;
  void solve_directly(const System<kMaxDof>& system, const SymmetricPencil& pencil,
                      TrackedSpectrum& out, Work& work) noexcept;
  bool restart(const SymmetricPencil& pencil, TrackedSpectrum& out, Work& work) noexcept;
  void publish_direct(const SymmetricPencil& pencil, TrackedSpectrum& out) noexcept;
  std::array<int, kMaxDof> match(const BlockEigenbasis& before) noexcept;
  void forget_solution(State state) noexcept {
    state_ = state;
    kept_known_ = false;
  }

  TrackerOptions options_;
  TrackerCounters counters_;

  State state_ = State::kEmpty;
  ModeLabels labels_;
  System<kMaxDof> last_;
  bool symmetric_ = false;  ///< the system is, or the last one was
  BlockEigenbasis basis_;
  PackedMatrix E_;  ///< the last step of basis_, which its blocks do not know of
  TrackedResidual residual_;
  TrackedEnclosure enclosure_;
  BasisExtrapolation extrapolation_;
  PackedMatrix momenta_;
  TrackedSpectrum kept_;
  bool kept_known_ = false;  ///< kept_ is the spectrum of last_
  SpectrumSolver<kMaxDof> solver_;
  Spectrum<kMaxDof> spectrum_;
};

}  // namespace dashpot::analysis
