#pragma once
// Eigenvalues in extended precision by another algorithm (Hessenberg QR on the state matrix in
// energy coordinates), and the check that published bounds enclose them.

#include <dashpot/analysis/mode_tracker.hpp>

#include <Eigen/Cholesky>
#include <Eigen/Eigenvalues>
#include <algorithm>
#include <array>
#include <cmath>
#include <utility>
#include <vector>

namespace dashpot::testing {

/// x + i y
template <typename Real>
struct Point {
  Real x{}, y{};
};

template <typename Real>
Real distance(const Point<Real>& a, const Point<Real>& b) {
  using std::sqrt;
  const Real x = a.x - b.x, y = a.y - b.y;
  return sqrt(x * x + y * y);
}

template <typename Real>
using MatrixOf = Eigen::Matrix<Real, Eigen::Dynamic, Eigen::Dynamic>;

/// Returns the eigenvalues of a quasi-triangular matrix.
template <typename Real>
std::vector<Point<Real>> diagonal_eigenvalues(const MatrixOf<Real>& T) {
  using std::sqrt;
  std::vector<Point<Real>> values;
  for (Eigen::Index k = 0; k < T.rows(); ++k) {
    if (k + 1 == T.rows() || T(k + 1, k) == Real(0)) {
      values.push_back({T(k, k), Real(0)});
      continue;
    }
    const Real mean = (T(k, k) + T(k + 1, k + 1)) / 2, half = (T(k, k) - T(k + 1, k + 1)) / 2;
    const Real discriminant = half * half + T(k, k + 1) * T(k + 1, k);
    const Real root = sqrt(discriminant < 0 ? Real(-discriminant) : discriminant);
    for (const int sign : {1, -1}) {
      values.push_back(discriminant < 0 ? Point<Real>{mean, sign * root}
                                        : Point<Real>{mean + sign * root, Real(0)});
    }
    ++k;
  }
  return values;
}

/// State matrix [0 J; -J' -D], with M = L L', D = L^-1 C L^-T and J = W L^-T (p x n). Without a
/// factor W, J is the transposed Cholesky factor of L^-1 K L^-T. Where K has none, it is
/// [0 I; -L^-1 K L^-T -D].
template <typename Real>
MatrixOf<Real> energy_state_matrix(const analysis::System<analysis::kMaxDof>& system) {
  using Matrix = MatrixOf<Real>;
  const auto wide = [](const auto& a) { return Matrix(a.template cast<Real>()); };
  const Eigen::Index n = system.dof();
  const Matrix L = wide(system.mass).llt().matrixL();
  const auto lower = L.template triangularView<Eigen::Lower>();
  const auto congruent = [&](const auto& A) {
    const Matrix half = lower.solve(wide(A));
    return Matrix(lower.solve(Matrix(half.transpose())).transpose());
  };
  const Matrix D = congruent(system.damping);
  Matrix J, minus_pull;
  if (system.stiffness_factor.rows() > 0) {
    J = lower.solve(Matrix(wide(system.stiffness_factor).transpose())).transpose();
    minus_pull = J.transpose();
  } else {
    const Matrix K = congruent(system.stiffness);
    const Eigen::LLT<Matrix> cholesky(K);
    const bool definite =
        system.stiffness == system.stiffness.transpose() && cholesky.info() == Eigen::Success;
    J = definite ? Matrix(cholesky.matrixU()) : Matrix(Matrix::Identity(n, n));
    minus_pull = definite ? Matrix(J.transpose()) : K;
  }
  const Eigen::Index p = J.rows();
  Matrix A = Matrix::Zero(p + n, p + n);
  A.topRightCorner(p, n) = J;
  A.bottomLeftCorner(n, p) = -minus_pull;
  A.bottomRightCorner(n, n) = -D;
  return A;
}

/// p + n of them: those of the modes, and the rates of zero modes, with their zeros where K has no
/// factor.
template <typename Real>
std::vector<Point<Real>> precise_eigenvalues(const analysis::System<analysis::kMaxDof>& system) {
  const Eigen::RealSchur<MatrixOf<Real>> schur(energy_state_matrix<Real>(system), false);
  return diagonal_eigenvalues<Real>(schur.matrixT());
}

struct Verdict {
  bool enclosed = true;
  bool proved = true;     ///< no bound is infinite
  double tightest = 0;    ///< largest error / bound; slack counts as error
  double widest = 0;      ///< largest bound / |eigenvalue|
  const char* what = "";  ///< was not enclosed
};

/// Gives each published eigenvalue i a true one j of its own within reach[i] + slack[j], by
/// augmenting paths; no slack: what is true is exact.
template <typename Real>
class Matching {
 public:
  Matching(const std::vector<Point<Real>>& published, const std::vector<Point<Real>>& truth,
           const std::vector<Real>& reach, std::vector<Real> slack = {})
      : published_(published),
        truth_(truth),
        reach_(reach),
        slack_(std::move(slack)),
        owner_(truth.size(), -1) {
    slack_.resize(truth.size(), Real(0));
    for (std::size_t i = 0; i < published.size(); ++i) {
      visited_.assign(truth.size(), false);
      complete_ = complete_ && place(i);
    }
  }
  bool complete() const { return complete_; }
  /// The true eigenvalue of published i.
  std::size_t of(std::size_t i) const {
    const auto found = std::find(owner_.begin(), owner_.end(), static_cast<int>(i));
    return static_cast<std::size_t>(found - owner_.begin());
  }

