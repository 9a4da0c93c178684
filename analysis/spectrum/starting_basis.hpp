#pragma once
#include <dashpot/analysis/spectrum/modal_basis.hpp>
#include <dashpot/analysis/status.hpp>
#include <dashpot/analysis/system/energy_form.hpp>
#include <dashpot/analysis/work.hpp>

namespace dashpot::analysis {

/// Fills U, Lambda and blocks of `basis` from an energy form: eigenvalues by QR iteration on
///
///     A = [0 G; -G' -D]   (time derivative of [elastic coordinate-energy coordinates;
///     velocities]),
///
/// which holds every eigenvalue but the r zeros of the zero modes' positions, then vectors by
/// inverse iteration on lambda^2 + lambda D + Kp. Eigenvalues that lie too close together for their
/// vectors to be told apart (critical damping, coinciding modes) share a block, found by subspace
/// iteration. Proportional damping needs neither: its modes are written down.
///
/// The result is accurate to about eps |A|; `refine` finishes it against the original coefficients.
///
/// Eigenvalues within the relative distance `cluster` of each other share a block unless their
/// vectors are well apart: more is slower and safer, and from 2 on one block holds them all.
/// Returns kUnfinished, and no basis, if `work` does not grant enough.
template <int N>
Status build_starting_basis(const EnergyForm<N>& form, const ZeroModes<N>& zero_modes,
                            double cluster, ModalBasis<N>& basis, Work& work) noexcept;

}  // namespace dashpot::analysis
