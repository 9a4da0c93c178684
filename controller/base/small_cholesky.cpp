#include <dashpot/controller/base/joint_pack.hpp>
#include <dashpot/controller/base/small_cholesky.hpp>

#include <algorithm>
#include <cmath>

namespace dashpot::controller {

void SmallCholesky::compute(const Eigen::Ref<const Eigen::MatrixXd>& A,
                            double least_pivot) noexcept {
  n_ = static_cast<int>(A.rows());
  for (int k = 0; k < n_; ++k) {
    double* const L_k = column(k);
    for (int i = k / 4 * 4; i < n_; ++i) L_k[i] = A(i, k);
  }
  for (int k = 0; k < n_; ++k) {
    double* const L_k = column(k);
    const double root = std::sqrt(L_k[k] > least_pivot ? L_k[k] : least_pivot);
    const double per_root = 1 / root;
    per_diagonal_[static_cast<std::size_t>(k)] = per_root;
    L_k[k] = root;
    for (int i = k + 1; i < n_; ++i) L_k[i] *= per_root;
    for (int j = k + 1; j < n_; ++j) {
      double* const L_j = column(j);
      const double factor = L_k[j];
      // Entries above the diagonal and below the last row have no meaning.
      for (int i = j / 4 * 4; i < n_; i += 4) {
        store(load(L_j + i) - factor * load(L_k + i), L_j + i);
      }
    }
  }
}

void SmallCholesky::solve_L(double* x) const noexcept {
  for (int i = 0; i < n_; ++i) {
    const double* const L_i = column(i);
    const double x_i = x[i] *= per_diagonal(i);
    for (int j = i + 1; j < n_; ++j) x[j] -= L_i[j] * x_i;
  }
}

void SmallCholesky::solve_LT(double* x) const noexcept {
  for (int i = n_ - 1; i >= 0; --i) {
    const double* const L_i = column(i);
    double left = x[i];
    for (int j = i + 1; j < n_; ++j) left -= L_i[j] * x[j];
    x[i] = left * per_diagonal(i);
  }
}

void SmallCholesky::multiply_L(double* x) const noexcept {
  for (int i = n_ - 1; i >= 0; --i) {
    const double* const L_i = column(i);
    const double x_i = x[i];
    for (int j = i + 1; j < n_; ++j) x[j] += L_i[j] * x_i;
    x[i] = L_i[i] * x_i;
  }
}

void SmallCholesky::multiply_LT(double* x) const noexcept {
  for (int i = 0; i < n_; ++i) {
    const double* const L_i = column(i);
    double sum = 0;
    for (int j = i; j < n_; ++j) sum += L_i[j] * x[j];
    x[i] = sum;
  }
}

namespace {

constexpr int kMostSweeps = 12;
/// Off-diagonal entries below this share of the largest entry are rounding errors.
constexpr double kNegligibleEntry = 1e-15;
/// Eigenvalues below this share of it are rounding errors; their roots would be 1e8 times as large.
constexpr double kVanishes = 1e-13;

/// Turns rows a and b by the angle of c and s.
void turn(std::array<double, kMaxJoints>& a, std::array<double, kMaxJoints>& b, double c, double s,
          std::size_t n) noexcept {
  for (std::size_t i = 0; i < n; ++i) {
    const double x = a[i], y = b[i];
    a[i] = c * x - s * y;
    b[i] = s * x + c * y;
  }
}

}  // namespace

SymmetricRoot symmetric_root(const JointMatrix& A) noexcept {
  const auto n = static_cast<std::size_t>(A.rows());
  std::array<std::array<double, kMaxJoints>, kMaxJoints> B, V{};  // A, and eigenvectors by rows
  double largest = 0;
  for (std::size_t i = 0; i < n; ++i) {
    V[i][i] = 1;
    for (std::size_t j = 0; j <= i; ++j) {
      B[i][j] = B[j][i] = A(static_cast<Eigen::Index>(i), static_cast<Eigen::Index>(j));
      largest = std::max(largest, std::abs(B[i][j]));
    }
  }
  bool turned = true;
  for (int sweep = 0; sweep < kMostSweeps && turned; ++sweep) {
    turned = false;
    for (std::size_t i = 0; i < n; ++i) {
      for (std::size_t j = i + 1; j < n; ++j) {
        if (!(std::abs(B[i][j]) > kNegligibleEntry * largest)) continue;
        turned = true;
        const double half = 0.5 * (B[j][j] - B[i][i]);
        const double t =
            B[i][j] / (half + std::copysign(std::sqrt(half * half + B[i][j] * B[i][j]), half));
        const double c = 1 / std::sqrt(1 + t * t), s = c * t;
        turn(B[i], B[j], c, s, n);
        for (std::size_t k = 0; k < n; ++k) {
          const double x = B[k][i], y = B[k][j];
          B[k][i] = c * x - s * y;
          B[k][j] = s * x + c * y;
        }
        turn(V[i], V[j], c, s, n);
      }
    }
  }
  SymmetricRoot result{JointVector::Zero(A.rows()), {}};
  for (std::size_t k = 0; k < n; ++k) {
    result.vectors[k] = Eigen::Map<const JointVector>(V[k].data(), A.rows());
    if (!(B[k][k] > kVanishes * largest)) continue;
    result.roots[static_cast<Eigen::Index>(k)] = std::sqrt(B[k][k]);
  }
  return result;
}

}  // namespace dashpot::controller
