#pragma once
#include <dashpot/analysis/mode.hpp>
#include <dashpot/analysis/solver_status.hpp>
#include <dashpot/analysis/spectrum/modal_basis.hpp>
#include <dashpot/analysis/system/zero_modes.hpp>

namespace dashpot::analysis {

/// All results of the analysis of one system.
template <int N = kDynamic>
struct Spectrum {
  Status status = Status::kOk;
  bool symmetric = true;      ///< damping and stiffness equal their transposes
  bool proportional = false;  ///< the undamped modes decouple the damping too (C = 0 included);
                              ///< then zero_modes.coordinates is the mass-normalised modal matrix,
                              ///< n x n, with the zero modes in its last columns
  bool extended = false;      ///< residuals were evaluated with twice the working precision
  bool coupled =
      false;            ///< the damping couples zero and nonzero modes, and that was solved exactly
  double coupling = 0;  ///< how strongly: |damping between nonzero and zero modes| / |damping|, in
                        ///< mass-normalised coordinates (Frobenius)

  ZeroModes<N> zero_modes;
  /// n - r modes by falling natural frequency, or by sqrt|l1 l2| where the frequency is NaN; more
  /// than n - r where zero modes' velocities form complex pairs
  ModeList<N> modes;
  /// Eigenvalues -a of the r zero modes' velocities, 1/s: zero if nothing damps them, positive if
  /// they grow (no mode says so then), NaN if they are not real and therefore are among the modes.
  Vector<N> zero_mode_rates;
  /// Proved bounds of |computed - true| for each of zero_mode_rates, 1/s; infinite if none could be
  /// proved. Where no damping acts they are the root of what the stiffness's rounding errors leave
  /// of a frequency.
  Vector<N> zero_mode_rates_bound;
  ModalBasis<N> basis;
};

}  // namespace dashpot::analysis
