#include <dashpot/analysis/base/arithmetic.hpp>
#include <dashpot/analysis/linalg/hessenberg_qr.hpp>
#include <dashpot/analysis/linalg/small_dense.hpp>
#include <dashpot/analysis/spectrum/mode_shapes.hpp>

#include <algorithm>
#include <cmath>
#include <limits>

namespace dashpot::analysis {
namespace {

/// A vector in the columns of a block.
template <int N>
class BlockVector {
 public:
  explicit BlockVector(const Block& block)
      : first_(block.first), re_(StateVector<N>::Zero(block.size)), im_(re_) {}
  void set(Eigen::Index i, const Complex& value) {
    re_[i] = value.real();
    im_[i] = value.imag();
  }
  /// Entry `row` of the combination of these columns of X.
  Complex combine(const Wide<N>& X, Eigen::Index row) const {
    double re = 0, im = 0;
    for (Eigen::Index i = 0; i < re_.size(); ++i) {
      re += X(row, first_ + i) * re_[i];
      im += X(row, first_ + i) * im_[i];
    }
    return {re, im};
  }

 private:
  Eigen::Index first_;
  StateVector<N> re_, im_;
};

/// Scales u, of this kinetic energy u^H M u, to 1, with its largest entry real and positive.
template <int N>
void normalize(double energy, ComplexVector<N>& u) {
  Complex largest = 0;
  for (const Complex& entry : u) largest = std::norm(entry) > std::norm(largest) ? entry : largest;
  const Complex factor = std::conj(largest) / (modulus(largest) * std::sqrt(energy));
  for (Complex& entry : u) entry = product(entry, factor);
}

/// Eigenvector of a block of `matrix` (Lambda or Gamma) to the eigenvalue mu.
template <int N>
BlockVector<N> eigenvector(const State<N>& matrix, const Block& b, const Complex& mu) {
  BlockVector<N> w(b);
  if (b.size == 1) {
    w.set(0, 1);
  } else if (b.size == 2) {
    const Eigen::Index k = b.first;
    const auto vector =
        eigenvector_2x2(matrix(k, k), matrix(k, k + 1), matrix(k + 1, k), matrix(k + 1, k + 1), mu);
    w.set(0, vector[0]);
    w.set(1, vector[1]);
  } else {
    // Inverse iteration, kept where it grows most: near a defective eigenvalue a further step may
    // well be worse (Wilkinson 1979).
    const State<N> L = matrix.block(b.first, b.first, b.size, b.size);
    ComplexVector<kTwice<N>> x = ComplexVector<kTwice<N>>::Ones(b.size);
    double best = 0;
    Eigen::Matrix<Complex, Eigen::Dynamic, Eigen::Dynamic, 0, kTwice<N>, kTwice<N>> shifted;
    for (int k = 0; k < 3; ++k) {
      shifted = L.template cast<Complex>();
      shifted.diagonal().array() -= mu;
      solve_in_place(shifted, x, kUnit * L.norm());
      const double growth = x.stableNorm();
      x /= growth;
      if (!(growth > best)) continue;
      best = growth;
      for (int j = 0; j < b.size; ++j) w.set(j, x[j]);
    }
  }
  return w;
}

}  // namespace

template <int N>
ComplexVector<N> ModeShapes<N>::left_shape(const Block& block, const Complex& mu) const noexcept {
  const BlockVector<N> w = eigenvector<N>(basis_.Gamma, block, mu);
  ComplexVector<N> y(basis_.Y.rows());
  for (Eigen::Index row = 0; row < y.size(); ++row) y[row] = w.combine(basis_.Y, row);
  const Vector<N> re = y.real(), im = y.imag();
  normalize<N>(re.dot(system_.mass * re) + im.dot(system_.mass * im), y);
  return y;
}

// Errors do not depend on lengths, and so the sums are those of vectors as they come.
template <int N>
void ModeShapes<N>::write(const Block& block, const Complex& mu, std::size_t which,
                          Mode<N>& mode) const noexcept {
  const BlockVector<N> w = eigenvector<N>(basis_.Lambda, block, mu);
  ComplexVector<N>&u = mode.shapes[which], &y = mode.left_shapes[which];
  u.resize(basis_.U.rows());
  if (!symmetric_) y = left_shape(block, mu);
  double energy = 0, length2 = 0, residual2 = 0;
  Complex slope = 0;
  for (Eigen::Index row = 0; row < u.size(); ++row) {
    const Complex x = w.combine(basis_.U, row), Mx = w.combine(residual_.MU, row),
                  Cx = w.combine(residual_.CU, row), Kx = w.combine(residual_.KU, row);
    energy += x.real() * Mx.real() + x.imag() * Mx.imag();
    length2 += std::norm(x);
    residual2 += std::norm(product(mu, product(mu, Mx) + Cx) + Kx);
    slope += product(symmetric_ ? x : y[row], product(2.0 * mu, Mx) + Cx);
    u[row] = x;
  }
  const double length = std::sqrt(length2), left = symmetric_ ? length : y.norm();
  const double size = std::norm(mu) * M_norm_ + modulus(mu) * C_norm_ + K_norm_;
  const double backward_error = std::sqrt(residual2) / (size * length);
  mode.backward_error =
      std::max(mode.backward_error,
               backward_error >= 0 ? backward_error : std::numeric_limits<double>::infinity());
  mode.condition = std::max(mode.condition, left * length * size / (modulus(mu) * modulus(slope)));
  normalize<N>(energy, u);
  if (symmetric_) y = u;
}

template class ModeShapes<kDynamic>;
template class ModeShapes<kMaxDof>;

}  // namespace dashpot::analysis
