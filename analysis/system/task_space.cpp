#include <dashpot/analysis/linalg/double_double.hpp>
#include <dashpot/analysis/system/checks.hpp>
#include <dashpot/analysis/task_space.hpp>

#include <Eigen/Eigenvalues>
#include <limits>

namespace dashpot::analysis {
namespace {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

/// Bound of the relative error of one operation on double-doubles (3 u^2 of a sum, 2 u^2 of a
/// product with a double), enough for the rounding errors of the bounds as well.
constexpr double kOperation =
    std::numeric_limits<double>::epsilon() * std::numeric_limits<double>::epsilon();

/// A matrix of double-doubles, high + low, that lacks at most `error` in every entry.
struct PreciseMatrix {
  MatrixXd high;
  MatrixXd low;
  MatrixXd error;

  PreciseMatrix(Index rows, Index cols)
      : high(MatrixXd::Zero(rows, cols)), low(high), error(high) {}
  /// A symmetric matrix: the symmetric part of `value`, with the rest as error.
  PreciseMatrix(const std::string& key, const MatrixXd& value, Index size)
      : PreciseMatrix(size, size) {
    check_size(key, value, size, size);
    check_finite(key, value);
    check_symmetric(key, value);
    high = value;
    make_symmetric(high, error);
  }

  DoubleDouble get(Index i, Index j) const { return {high(i, j), low(i, j)}; }
  void set(Index i, Index j, const DoubleDouble& value) {
    high(i, j) = value.high;
    low(i, j) = value.low;
  }
  void add(const PreciseMatrix& other) {
    for (Index j = 0; j < high.cols(); ++j) {
      for (Index i = 0; i < high.rows(); ++i) set(i, j, get(i, j) + other.get(i, j));
    }
    error += other.error + kOperation * high.cwiseAbs();
  }
  /// Adds an error, none if it has no rows.
  void add_error(const std::string& key, const MatrixXd& more) {
    check_error(key, more, high.rows());
    if (more.rows() > 0) error += more;
  }
};

/// left' middle right, with about 32 digits; `middle` has no low words.
PreciseMatrix sandwich(const MatrixXd& left, const PreciseMatrix& factor, const MatrixXd& right) {
  const MatrixXd& middle = factor.high;
  PreciseMatrix inner(middle.rows(), right.cols());
  for (Index i = 0; i < inner.high.rows(); ++i) {
    for (Index j = 0; j < inner.high.cols(); ++j) {
      DotAccumulator sum;
      for (Index k = 0; k < middle.cols(); ++k) sum.add(middle(i, k), right(k, j));
      inner.set(i, j, sum.value());
    }
  }
  PreciseMatrix product(left.cols(), right.cols());
  for (Index i = 0; i < product.high.rows(); ++i) {
    for (Index j = 0; j < product.high.cols(); ++j) {
      DotAccumulator sum;
      for (Index k = 0; k < left.rows(); ++k) sum.add(inner.get(k, j), left(k, i));
      product.set(i, j, sum.value());
    }
  }
  const auto operations = static_cast<double>(middle.cols() + left.rows());
  const MatrixXd error = operations * kOperation * middle.cwiseAbs() + factor.error;
  const MatrixXd inner_error = error * right.cwiseAbs();
  product.error = left.cwiseAbs().transpose() * inner_error;
  return product;
}

/// J' A J for a symmetric A: exactly symmetric.
PreciseMatrix congruence(const MatrixXd& jacobian, const PreciseMatrix& middle) {
  PreciseMatrix product = sandwich(jacobian, middle, jacobian);
  for (Index i = 0; i < product.high.rows(); ++i) {
    for (Index j = 0; j < i; ++j) product.set(i, j, product.get(j, i));
  }
  return product;
}

PreciseMatrix extended_geometric_stiffness(const std::vector<MatrixXd>& derivatives,
                                           const VectorXd& wrench) {
  const auto n = static_cast<Index>(derivatives.size());
  PreciseMatrix result(n, n);
  for (Index k = 0; k < n; ++k) {
    const MatrixXd& derivative = derivatives[static_cast<std::size_t>(k)];
    for (Index i = 0; i < n; ++i) {
      DotAccumulator sum;
      for (Index j = 0; j < wrench.size(); ++j) sum.add(derivative(j, i), wrench(j));
      result.set(i, k, sum.value());
      result.error(i, k) = static_cast<double>(wrench.size()) * kOperation *
                           derivative.col(i).cwiseAbs().dot(wrench.cwiseAbs());
    }
  }
  return result;
}

/// Averages entries with their mirror images if they agree within the tolerance.
void average_if_symmetric(PreciseMatrix& matrix) {
  const double largest = matrix.high.size() == 0 ? 0 : matrix.high.cwiseAbs().maxCoeff();
  const MatrixXd skew = matrix.high - matrix.high.transpose();
  if ((skew.array().abs() > kSymmetryTolerance * largest).any()) return;
  for (Index i = 0; i < matrix.high.rows(); ++i) {
    for (Index j = 0; j < i; ++j) {
      const DoubleDouble mean = (matrix.get(i, j) + matrix.get(j, i)) * 0.5;
      const double half = 0.5 * std::abs((matrix.get(i, j) - matrix.get(j, i)).high);
      for (double* error : {&matrix.error(i, j), &matrix.error(j, i)}) {
        *error += (1 + 1e-10) * half + kOperation * std::abs(mean.high);
      }
      matrix.set(i, j, mean);
      matrix.set(j, i, mean);
    }
  }
}

/// F' (size x size) with matrix = F F', or nothing if the matrix is not positive semidefinite to
/// rounding. It comes from the eigenvalues of the matrix scaled to a unit diagonal, so that small
/// stiffnesses survive beside large ones. Eigenvalues that are zero to rounding are set to zero:
/// the root of a rounding error would be a stiffness factor of 1e-8 of the largest.
std::optional<MatrixXd> factor_transposed(const MatrixXd& matrix) {
  if ((matrix.diagonal().array() < 0).any()) return std::nullopt;
  const VectorXd scale = matrix.diagonal().cwiseSqrt();
  MatrixXd scaled = MatrixXd::Zero(matrix.rows(), matrix.cols());
  for (Index j = 0; j < matrix.cols(); ++j) {
    for (Index i = 0; i < matrix.rows(); ++i) {
      if (matrix(i, j) == 0) continue;
      if (scale(i) == 0 || scale(j) == 0) return std::nullopt;
      scaled(i, j) = i == j ? 1.0 : matrix(i, j) / scale(i) / scale(j);
    }
  }
  if (scaled.size() == 0) return scaled;
  const Eigen::SelfAdjointEigenSolver<MatrixXd> solver(scaled);
  const VectorXd& values = solver.eigenvalues();
  const double rounding = 16 * static_cast<double>(matrix.rows()) *
                          std::numeric_limits<double>::epsilon() * values.cwiseAbs().maxCoeff();
  if (values(0) < -rounding) return std::nullopt;
  const VectorXd roots = (values.array() > rounding).select(values, 0.0).cwiseSqrt();
  return MatrixXd(roots.asDiagonal() * solver.eigenvectors().transpose() * scale.asDiagonal());
}

/// The rules on which members have to be there together, and the sizes and entries of the Jacobian
/// and its derivatives.
void check_members(const TaskImpedance& impedance) {
  const Index n = impedance.mass.rows();
  if (!impedance.jacobian) {
    if (impedance.task_damping) throw InvalidSystem("task_damping", "needs a jacobian");
    if (impedance.task_stiffness) throw InvalidSystem("task_stiffness", "needs a jacobian");
  } else {
    if (!impedance.task_damping && !impedance.task_stiffness) {
      throw InvalidSystem("jacobian", "needs task_damping or task_stiffness");
    }
    check_size("jacobian", *impedance.jacobian, impedance.jacobian->rows(), n);
    check_finite("jacobian", *impedance.jacobian);
  }
  if (impedance.jacobian_rate) {
    if (!impedance.task_damping) throw InvalidSystem("jacobian_rate", "needs task_damping");
    check_size("jacobian_rate", *impedance.jacobian_rate, impedance.jacobian->rows(), n);
    check_finite("jacobian_rate", *impedance.jacobian_rate);
  }
}

/// K_G, if its two members are there.
std::optional<PreciseMatrix> checked_geometric_stiffness(const TaskImpedance& impedance) {
  const std::string key = "jacobian_derivatives";
  if (impedance.jacobian_derivatives.empty() && !impedance.wrench) return std::nullopt;
  if (!impedance.wrench) throw InvalidSystem(key, "needs a wrench");
  const VectorXd& wrench = *impedance.wrench;
  const Index n = impedance.mass.rows();
  const auto count = static_cast<Index>(impedance.jacobian_derivatives.size());
  if (count == 0 && n > 0) throw InvalidSystem("wrench", "needs jacobian_derivatives");
  if (count != n) {
    throw InvalidSystem(
        key, "has " + std::to_string(count) + " matrices, expected " + std::to_string(n));
  }
  check_finite("wrench", wrench);
  if (impedance.jacobian) check_size("wrench", wrench, impedance.jacobian->rows(), 1);
  for (Index k = 0; k < n; ++k) {
    const MatrixXd& derivative = impedance.jacobian_derivatives[static_cast<std::size_t>(k)];
    const std::string numbered = key + "[" + std::to_string(k + 1) + "]";
    check_size(numbered, derivative, wrench.size(), n);
    check_finite(numbered, derivative);
  }
  PreciseMatrix result = extended_geometric_stiffness(impedance.jacobian_derivatives, wrench);
  average_if_symmetric(result);
  return result;
}

/// Rows of W with K = W'W gathered from the parts of K, as long as all of them have one.
class FactorStack {
 public:
  explicit FactorStack(Index n) : rows_(0, n) {}
  void append(const std::optional<MatrixXd>& factor) {
    if (!factor || !complete_) return drop();
    const Index filled = rows_.rows();
    rows_.conservativeResize(filled + factor->rows(), Eigen::NoChange);
    rows_.bottomRows(factor->rows()) = *factor;
  }
  void drop() {
    complete_ = false;
    rows_.resize(0, rows_.cols());
  }
  const MatrixXd& rows() const { return rows_; }

