#pragma once
#include <dashpot/analysis/solver_status.hpp>
#include <dashpot/analysis/spectrum/modal_basis.hpp>
#include <dashpot/analysis/system/energy_form.hpp>
#include <dashpot/analysis/work.hpp>

namespace dashpot::analysis {

/// Fills U, Lambda and blocks of `basis` from an energy form. The eigenvalues are found by QR
/// iteration on
///
///     A = [0 G; -G' -D]   (time derivative of [elastic coordinates; velocities]),
///
/// which has every eigenvalue except the r zeros of the zero modes' positions. The vectors are then
/// found by inverse iteration on lambda^2 + lambda D + Kp. Eigenvalues share a block, found by
/// subspace iteration, if they are too close together to tell their vectors apart (critical
/// damping, coinciding modes). Proportional damping needs neither iteration, because its modes are
/// known in closed form.
///
/// The result is accurate to about eps |A|; `refine` finishes it against the original coefficients.
///
/// Eigenvalues within the relative distance `cluster` of each other share a block unless their
/// vectors are well apart. A larger `cluster` is slower and safer, and from 2 on one block holds
/// all eigenvalues. With `coinciding` modes of one cluster near critical damping are taken to have
/// one frequency, if they have it to rounding. Returns kUnfinished, and no basis, if `work` does
/// not grant enough.
template <int N>
Status build_starting_basis(const EnergyForm<N>& form, const ZeroModes<N>& zero_modes,
                            double cluster, bool coinciding, ModalBasis<N>& basis,
                            Work& work) noexcept;

}  // namespace dashpot::analysis
