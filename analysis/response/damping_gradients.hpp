#pragma once
#include <dashpot/analysis/spectrum/spectrum_result.hpp>

#include <vector>

namespace dashpot::analysis {

/// Returns the exact derivatives of the damping ratios by the damping matrix, n x n for each mode
/// of the spectrum: a small dC changes a ratio by  sum_ij G_ij dC_ij.  For a symmetric system G is
/// symmetric, and an entry (i,j) that moves together with (j,i) counts with 2 G_ij. NaN without a
/// natural frequency. With eigenvectors x, y and d = y'(2 lambda M + C) x,
///
///     d lambda = -lambda y' dC x / d.
///
/// The frequency sqrt(l1 l2) and the ratio -(l1 + l2) / (2 frequency) come from sum and product of
/// the two eigenvalues. In a basis block (U, Lambda, Y, weight) of the mode, sum and product change
/// by trace and determinant of  d Lambda = -weight Y' dC U Lambda.  This stays smooth through
/// critical damping (d = 0), where no eigenvector basis exists.
std::vector<Eigen::MatrixXd> damping_gradients(const System<>& system, const Spectrum<>& spectrum);

}  // namespace dashpot::analysis