 private:
  MatrixXd rows_;
  bool complete_ = true;
};

/// C and K as they add up, and the factor of K.
struct Assembly {
  PreciseMatrix damping;
  PreciseMatrix stiffness;
  FactorStack factor;

  explicit Assembly(Index n) : damping(n, n), stiffness(n, n), factor(n) {}
};

void add_joint_space(const TaskImpedance& impedance, Assembly& sum) {
  const Index n = impedance.mass.rows();
  if (impedance.damping) {
    sum.damping.add(PreciseMatrix("damping", *impedance.damping, n));
    sum.damping.add_error("damping_error", impedance.damping_error);
  }
  if (impedance.stiffness) {
    const PreciseMatrix stiffness("stiffness", *impedance.stiffness, n);
    sum.stiffness.add(stiffness);
    sum.factor.append(factor_transposed(stiffness.high));
  }
}

void add_task_space(const TaskImpedance& impedance, Assembly& sum) {
  if (!impedance.jacobian) return;
  const MatrixXd& J = *impedance.jacobian;
  if (impedance.task_stiffness) {
    const PreciseMatrix K("task_stiffness", *impedance.task_stiffness, J.rows());
    sum.stiffness.add(congruence(J, K));
    const std::optional<MatrixXd> root = factor_transposed(K.high);
    sum.factor.append(root ? std::optional<MatrixXd>(*root * J) : std::nullopt);
  }
  if (impedance.task_damping) {
    const PreciseMatrix C("task_damping", *impedance.task_damping, J.rows());
    sum.damping.add(congruence(J, C));
    if (impedance.jacobian_rate) {
      sum.stiffness.add(sandwich(J, C, *impedance.jacobian_rate));
      sum.factor.drop();
    }
  }
}

}  // namespace

MatrixXd geometric_stiffness(const std::vector<MatrixXd>& jacobian_derivatives,
                             const VectorXd& wrench) {
  const auto n = static_cast<Index>(jacobian_derivatives.size());
  for (const MatrixXd& derivative : jacobian_derivatives) {
    check_size("jacobian_derivatives", derivative, wrench.size(), n);
  }
  return extended_geometric_stiffness(jacobian_derivatives, wrench).high;
}

System<> to_joint_space(const TaskImpedance& impedance) {
  const Index n = impedance.mass.rows();
  System<> system(n);
  PreciseMatrix mass("mass", impedance.mass, n);
  mass.add_error("mass_error", impedance.mass_error);
  system.mass = mass.high;
  system.mass_error = mass.error;
  check_members(impedance);

  Assembly sum(n);
  add_joint_space(impedance, sum);
  add_task_space(impedance, sum);
  if (const auto geometric = checked_geometric_stiffness(impedance)) {
    sum.stiffness.add(*geometric);
    sum.factor.drop();
  }

  system.damping = sum.damping.high;
  system.damping_error = sum.damping.error;
  system.stiffness = sum.stiffness.high;
  system.stiffness_error = sum.stiffness.error;
  system.stiffness_factor = sum.factor.rows();
  // With a factor, which is rounded, the low words also say that the stiffness is not.
  system.has_low_words = !sum.damping.low.isZero(0.0) || !sum.stiffness.low.isZero(0.0) ||
                         system.stiffness_factor.rows() > 0;
  if (system.has_low_words) {
    system.damping_low = sum.damping.low;
    system.stiffness_low = sum.stiffness.low;
  }
  validate(system);
  return system;
}

}  // namespace dashpot::analysis
