#pragma once
#include <dashpot/analysis/spectrum/refinement.hpp>

namespace dashpot::analysis {

/// Sets R = K U + C U Lambda + M U Lambda^2 and the Gram matrix Y' (C U + M U Lambda) +
/// (Y Gamma)' M U of a residual that has Y Gamma: in double-double arithmetic, rounded once at the
/// end.
template <int N>
void evaluate_extended(const System<N>& system, const ModalBasis<N>& basis,
                       BasisResidual<N>& residual) noexcept;

}  // namespace dashpot::analysis
