#pragma once
// Eigenvalues of (l^2 M + l C + K) u = 0 in balls that FLINT/Arb proves to hold them: an enclosure
// by another library, another algorithm and another arithmetic than ours.
#include <dashpot/analysis/system.hpp>
#include <dashpot/tests/support/systems.hpp>

#include <acb_mat.h>

#include <algorithm>
#include <limits>
#include <stdexcept>
#include <vector>

namespace dashpot::testing {

/// rows x columns balls, all zero.
class BallMatrix {
 public:
  BallMatrix(Eigen::Index rows, Eigen::Index columns) { acb_mat_init(balls_, rows, columns); }
  explicit BallMatrix(const Eigen::MatrixXd& A) : BallMatrix(A.rows(), A.cols()) {
    for (Eigen::Index i = 0; i < A.rows(); ++i) {
      for (Eigen::Index j = 0; j < A.cols(); ++j) acb_set_d(at(i, j), A(i, j));
    }
  }
  BallMatrix(const BallMatrix&) = delete;
  BallMatrix& operator=(const BallMatrix&) = delete;
  ~BallMatrix() { acb_mat_clear(balls_); }

  acb_ptr at(Eigen::Index i, Eigen::Index j) { return acb_mat_entry_ptr(balls_, i, j); }
  acb_mat_struct* get() { return balls_; }
  /// The centres of the balls, which have to be thin.
  Eigen::MatrixXcd rounded() {
    const auto part = [](const arb_t ball) {
      const double center = arf_get_d(arb_midref(ball), ARF_RND_NEAR);
      if (!(mag_get_d(arb_radref(ball)) <= 1e-18 * std::abs(center) + 1e-101)) {
        throw std::runtime_error("too few bits");
      }
      return center;
    };
    return Eigen::MatrixXcd::NullaryExpr(balls_->r, balls_->c, [&](Eigen::Index i, Eigen::Index j) {
      return analysis::Complex(part(acb_realref(at(i, j))), part(acb_imagref(at(i, j))));
    });
  }

 private:
  acb_mat_t balls_;
};

/// Eigenvalue i lies within radius[i] of a number that rounds to center[i], one to one.
struct CertifiedEigenvalues {
  std::vector<LongComplex> center;
  std::vector<long double> radius;
  int bits = 0;  ///< of the arithmetic; 0: nothing could be proved

  /// Bounds of |eigenvalue i - center[i]|.
  std::vector<long double> slack() const {
    std::vector<long double> all = radius;
    for (std::size_t i = 0; i < all.size(); ++i) {
      all[i] += std::numeric_limits<long double>::epsilon() * std::abs(center[i]);
    }
    return all;
  }
  long double widest() const {
    return radius.empty() ? 0 : *std::max_element(radius.begin(), radius.end());
  }
};

/// State matrix [0 I; -M^-1 K  -M^-1 C] (2n rows). With a factor W (p x n) it is
/// [0 W; -M^-1 W'  -M^-1 C] (p + n rows), which has n - p eigenvalues at zero less. Low words and
/// errors of the system are not read.
template <int N>
void set_state_matrix(const analysis::System<N>& system, slong bits, BallMatrix& A) {
  const Eigen::Index n = system.dof(), p = A.get()->r - n;
  const bool factored = system.stiffness_factor.rows() > 0;
  const Eigen::MatrixXd W =
      factored ? Eigen::MatrixXd(system.stiffness_factor) : Eigen::MatrixXd::Identity(n, n);
  Eigen::MatrixXd KC(n, p + n);
  KC.leftCols(p) = factored ? Eigen::MatrixXd(W.transpose()) : Eigen::MatrixXd(system.stiffness);
  KC.rightCols(n) = system.damping;
  BallMatrix M{Eigen::MatrixXd(system.mass)}, right{KC}, solution(n, p + n);
  acb_mat_solve(solution.get(), M.get(), right.get(), bits);
  for (Eigen::Index j = 0; j < p + n; ++j) {
    for (Eigen::Index i = 0; i < n; ++i) acb_neg(A.at(p + i, j), solution.at(i, j));
    for (Eigen::Index i = 0; i < p && j >= p; ++i) acb_set_d(A.at(i, j), W(i, j - p));
  }
}

/// The centre of a ball, rounded to long double, real and imaginary part each by itself.
inline LongComplex rounded(const acb_t ball) {
  arf_t low;
  arf_init(low);
  const auto part = [&](const arb_t given) {
    const double high = arf_get_d(arb_midref(given), ARF_RND_NEAR);
    arf_set_d(low, high);
    arf_sub(low, arb_midref(given), low, ARF_PREC_EXACT, ARF_RND_NEAR);
    return static_cast<long double>(high) + static_cast<long double>(arf_get_d(low, ARF_RND_NEAR));
  };
  const LongComplex center(part(acb_realref(ball)), part(acb_imagref(ball)));
  arf_clear(low);
  return center;
}

/// Eigenvalues as arithmetic with `bits` encloses them. Those that it cannot tell apart share a
/// ball, as often as there are eigenvalues in it.
template <int N>
CertifiedEigenvalues certify_eigenvalues(const analysis::System<N>& system, int bits) {
  const Eigen::Index n = system.dof(), rows = system.stiffness_factor.rows();
  const Eigen::Index size = n + (rows > 0 ? rows : n);
  BallMatrix A(size, size), vectors(size, size), approximate(1, size), proved(1, size);
  set_state_matrix(system, bits, A);
  acb_mat_approx_eig_qr(approximate.at(0, 0), nullptr, vectors.get(), A.get(), nullptr, 0, bits);
  CertifiedEigenvalues result;
  const bool found = acb_mat_eig_multiple(proved.at(0, 0), A.get(), approximate.at(0, 0),
                                          vectors.get(), bits) != 0;
  if (!found) return result;
  result.bits = bits;
  arf_t radius;
  arf_init(radius);
  for (Eigen::Index i = 0; i < size; ++i) {
    result.center.push_back(rounded(proved.at(0, i)));
    acb_get_rad_ubound_arf(radius, proved.at(0, i), MAG_BITS);
    result.radius.push_back(static_cast<long double>(arf_get_d(radius, ARF_RND_UP)));
  }
  arf_clear(radius);
  return result;
}

/// Certifies with as many bits, 128 to 1024, as it takes to have no radius above `wanted`.
template <int N>
CertifiedEigenvalues certify_within(const analysis::System<N>& system, long double wanted) {
  constexpr int kMostBits = 1024;
  CertifiedEigenvalues result;
  for (int bits = 128; bits <= kMostBits; bits *= 2) {
    result = certify_eigenvalues(system, bits);
    if (result.bits > 0 && result.widest() <= wanted) break;
  }
  return result;
}

}  // namespace dashpot::testing
