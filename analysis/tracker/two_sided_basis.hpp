#pragma once
#include <dashpot/analysis/spectrum/spectrum_result.hpp>
#include <dashpot/analysis/tracker/block_eigenbasis.hpp>

namespace dashpot::analysis {

// Where C or K is not symmetric, or K is singular and has no factor, the left vectors are no image
// of the right ones. The basis then has two sides. With the states (s, v), s = W q, or (q, v)
// without a factor,
//
//     S x' = B x,     S = [I 0; 0 -M],     B = [0 W; W' C] or [0 I; K C],
//     Y S Z = Sigma = diag(I, -I, -I) nearly,     S^-1 B Z = Z Lambda,     Y B S^-1 = Lambda_s Y,
//
// with the left vectors in the rows of Y, and Lambda_s = Sigma Lambda Sigma. Sigma is no signature
// here: the sign of a left vector is free, and with these signs what follows from Y S Z and Y B Z
// is computed as for a symmetric system, where Y = Z'. The two eigenvalues of a block are any two.
// There are as many blocks as joints without a factor; zero modes are the last of them then, with
// an eigenvalue of zero to rounding.

/// Computes Y <- Sigma (I - Sigma R - E) Sigma Y, which goes with Z <- Z (I + E) of the same
/// Newton step: Y S Z = Sigma then holds to second order. Overwrites MV and image of the residual.
void take_left_step(const PackedMatrix& E, TrackedResidual& residual,
                    BlockEigenbasis& basis) noexcept;

/// Makes the two columns of each block orthonormal in the energy diag(w^2 D, D), D the diagonal of
/// M, w the natural frequency of the block, or diag(I, D) with a factor; and its rows of Y dual to
/// them. Blocks whose columns have lengths within a factor of three of each other and do not lean
/// towards each other are left alone, unless `all`. Returns true if any block was changed.
bool balance(const SymmetricPencil& pencil, bool all, BlockEigenbasis& basis) noexcept;

/// Builds a two-sided basis from the basis of a direct solution, in the order of the modes of
/// `spectrum`. Returns false if none is found, because of blocks of several modes that cannot be
/// separated or zero modes that are not real.
bool start_two_sided(const SymmetricPencil& pencil, const Spectrum<kMaxDof>& spectrum,
                     BlockEigenbasis& basis) noexcept;

/// Whether the symmetric matrix M (n x n) has a Cholesky factor.
bool is_positive_definite(const double* M, int n) noexcept;

}  // namespace dashpot::analysis
