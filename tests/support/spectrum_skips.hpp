#pragma once
// Terms that ModeTracker and SpectrumSolver leave out if a system does not need them, beside the
// same system with all terms.

#include <dashpot/analysis/mode_tracker.hpp>
#include <dashpot/tests/support/skip_tally.hpp>
#include <dashpot/tests/support/tracker_paths.hpp>

#include <memory>

namespace dashpot::testing {

inline bool has_modes(analysis::Status status) {
  return status == analysis::Status::kOk || status == analysis::Status::kUncertified;
}

/// Follows a path four times: each system once, without shapes, each system twice, and solved
/// directly.
class TrackerSkips {
 public:
  /// A new path.
  void start() {
    full_ = tracker(true);
    plain_ = tracker(false);
    twice_ = tracker(true);
  }

  void step(const TrackedSystem& system) {
    const bool solved = has_modes(full_->update(system, *modes_));
    const bool again = has_modes(twice_->update(system, *other_));
    if (!solved) return;
    const PlainModes modes = plain_modes(*modes_);
    const int zeros = modes_->zero_mode_count;
    if (again && has_modes(twice_->update(system, *other_))) {
      if (other_->origin == analysis::SpectrumOrigin::kReused) ++reuse.left_out;
      compare_bits(plain_modes(*other_), modes, reuse);
    } else {
      reuse.fail();
    }
    if (has_modes(plain_->update(system, *other_))) {
      compare_bits(plain_modes(*other_), modes, shapes);
    } else {
      shapes.fail();
    }
    ++shapes.left_out;
    const auto fresh = tracker(true);
    if (!has_modes(fresh->update(system, *other_))) return;
    compare_bounded(modes, plain_modes(*other_), zeros, 0, direct);
    if (modes_->origin == analysis::SpectrumOrigin::kTracked) ++direct.left_out;
  }

  SkipTally reuse{"spectrum of the same system published again"};
  SkipTally shapes{"no shapes: values only"};
  SkipTally direct{"followed, not solved directly"};
  std::vector<const SkipTally*> tallies() const { return {&reuse, &shapes, &direct}; }

 private:
  using Tracker = std::unique_ptr<analysis::ModeTracker>;
  static Tracker tracker(bool shapes) {
    analysis::TrackerOptions options;
    options.shapes = shapes;
    return std::make_unique<analysis::ModeTracker>(options);
  }

  Tracker full_, plain_, twice_;
  std::unique_ptr<analysis::TrackedSpectrum> modes_ = std::make_unique<analysis::TrackedSpectrum>(),
                                             other_ = std::make_unique<analysis::TrackedSpectrum>();
};

/// `system` and beside it, coupled to nothing, one with these coefficients.
inline analysis::System<> beside(const analysis::System<>& system, const Eigen::MatrixXd& M,
                                 const Eigen::MatrixXd& C, const Eigen::MatrixXd& K) {
  const Eigen::Index n = system.dof(), r = M.rows();
  analysis::System<> both(n + r);
  both.mass.topLeftCorner(n, n) = system.mass;
  both.damping.topLeftCorner(n, n) = system.damping;
  both.stiffness.topLeftCorner(n, n) = system.stiffness;
  both.mass.bottomRightCorner(r, r) = M;
  both.damping.bottomRightCorner(r, r) = C;
  both.stiffness.bottomRightCorner(r, r) = K;
  return both;
}

/// Solves systems with the work that they need, and with work that only others need: in twice the
/// precision, and beside a system that brings a zero mode, a damping that couples modes, or
/// coefficients that are not symmetric.
class SolverSkips {
 public:
  void see(const TrackedSystem& given) {
    analysis::System<> system(given.dof());
    system.mass = given.mass;
    system.damping = given.damping;
    system.stiffness = given.stiffness;
    if (given.stiffness_factor.rows() > 0) {
      system.stiffness = given.stiffness_factor.transpose() * given.stiffness_factor;
    }
    analysis::Spectrum<> spectrum;
    if (!has_modes(analysis::SpectrumSolver<>().solve(system, spectrum))) return;
    const PlainModes modes(spectrum.modes.begin(), spectrum.modes.end());
    analysis::SpectrumOptions extended;
    extended.residual = analysis::SpectrumOptions::Residual::kExtended;
    compare(modes, system, extended, !spectrum.extended, precision);

    const double m = std::exp(system.mass.diagonal().array().log().mean());
    const double k = std::exp((system.stiffness.diagonal().array() + 1e-300).log().mean());
    const double c = std::sqrt(m * k);
    const Eigen::MatrixXd one = Eigen::MatrixXd::Identity(1, 1),
                          two = m * Eigen::MatrixXd::Identity(2, 2);
    compare(modes, beside(system, m * one, 0 * one, 0 * one), {},
            spectrum.modes.size() == system.dof(), zero_modes);
    compare(modes,
            beside(system, two, c * Eigen::Matrix2d{{0.3, 0}, {0, 0.03}},
                   k * Eigen::Matrix2d{{2.1, -1}, {-1, 2.1}}),
            {}, spectrum.proportional, proportional);
    compare(modes,
            beside(system, two, c * Eigen::Matrix2d{{0.3, 0}, {0, 0.03}},
                   k * Eigen::Matrix2d{{2.1, 0.4}, {-0.3, 1.1}}),
            {}, spectrum.symmetric, symmetric);
  }

  SkipTally precision{"residuals in working precision"};
  SkipTally zero_modes{"no zero modes to remove"};
  SkipTally proportional{"damping decouples: no nonsymmetric problem"};
  SkipTally symmetric{"symmetric: no left vectors"};
  std::vector<const SkipTally*> tallies() const {
    return {&precision, &zero_modes, &proportional, &symmetric};
  }

 private:
  static void compare(const PlainModes& modes, const analysis::System<>& system,
                      const analysis::SpectrumOptions& options, bool left_out, SkipTally& tally) {
    analysis::Spectrum<> spectrum;
    if (!has_modes(analysis::SpectrumSolver<>(options).solve(system, spectrum))) return;
    compare_bounded(modes, {spectrum.modes.begin(), spectrum.modes.end()},
                    static_cast<int>(spectrum.zero_mode_rates.size()), 0, tally);
    tally.left_out += left_out ? 1 : 0;
  }
};

}  // namespace dashpot::testing
