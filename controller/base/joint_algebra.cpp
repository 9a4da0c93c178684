#include <dashpot/controller/base/joint_algebra.hpp>
#include <dashpot/controller/base/joint_pack.hpp>

#include <algorithm>

namespace dashpot::controller {

Vector6 twist(const Jacobian& J, const JointVector& qd) noexcept {
  Vector6 V = Vector6::Zero();
  for (Eigen::Index j = 0; j < qd.size(); ++j) V += qd[j] * J.col(j);
  return V;
}

void add_torque(const Jacobian& J, const Vector6& F, JointVector& tau) noexcept {
  for (Eigen::Index j = 0; j < tau.size(); ++j) tau[j] += J.col(j).dot(F);
}

void add_product(const JointMatrix& A, const JointVector& x, JointVector& y,
                 double factor) noexcept {
  const Eigen::Index n = x.size();
  JointVector product(n);
  if (n < 4) product.noalias() = A.lazyProduct(x);
  for (Eigen::Index next = 0; n >= 4 && next < n; next += 4) {
    const Eigen::Index i = std::min(next, n - 4);  // the last four rows may overlap the four before
    Vec4d sum{};
    for (Eigen::Index j = 0; j < n; ++j) sum += load(A.data() + i + n * j) * x[j];
    store(sum, product.data() + i);
  }
  add(product, y, factor);
}

void add(const JointVector& x, JointVector& y, double factor) noexcept {
  Eigen::Index i = 0;
  for (; i + 4 <= x.size(); i += 4) {
    store(load(y.data() + i) + factor * load(x.data() + i), y.data() + i);
  }
  for (; i < x.size(); ++i) y[i] += factor * x[i];
}

JointVector difference(const JointVector& a, const JointVector& b) noexcept {
  JointVector result(a.size());
  Eigen::Index i = 0;
  for (; i + 4 <= a.size(); i += 4) {
    store(load(a.data() + i) - load(b.data() + i), result.data() + i);
  }
  for (; i < a.size(); ++i) result[i] = a[i] - b[i];
  return result;
}

double product(const JointVector& a, const JointVector& b) noexcept {
  double sum = 0;
  for (Eigen::Index i = 0; i < a.size(); ++i) sum += a[i] * b[i];
  return sum;
}

bool finite(const JointVector& x) noexcept {
  double sum = 0;  // becomes NaN with the first entry that is not finite
  for (Eigen::Index i = 0; i < x.size(); ++i) sum += 0 * x[i];
  return sum == 0;
}

}  // namespace dashpot::controller
