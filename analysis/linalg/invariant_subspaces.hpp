#pragma once
// Cluster separation: the invariant subspaces of a matrix to some of its eigenvalues, and what the
// matrix is in the columns of several of them.

#include <dashpot/analysis/base/arithmetic.hpp>
#include <dashpot/analysis/linalg/small_dense.hpp>
#include <dashpot/analysis/work.hpp>

#include <cmath>

namespace dashpot::analysis {

/// k complex numbers or columns, k <= 2n
template <int N>
using ComplexState =
    Eigen::Matrix<Complex, Eigen::Dynamic, Eigen::Dynamic, Eigen::ColMajor, kTwice<N>, kTwice<N>>;
template <int N>
using ComplexStateVector = Eigen::Matrix<Complex, Eigen::Dynamic, 1, Eigen::ColMajor, kTwice<N>, 1>;

/// Returns A - x.
template <int N>
State<N> shifted(State<N> A, double x) noexcept {
  A.diagonal().array() -= x;
  return A;
}

/// Returns an orthonormal basis (as many columns as `size`) of the invariant subspace of A to the
/// eigenvalues nearest two shifts, by subspace iteration with ((A - x) (A - y))^-1 of real shifts,
/// or (A - x)^-1 if y = x. A complex shift x = y stands for its conjugate as well. The iteration
/// takes `steps` steps, or as many as `work` grants. Another `start` gives another basis where
/// there is a choice.
template <int N>
State<N> invariant_subspace(const State<N>& A, const Complex& x, const Complex& y,
                            Eigen::Index size, int steps, Work& work,
                            Eigen::Index start = 0) noexcept {
  const Eigen::Index states = A.rows(), half = (size + 1) / 2;
  State<N> S(states, size);
  for (Eigen::Index j = 0; j < size; ++j) {
    for (Eigen::Index i = 0; i < states; ++i) {
      S(i, j) = std::cos(static_cast<double>((i + 1) * (2 * (start + j) + 3)));  // of full rank
    }
  }
  const bool real = x.imag() == 0;
  State<N> Q = shifted<N>(A, x.real());
  if (x != y) Q = (Q * shifted<N>(A, y.real())).eval();
  const double least_pivot = kEps * (real ? Q : A).norm();
  const std::int64_t step_work = (real ? 1 : 4) * (cubed(states, 2) + squared(states, 20)) +
                                 size * (squared(states, real ? 5 : 8) + 18 * size * states + 200);
  for (int k = 0; k < steps && work.take(step_work); ++k) {
    if (real) {
      State<N> factor = Q;
      solve_in_place(factor, S, least_pivot);
    } else {  // pairs of columns as complex ones, which grow along x alone
      ComplexState<N> factor = A.template cast<Complex>(), W(states, half);
      factor.diagonal().array() -= x;
      W.real() = S.leftCols(half);
      W.imag() = S.rightCols(half);
      solve_in_place(factor, W, least_pivot);
      S.leftCols(half) = W.real();
      S.rightCols(half) = W.imag();
    }
    orthonormalize(S);
  }
  return S;
}

/// A matrix A in other columns X: A X = X Lambda.
template <int N>
struct Separation {
  Separation() = default;
  Separation(const State<N>& A, const State<N>& X) noexcept
      : columns(X), inverse(State<N>::Identity(X.rows(), X.cols())) {
    State<N> factor = X;
    solve_in_place(factor, inverse, std::numeric_limits<double>::min());
    Lambda.noalias() = inverse.lazyProduct(A) * X;
    condition = X.norm() * inverse.norm();
  }

  State<N> columns, inverse, Lambda;
  double condition = kInfinity;  ///< of X
};

}  // namespace dashpot::analysis
