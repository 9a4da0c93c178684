#include <dashpot/controller/base/joint_pack.hpp>
#include <dashpot/controller/base/small_cholesky.hpp>

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

}  // namespace dashpot::controller
