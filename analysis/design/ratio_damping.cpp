#include <dashpot/analysis/design/modal_damping.hpp>
#include <dashpot/analysis/ratio_damping.hpp>

#include <algorithm>
#include <cmath>
#include <limits>

namespace dashpot::analysis {

using Eigen::Index;

namespace {

/// Computes F (n x n, lower triangular) with K = F F' for a symmetric positive semidefinite K, of
/// which the lower triangle is read. A pivot that is zero to rounding ends its column; the rest of
/// the column then has to be zero too. Returns false, with F incomplete, unless K is semidefinite
/// to rounding.
template <class Symmetric, class Matrix>
bool semidefinite_cholesky(const Symmetric& K, Matrix& F) noexcept {
  const Eigen::Index n = K.rows();
  F.setZero(n, n);
  for (Eigen::Index j = 0; j < n; ++j) {
    const double rounding =
        16 * static_cast<double>(n) * std::numeric_limits<double>::epsilon() * std::abs(K(j, j));
    double pivot = K(j, j);
    for (Eigen::Index k = 0; k < j; ++k) pivot -= F(j, k) * F(j, k);
    if (pivot < -rounding) return false;
    const bool zero = pivot <= rounding;
    for (Eigen::Index i = j; i < n; ++i) {
      double rest = K(i, j);
      for (Eigen::Index k = 0; k < j; ++k) rest -= F(i, k) * F(j, k);
      if (!zero) F(i, j) = rest / std::sqrt(pivot);
      // |rest|^2 <= pivot_i pivot_j for a semidefinite matrix
      if (zero && rest * rest > 64 * rounding * std::abs(K(i, i))) return false;
    }
  }
  return true;
}

using ConstMatrix = RatioDamping::ConstMatrix;

/// Cosines between columns below this are squared by the sweep that has seen them.
constexpr double kRatioConverged = 1e-8;
constexpr int kMaxSweeps = 16;
/// After so many updates the rotations restart, before their rounding errors add up.
constexpr int kFreshStart = 256;

/// Lanes for the left partners of `half` pairs of columns, and as many for the right ones.
constexpr Index lanes(Index half) {
  return half <= 4 ? 4 : 8;
}

/// Where column c of 2 half columns stands in a row: the first half are left partners.
constexpr Index place(Index c, Index half) {
  return c < half ? c : lanes(half) + c - half;
}

struct Problem {
  const ConstMatrix& M;
  const double* J;  ///< k x n; none: the identity
  Index stride;     ///< of its columns
  const double* d;  ///< n; none: no friction
  Index k;
  double* B;              ///< F, then F U: k rows
  Vector<kMaxDof> omega;  ///< k
  Square<kMaxDof> G;      ///< (L^-T A)' diag(d) L^-T A for the turned A; with friction only
};

/// Decomposes F' J L^-T for up to 2 Half springs. Matrices of as many columns stand row by row.
template <int Half>
class Decomposition {
 public:
  explicit Decomposition(Problem& problem) noexcept : p_(problem), n_(problem.M.rows()) {}

  Status run() noexcept {
    if (!scale()) return Status::kMassNotPositiveDefinite;
    double worst = 1;
    for (int count = 0; !(worst <= kRatioConverged * kRatioConverged); ++count) {
      if (count == kMaxSweeps) return Status::kNotConverged;
      worst = sweep();
    }
    measure();
    if (p_.d != nullptr) project_friction();
    return Status::kOk;
  }

 private:
  static constexpr Index kLanes = lanes(Half), kWidth = 2 * kLanes;
  using Lanes = std::array<double, kLanes>;

  double* row(Index i) noexcept { return A_.data() + i * kWidth; }
  double& L(Index i, Index j) noexcept { return L_[static_cast<std::size_t>(j * n_ + i)]; }

  /// L and A = L^-1 J' F; false unless M is positive definite.
  bool scale() noexcept {
    for (Index j = 0; j < n_; ++j) {
      for (Index i = j; i < n_; ++i) L(i, j) = p_.M(i, j);
      double* const a = row(j);
      std::fill_n(a, kWidth, 0.0);
      if (p_.J == nullptr) std::copy_n(p_.B + j * kWidth, kWidth, a);
      for (Index r = 0; p_.J != nullptr && r < p_.k; ++r) {
        const double factor = p_.J[r + j * p_.stride];
        for (Index l = 0; l < kWidth; ++l) a[l] += factor * p_.B[r * kWidth + l];
      }
    }
    for (Index j = 0; j < n_; ++j) {
      if (!(L(j, j) > 0)) return false;
      const double inverse = 1 / std::sqrt(L(j, j));
      for (Index i = j; i < n_; ++i) L(i, j) *= inverse;
      for (Index c = j + 1; c < n_; ++c) {
        for (Index i = c; i < n_; ++i) L(i, c) -= L(i, j) * L(c, j);
      }
      double* const a = row(j);
      for (Index l = 0; l < kWidth; ++l) a[l] *= inverse;
      for (Index i = j + 1; i < n_; ++i) {
        for (Index l = 0; l < kWidth; ++l) row(i)[l] -= L(i, j) * a[l];
      }
    }
    return true;
  }

