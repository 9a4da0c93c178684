#pragma once
#include <dashpot/analysis/spectrum/modal_basis.hpp>
#include <dashpot/analysis/system.hpp>
#include <dashpot/analysis/work.hpp>

namespace dashpot::analysis {

/// The residual of a nearly invariant basis. In exact arithmetic the system is similar to the state
/// matrix Lambda + F*, and entrywise |F* - F| <= F_error: a proved bound that includes every
/// rounding error made in computing F, and the errors that the system gives for its coefficients.
template <int N = kDynamic>
struct BasisResidual {
  State<N> F;        ///< 2n x 2n, 1/s
  State<N> F_error;  ///< 2n x 2n, 1/s; infinite if the basis is too ill conditioned for a bound, or
                     ///< if frequencies leave 1e-60 .. 1e60 rad/s or masses 1e-120 .. 1e120
  Wide<N> MU, CU, KU;  ///< M U, C U, K U: n x 2n

  // Workspace
  Wide<N> V, R, R_size, MV, YG;
  State<N> gram, E, W, YT;
};

/// Evaluates the residual of (basis.U, basis.Lambda) for the original coefficients, and sets the
/// basis's left part and weight. With `extended`, the residual M U Lambda^2 + C U Lambda + K U and
/// the Gram matrix are accumulated in double-double arithmetic, low words included. If `work` does
/// not grant the evaluation, the result has no meaning.
template <int N>
void evaluate_residual(const System<N>& system, bool symmetric, bool extended, ModalBasis<N>& basis,
                       BasisResidual<N>& residual, Work& work) noexcept;
template <int N>
void evaluate_residual(const System<N>& system, bool symmetric, bool extended, ModalBasis<N>& basis,
                       BasisResidual<N>& residual) noexcept {
  Work work;
  evaluate_residual<N>(system, symmetric, extended, basis, residual, work);
}

/// Takes one Newton step on the whole basis: U <- U (I + X), where the blocks of X off the diagonal
/// solve the Sylvester equations  Lambda_i X_ij - X_ij Lambda_j = -F_ij. `enclose` does the other
/// half of the step, Lambda <- Lambda + the diagonal blocks of F, except for the decay rates of
/// zero modes. The iteration converges quadratically. Pairs of blocks with (nearly) common
/// eigenvalues are left alone. (Dongarra, Moler, Wilkinson 1983; Davies, Modi 1986; Ogita, Aishima
/// 2018.)
template <int N>
void newton_step(const BasisResidual<N>& residual, ModalBasis<N>& basis) noexcept;

/// Solves A X - X B = C for X (k x l), A (k x k), B (l x l). Returns a lower bound of the
/// separation of A and B (the smallest singular value of X -> A X - X B, Frobenius). X and the
/// bound are zero if A and B have a common eigenvalue.
template <int N>
double solve_sylvester(const Eigen::Ref<const State<N>>& A, const Eigen::Ref<const State<N>>& B,
                       const State<N>& C, State<N>& X) noexcept;

/// Returns the work of the Sylvester equations of all pairs of these blocks, one for each pair.
template <int N>
std::int64_t sylvester_work(const BlockList<N>& blocks) noexcept;

/// Returns only the lower bound of the separation, for two blocks of Lambda.
template <int N>
double block_separation(const State<N>& Lambda, const Block& a, const Block& b) noexcept;

}  // namespace dashpot::analysis
