#pragma once
#include <dashpot/analysis/spectrum/spectrum_result.hpp>

#include <vector>

namespace dashpot::analysis {

/// The derivatives of the numbers of one mode by one of the coefficients A = M, C or K. Each matrix
/// G is n x n and gives the change by a small dA as  sum_ij G_ij dA_ij.  For a symmetric system G
/// is symmetric, and an entry (i,j) that moves together with (j,i) counts with 2 G_ij.
struct ModeGradient {
  /// Gradient of each eigenvalue. Near critical damping these gradients grow without bound
  /// (infinite or NaN at critical damping), while the gradients of frequency and ratio stay smooth.
  std::array<Eigen::MatrixXcd, 2> eigenvalues;
  Eigen::MatrixXd natural_frequency;
  Eigen::MatrixXd damping_ratio;
};

/// Sensitivities of one mode.
struct ModeSensitivity {
  ModeGradient mass;       ///< per kg m^2 (kg)
  ModeGradient damping;    ///< per N m s/rad (N s/m)
  ModeGradient stiffness;  ///< per N m/rad (N/m)
  /// False where an eigenvalue of another mode lies within 1e-6 of one of these (relative): the
  /// gradients then hold only for changes smaller than that distance. Also false for a mode without
  /// a natural frequency, whose gradients are NaN.
  bool regular = true;
};

/// Returns exact first-order sensitivities, one for each mode of the spectrum. With eigenvectors x,
/// y and d = y'(2 lambda M + C) x,
///
///     d lambda = -y'(lambda^2 dM + lambda dC + dK) x / d.
///
/// The frequency sqrt(l1 l2) and the ratio -(l1 + l2) / (2 frequency) come from sum and product of
/// the two eigenvalues. In a basis block (U, Lambda, Y, weight) of the mode, sum and product change
/// by trace and determinant of  d Lambda = -weight Y'(dM U Lambda^2 + dC U Lambda + dK U).  This
/// stays smooth through critical damping (d = 0), where no eigenvector basis exists.
std::vector<ModeSensitivity> sensitivities(const System<>& system, const Spectrum<>& spectrum);

/// Gradients of one mode's frequency and ratio by the damping matrix, n x n each.
struct DampingGradient {
  Eigen::MatrixXd natural_frequency;
  Eigen::MatrixXd damping_ratio;
};

/// Returns the part of `sensitivities` that a damping design needs, one for each mode.
std::vector<DampingGradient> damping_gradients(const System<>& system, const Spectrum<>& spectrum);

/// Returns J G J', the gradient by the entries of A_C, from G, the gradient by the entries of
/// J' A_C J. An example of A_C is C_C.
Eigen::MatrixXd task_gradient(const Eigen::MatrixXd& jacobian, const Eigen::MatrixXd& gradient);

}  // namespace dashpot::analysis