  /// Turns the columns of each pair by their angle, and moves on to the next pairs of a round
  /// robin: the first column stays, the others go round.
  static void turn(const Lanes& c, const Lanes& s, double* rows, Index count) noexcept {
    for (double* a = rows; a != rows + count * kWidth; a += kWidth) {
      Lanes l, r;
      for (std::size_t i = 0; i < kLanes; ++i) {
        l[i] = c[i] * a[i] - s[i] * a[kLanes + i];
        r[i] = s[i] * a[i] + c[i] * a[kLanes + i];
      }
      a[0] = l[0];
      if constexpr (Half > 1) a[1] = r[0];
      for (std::size_t i = 1; i + 1 < Half; ++i) a[i + 1] = l[i];
      for (std::size_t i = 1; i < Half; ++i) a[kLanes + i - 1] = r[i];
      a[kLanes + Half - 1] = Half > 1 ? l[Half - 1] : r[0];
    }
  }

  /// One sweep over all pairs of columns of A, with B turned alike. Returns the square of the
  /// largest cosine between two columns that it met.
  double sweep() noexcept {
    constexpr double kTiny = std::numeric_limits<double>::min();
    double most = 0;
    for (int round = 0; round < 2 * Half - 1; ++round) {
      Lanes left{}, right{}, dot{}, c, s;
      for (const double* a = row(0); a != row(n_); a += kWidth) {
        for (std::size_t i = 0; i < kLanes; ++i) {
          left[i] += a[i] * a[i];
          right[i] += a[kLanes + i] * a[kLanes + i];
          dot[i] += a[i] * a[kLanes + i];
        }
      }
      Lanes cosine;
      for (std::size_t i = 0; i < kLanes; ++i) {
        const double square = dot[i] * dot[i];
        cosine[i] = square / (left[i] * right[i] + kTiny);
        // tan of the smaller angle, free of cancellation
        const double half = 0.5 * (right[i] - left[i]);
        const double size = std::abs(half) + std::sqrt(half * half + square) + kTiny;
        const double t = dot[i] / std::copysign(size, half);
        c[i] = 1 / std::sqrt(1 + t * t);
        s[i] = c[i] * t;
      }
      for (const double value : cosine) most = std::max(most, value);
      turn(c, s, row(0), n_);
      turn(c, s, p_.B, p_.k);
    }
    return most;
  }

  void measure() noexcept {
    std::array<double, kWidth> squares{};
    for (Index i = 0; i < n_; ++i) {
      for (std::size_t l = 0; l < kWidth; ++l) squares[l] += row(i)[l] * row(i)[l];
    }
    p_.omega.resize(p_.k);
    for (Index i = 0; i < p_.k; ++i) {
      p_.omega[i] = std::sqrt(squares[static_cast<std::size_t>(place(i, Half))]);
    }
  }

  /// G; A becomes L^-T A.
  void project_friction() noexcept {
    p_.G.setZero(p_.k, p_.k);
    for (Index i = n_; i-- > 0;) {
      double* const a = row(i);
      for (Index r = i + 1; r < n_; ++r) {
        for (Index l = 0; l < kWidth; ++l) a[l] -= L(r, i) * row(r)[l];
      }
      for (Index l = 0; l < kWidth; ++l) a[l] /= L(i, i);
      for (Index c = 0; c < p_.k; ++c) {
        const double scaled = p_.d[i] * a[place(c, Half)];
        for (Index r = 0; r <= c; ++r) p_.G(r, c) += scaled * a[place(r, Half)];
      }
    }
  }

