#pragma once
#include <dashpot/analysis/matrix_types.hpp>

namespace dashpot::analysis {

/// Returns phi_k(z), the functions that make up every response of a linear system, for k = 0, 1:
///     phi_0(z) = e^z,   phi_1(z) = (e^z - 1) / z,
/// without the cancellation of the latter near z = 0, where phi_1(0) = 1.
///
/// With them, the solution of x' = A x + g for a constant g and x(0) = x0 is
///     x(t) = phi_0(A t) x0 + t phi_1(A t) g.
Complex phi(int k, Complex z);

/// Returns phi_k(A t) for one diagonal block A (1/s) of a modal basis, t in s.
///
/// For one row or two, the rounding errors relative to the size of the result are the errors of the
/// rounded eigenvalues times t, from |A t| = 1e-12 to 1e6 and beyond, because nothing is squared
/// repeatedly. The eigenvalues of a 2 x 2 block may be a complex pair, two real ones or a double
/// one, and one of them may be zero. Larger blocks go through a matrix exponential.
Eigen::MatrixXd phi(int k, const Eigen::MatrixXd& A, double t);

/// Eigenvalues mean +- sqrt(discriminant) of a real 2 x 2 matrix. Each has working precision
/// wherever the entries determine it so well.
struct EigenvaluePair {
  double mean = 0;
  double discriminant = 0;  ///< negative for a complex pair
  Complex first;            ///< larger real part, or positive imaginary part
  Complex second;
};
EigenvaluePair eigenvalue_pair(const Eigen::Matrix2d& A);

}  // namespace dashpot::analysis
