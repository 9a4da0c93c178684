#pragma once
// The eigenvalues of a system to the last digits of a long double. FLINT/Arb proves them where it
// is installed. Where it is missing, a long double of 113 digits (64-bit ARM) serves, and elsewhere
// what needs them is skipped.
#if defined(DASHPOT_HAVE_ARB)
#include <dashpot/tests/support/certified_spectrum.hpp>

#include <arb_fmpz_poly.h>
#include <flint/fmpz_mat.h>
#include <flint/fmpz_poly_factor.h>
#include <flint/fmpz_poly_mat.h>

#include <algorithm>
#include <cmath>
#include <initializer_list>
#include <vector>

#define DASHPOT_NEEDS_PROVED_EIGENVALUES() static_cast<void>(0)

namespace dashpot::testing {

/// A times a power of two that makes all doubles whole numbers.
inline void set_whole(fmpz_mat_t whole, const Eigen::MatrixXd& A, int power) {
  for (Eigen::Index i = 0; i < A.rows(); ++i) {
    for (Eigen::Index j = 0; j < A.cols(); ++j) {
      int exponent = 0;
      fmpz* const entry = fmpz_mat_entry(whole, i, j);
      fmpz_set_d(entry, std::ldexp(std::frexp(A(i, j), &exponent), 53));
      if (A(i, j) != 0) fmpz_mul_2exp(entry, entry, static_cast<ulong>(power + exponent - 53));
    }
  }
}

/// The least power of two that makes all entries whole numbers.
inline int whole_power(std::initializer_list<Eigen::MatrixXd> matrices) {
  int power = 0;
  for (const Eigen::MatrixXd& A : matrices) {
    for (const double entry : A.reshaped()) {
      if (entry != 0) power = std::max(power, 52 - std::ilogb(entry));
    }
  }
  return power;
}

/// det(l^2 M + l C + K) without common factors, exactly; with a factor W, K = W' W.
template <int N>
void set_characteristic(const analysis::System<N>& system, fmpz_poly_t polynomial) {
  const slong n = system.dof(), p = system.stiffness_factor.rows();
  const Eigen::MatrixXd factor = system.stiffness_factor;
  const Eigen::MatrixXd parts[] = {system.stiffness, system.damping, system.mass};
  const int root = whole_power({factor, parts[0], parts[1], parts[2]}),
            whole = p > 0 ? 2 * root : root;
  fmpz_poly_mat_t pencil;
  fmpz_mat_t part, W, WT;
  fmpz_poly_mat_init(pencil, n, n);
  fmpz_mat_init(part, n, n);
  fmpz_mat_init(W, p, n);
  fmpz_mat_init(WT, n, p);
  set_whole(W, factor, root);
  fmpz_mat_transpose(WT, W);
  for (slong power = 0; power < 3; ++power) {
    set_whole(part, parts[power], whole);
    if (power == 0 && p > 0) fmpz_mat_mul(part, WT, W);
    for (slong i = 0; i < n * n; ++i) {
      fmpz_poly_set_coeff_fmpz(fmpz_poly_mat_entry(pencil, i / n, i % n), power,
                               fmpz_mat_entry(part, i / n, i % n));
    }
  }
  fmpz_poly_mat_det(polynomial, pencil);
  fmpz_poly_primitive_part(polynomial, polynomial);
  fmpz_poly_mat_clear(pencil);
  fmpz_mat_clear(part);
  fmpz_mat_clear(W);
  fmpz_mat_clear(WT);
}

/// Calls see(root) for each of the 2n eigenvalues, enclosed relatively to so many bits.
template <int N, class See>
void for_each_eigenvalue(const analysis::System<N>& system, slong bits, const See& see) {
  fmpz_poly_t polynomial;
  fmpz_poly_factor_t factors;
  fmpz_poly_init(polynomial);
  fmpz_poly_factor_init(factors);
  set_characteristic(system, polynomial);
  fmpz_poly_factor_squarefree(factors, polynomial);
  for (slong i = 0; i < factors->num; ++i) {
    const slong count = fmpz_poly_degree(factors->p + i);
    const acb_ptr roots = _acb_vec_init(count);
    arb_fmpz_poly_complex_roots(roots, factors->p + i, 0, bits);
    for (slong k = 0; k < count * factors->exp[i]; ++k) see(roots + k % count);
    _acb_vec_clear(roots, count);
  }
  fmpz_poly_clear(polynomial);
  fmpz_poly_factor_clear(factors);
}

/// Whether each eigenvalue is known to 40 digits, or next to the largest is nothing.
inline bool to_forty_digits(const CertifiedEigenvalues& found) {
  long double largest = 0;
  for (const LongComplex& z : found.center) largest = std::max(largest, std::abs(z));
  bool all = found.bits > 0;
  for (std::size_t i = 0; i < found.center.size(); ++i) {
    all = all && (found.radius[i] <= 1e-40L * std::abs(found.center[i]) ||
                  found.radius[i] <= 1e-60L * largest);
  }
  return all;
}

/// All 2n eigenvalues, as the roots of the exact polynomial.
template <int N>
std::vector<LongComplex> exact_eigenvalues(const analysis::System<N>& system) {
  std::vector<LongComplex> all;
  for_each_eigenvalue(system, 200, [&](const acb_t root) { all.push_back(rounded(root)); });
  return all;
}

/// Eigenvalues of [0 W; -M^-1 W'  -M^-1 C] where there is a factor W (p x n): n - p zeros less.
/// They come from the matrices, which serves at any scale; or from the polynomial, where
/// eigenvalues coincide.
template <int N>
std::vector<LongComplex> proved_eigenvalues(const analysis::System<N>& system) {
  for (const int bits : {128, 256, 512, 1024, 2048}) {
    const CertifiedEigenvalues found = certify_eigenvalues(system, bits);
    if (to_forty_digits(found)) return found.center;
  }
  std::vector<LongComplex> all = exact_eigenvalues(system);
  const auto rows = system.stiffness_factor.rows();
  for (auto zeros = rows > 0 ? system.dof() - rows : 0; zeros > 0; --zeros) {
    const auto zero = std::find(all.begin(), all.end(), LongComplex(0));
    if (zero != all.end()) all.erase(zero);
  }
  return all;
}

}  // namespace dashpot::testing
#else
#include <dashpot/tests/support/systems.hpp>

#define DASHPOT_NEEDS_PROVED_EIGENVALUES()              \
  if (std::numeric_limits<long double>::digits < 113) { \
    GTEST_SKIP() << "FLINT/Arb is not installed";       \
  }                                                     \
  static_assert(true)

namespace dashpot::testing {

template <int N>
std::vector<LongComplex> proved_eigenvalues(const analysis::System<N>& system) {
  return true_eigenvalues(system);
}

template <int N>
std::vector<LongComplex> exact_eigenvalues(analysis::System<N> system) {
  system.stiffness_factor.resize(0, system.dof());
  return true_eigenvalues(system);
}

}  // namespace dashpot::testing
#endif
