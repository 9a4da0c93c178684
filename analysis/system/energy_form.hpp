#pragma once
#include <dashpot/analysis/system/zero_modes.hpp>

namespace dashpot::analysis {

/// The system in the coordinates p of ZeroModes, q = coordinates p:
///
///     p'' + D p' + Kp p = coordinates' f,
///
/// ordered as [nonzero modes | zero modes that the damping couples to them | other zero modes].
/// Whatever can be decoupled exactly is decoupled: undamped modes of equal frequency are rotated
/// until the damping tells them apart, and the zero modes until their own damping does.
template <int N = kDynamic>
struct EnergyForm {
  int modes = 0;          ///< m = n - r
  int coupled_zeros = 0;  ///< zero modes inseparable from the other modes' spectrum
  int free_zeros = 0;     ///< independent zero modes, whose velocities decay at `free_rates`
  Square<N> damping;      ///< D, n x n, 1/s
  Square<N> stiffness;    ///< Kp, n x n, 1/s^2; diagonal if symmetric; zero columns for zero modes
  Vector<N> free_rates;   ///< a >= 0 for each free zero mode, 1/s
  bool symmetric = true;
  bool proportional = false;  ///< D is diagonal on the nonzero modes, and none is coupled
  double coupling = 0;        ///< |D between nonzero and zero modes| / |D|, Frobenius

  int core() const { return modes + coupled_zeros; }
};

/// Rotates `zero_modes.coordinates` (and `basis`) as described above, and returns the system in
/// them.
template <int N>
EnergyForm<N> to_energy_form(const System<N>& system, ZeroModes<N>& zero_modes) noexcept;

}  // namespace dashpot::analysis