 private:
  bool place(std::size_t i) {
    for (std::size_t j = 0; j < truth_.size(); ++j) {
      if (visited_[j] || !(distance(published_[i], truth_[j]) <= reach_[i] + slack_[j])) continue;
      visited_[j] = true;
      if (owner_[j] >= 0 && !place(static_cast<std::size_t>(owner_[j]))) continue;
      owner_[j] = static_cast<int>(i);
      return true;
    }
    return false;
  }

  const std::vector<Point<Real>>&published_, &truth_;
  const std::vector<Real>& reach_;
  std::vector<Real> slack_;
  std::vector<int> owner_;
  std::vector<bool> visited_;
  bool complete_ = true;
};

/// Whether each eigenvalue is within its bound of a true one, one to one; and natural frequency and
/// damping ratio within theirs, where it is clear which two true eigenvalues are the mode's.
/// `accuracy`: relative to the largest eigenvalue, that of the truth.
template <typename Real>
Verdict judge_against(const std::vector<Point<Real>>& truth,
                      const analysis::TrackedSpectrum& spectrum, double accuracy) {
  using std::abs;
  using std::sqrt;
  Real size(0);
  for (const Point<Real>& z : truth) size = std::max<Real>(size, distance(z, Point<Real>{}));
  const Real slack = Real(accuracy) * size;
  std::vector<Point<Real>> published;
  std::vector<Real> reach;
  Verdict verdict;
  for (int i = 0; i < spectrum.mode_count; ++i) {
    const analysis::ModeNumbers& mode = spectrum.modes[static_cast<std::size_t>(i)];
    verdict.proved = verdict.proved && std::isfinite(mode.error_bound);
    for (const auto& value : mode.eigenvalues) {
      published.push_back({Real(value.real()), Real(value.imag())});
      reach.push_back(std::isfinite(mode.error_bound) ? Real(Real(mode.error_bound) + slack)
                                                      : Real(1e300));
    }
  }
  const auto fail = [&](const char* what) {
    if (verdict.enclosed) verdict.what = what;
    verdict.enclosed = false;
  };
  const Matching<Real> matching(published, truth, reach);
  if (!matching.complete()) {
    fail("eigenvalues");
    return verdict;
  }
  const auto compare = [&](const Real& error, double bound, const char* what) {
    if (!std::isfinite(bound)) return;
    if (!(error <= Real(bound))) fail(what);
    const double ratio = static_cast<double>(Real(error / Real(bound)));
    if (error > 0 && !(ratio <= verdict.tightest)) verdict.tightest = ratio;
  };
  for (int i = 0; i < spectrum.mode_count; ++i) {
    const analysis::ModeNumbers& mode = spectrum.modes[static_cast<std::size_t>(i)];
    const std::size_t k = 2 * static_cast<std::size_t>(i);
    const Point<Real>&a = truth[matching.of(k)], &b = truth[matching.of(k + 1)];
    for (const std::size_t e : {k, k + 1}) {
      Real error = distance(published[e], truth[matching.of(e)]) - slack;
      compare(error < 0 ? Real(0) : error, mode.error_bound, "eigenvalues");
      const double modulus = static_cast<double>(distance(published[e], Point<Real>{}));
      if (modulus > 0) verdict.widest = std::max(verdict.widest, mode.error_bound / modulus);
    }
    bool clear = std::isfinite(mode.error_bound);
    for (std::size_t j = 0; j < truth.size() && clear; ++j) {
      const bool own = j == matching.of(k) || j == matching.of(k + 1);
      const bool near = distance(truth[j], published[k]) <= 4 * reach[k] ||
                        distance(truth[j], published[k + 1]) <= 4 * reach[k];
      clear = own || !near;
    }
    const Real product = a.x * b.x - a.y * b.y;
    if (!clear || !(product > 0) || std::isnan(mode.natural_frequency)) continue;
    const Real omega = sqrt(product), zeta = -(a.x + b.x) / (2 * omega);
    const auto beyond = [&](const Real& error, const Real& allowed) {
      return error > allowed ? Real(error - allowed) : Real(0);
    };
    compare(beyond(abs(Real(omega - Real(mode.natural_frequency))), slack),
            mode.natural_frequency_bound, "natural frequency");
    compare(beyond(abs(Real(zeta - Real(mode.damping_ratio))), Real(slack / omega)),
            mode.damping_ratio_bound, "damping ratio");
  }
  return verdict;
}

/// Judges against eigenvalues computed in this precision.
template <typename Real>
Verdict judge(const analysis::System<analysis::kMaxDof>& system,
              const analysis::TrackedSpectrum& spectrum, double accuracy) {
  return judge_against<Real>(precise_eigenvalues<Real>(system), spectrum, accuracy);
}

}  // namespace dashpot::testing
