#pragma once
#include <dashpot/analysis/spectrum/modal_basis.hpp>
#include <dashpot/analysis/system.hpp>

namespace dashpot::analysis {

/// Sets R = K U + C U Lambda + M U Lambda^2 (n x 2n) and the Gram matrix
/// Y' (C U + M U Lambda) + (Y Gamma)' M U (2n x 2n) of a basis, in double-double arithmetic,
/// rounded once at the end. `YG` is Y Gamma. R and gram have their sizes already.
template <int N>
void evaluate_extended(const System<N>& system, const ModalBasis<N>& basis, const Wide<N>& YG,
                       Wide<N>& R, State<N>& gram) noexcept;

}  // namespace dashpot::analysis