  Problem& p_;
  Index n_;
  alignas(64) std::array<double, kMaxDof * kWidth> A_;
  std::array<double, kMaxDof * kMaxDof> L_;
};

template <int Half>
Status decompose(Problem& problem) noexcept {
  return Decomposition<Half>(problem).run();
}

Status decompose(Problem& problem, Index half) noexcept {
  constexpr std::array<Status (*)(Problem&) noexcept, kMaxDof / 2> kOfHalf = {
      decompose<1>, decompose<2>, decompose<3>, decompose<4>,
      decompose<5>, decompose<6>, decompose<7>, decompose<8>};
  return kOfHalf[static_cast<std::size_t>(half - 1)](problem);
}

/// G / (omega_i omega_j); zero where a frequency is.
void normalize(Problem& problem) noexcept {
  for (Index j = 0; j < problem.k; ++j) {
    for (Index i = 0; i <= j; ++i) {
      const double size = problem.omega[i] * problem.omega[j];
      problem.G(i, j) = problem.G(j, i) = size > 0 ? problem.G(i, j) / size : 0;
    }
  }
}

/// B R B' of k rows each; without R, B diag(c) B'.
void congruence(const Problem& problem, const Square<kMaxDof>* R, const Vector<kMaxDof>& c,
                Eigen::Ref<Eigen::MatrixXd>& out) noexcept {
  const Index half = (problem.k + 1) / 2, width = 2 * lanes(half);
  for (Index j = 0; j < problem.k; ++j) {
    const double* const b = problem.B + j * width;
    alignas(64) std::array<double, kMaxDof> scaled{};
    for (Index l = 0; l < problem.k; ++l) {
      double sum = R == nullptr ? c[l] * b[place(l, half)] : 0;
      for (Index i = 0; R != nullptr && i < problem.k; ++i) sum += (*R)(l, i) * b[place(i, half)];
      scaled[static_cast<std::size_t>(place(l, half))] = sum;
    }
    for (Index i = 0; i <= j; ++i) {
      const double* const a = problem.B + i * width;
      double sum = 0;
      for (Index l = 0; l < width; ++l) sum += a[l] * scaled[static_cast<std::size_t>(l)];
      out(i, j) = out(j, i) = sum;
    }
  }
}

}  // namespace

Status RatioDamping::set_stiffness(const ConstMatrix& K) noexcept {
  const Index k = K.rows(), half = (k + 1) / 2, width = 2 * lanes(half);
  if (k == 0 || k > kMaxDof || K.cols() != k) return Status::kWrongSize;
  if (!K.allFinite()) return Status::kNotFinite;
  Square<kMaxDof> F;
  if (!semidefinite_cholesky(K, F)) return Status::kStiffnessIndefinite;
  factor_.fill(0);
  for (Index i = 0; i < k; ++i) {
    for (Index j = 0; j <= i; ++j) {
      factor_[static_cast<std::size_t>(i * width + place(j, half))] = F(i, j);
    }
  }
  rotated_ = factor_;
  springs_ = k;
  updates_ = 0;
  return Status::kOk;
}

Status RatioDamping::update(const ConstMatrix& M, const ConstMatrix& J,
                            Eigen::Ref<Eigen::MatrixXd> C) noexcept {
  if (J.rows() != springs_ || J.cols() != M.rows()) return Status::kWrongSize;
  return design(M, J.data(), J.outerStride(), C);
}

Status RatioDamping::update(const ConstMatrix& M, Eigen::Ref<Eigen::MatrixXd> C) noexcept {
  if (M.rows() != springs_) return Status::kWrongSize;
  return design(M, nullptr, 0, C);
}

Status RatioDamping::design(const ConstMatrix& M, const double* J, Index stride,
                            Eigen::Ref<Eigen::MatrixXd>& C) noexcept {
  const Index n = M.rows(), k = springs_, half = (k + 1) / 2;
  if (n == 0 || n > kMaxDof || M.cols() != n || k == 0) return Status::kWrongSize;
  if (C.rows() != k || C.cols() != k) return Status::kWrongSize;
  const bool friction = friction_.size() > 0;
  if (friction && friction_.size() != n) return Status::kWrongSize;
  alignas(64) Factor B;
  const Factor& start = updates_ < kFreshStart ? rotated_ : factor_;
  std::copy_n(start.begin(), k * 2 * lanes(half), B.begin());
  Problem problem{M, J, stride, friction ? friction_.data() : nullptr, k, B.data(), {}, {}};
  Status status = decompose(problem, half);
  if (status != Status::kOk) return status;
  if (!problem.omega.allFinite()) return Status::kNotFinite;
  const double soft = target_.soft_limit(problem.omega.maxCoeff());
  bool overdone = false;
  DampingLevel level;
  Vector<kMaxDof> wanted(k), weight(k);
  for (Index i = 0; i < k; ++i) {
    const double omega = problem.omega[i], whole = 2 * target_.ratio * omega;
    const double share = borne_ == nullptr ? 1 : borne_->share(omega, whole, in_force_, level);
    wanted[i] = share * whole;
    if (!friction) weight[i] = share * target_.damper(omega, soft);
  }
  if (friction) {
    normalize(problem);
    status = missing_damping(problem.omega, wanted, soft, problem.G, overdone);
    if (status != Status::kOk) return status;
  }
  congruence(problem, friction ? &problem.G : nullptr, weight, C);
  overdone_ = overdone;
  level_ = level;
  updates_ = updates_ < kFreshStart ? updates_ + 1 : 0;
  std::copy_n(B.begin(), k * 2 * lanes(half), rotated_.begin());
  return Status::kOk;
}

}  // namespace dashpot::analysis
