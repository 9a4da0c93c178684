#include <dashpot/analysis/linalg/phi_functions.hpp>

#include <Eigen/LU>
#include <algorithm>
#include <cmath>
#include <utility>

namespace dashpot::analysis {
namespace {

/// Terms of the Taylor series of phi_k that matter for |z| < 1.
constexpr int kTerms = 18;

double reciprocal_factorial(int k) {
  double value = 1;
  for (int i = 2; i <= k; ++i) value /= i;
  return value;
}

/// a b + c d with one rounding error of the result (Kahan).
double sum_of_products(double a, double b, double c, double d) {
  const double second = c * d;
  const double error = std::fma(c, d, -second);
  return std::fma(a, b, second) + error;
}

/// A function of a 2 x 2 matrix Z with eigenvalues x +- sqrt(d):  f(Z) = mean I + slope (Z - x I),
/// where mean is the average of f over the two eigenvalues and slope its divided difference. Both
/// stay smooth where the eigenvalues meet.
struct PairFunction {
  double mean;
  double slope;
};

/// Z as the two numbers its functions depend on, and its eigenvalues.
struct Pair {
  double x = 0;
  double d = 0;
  Complex first;  ///< x + sqrt(d)
  Complex second;
};

PairFunction exponential(const Pair& z) {
  const double root = std::sqrt(std::abs(z.d));
  if (z.d < 0) {
    const double scale = std::exp(z.x);
    return {scale * std::cos(root), scale * (std::sin(root) / root)};
  }
  // cosh and sinh times e^x may overflow times underflow; the two exponentials cannot.
  const double slower = std::exp(z.first.real());
  return {slower * (0.5 * (1 + std::exp(-2 * root))), slower * phi(1, -2 * root).real()};
}

/// Horner's rule with numbers a + b N, N^2 = d.
PairFunction taylor(const Pair& z) {
  double coefficient = reciprocal_factorial(1 + kTerms);
  PairFunction sum{coefficient, 0};
  for (int j = kTerms - 1; j >= 0; --j) {
    coefficient *= j + 2;
    sum = {coefficient + sum.mean * z.x + sum.slope * z.d, sum.mean + sum.slope * z.x};
  }
  return sum;
}

PairFunction pair_function(int k, const Pair& z) {
  if (k == 0) return exponential(z);
  const double size = std::max(std::abs(z.first), std::abs(z.second));
  if (size < 1) return taylor(z);

  const Complex gap = z.first - z.second;
  if (std::abs(gap) > 0.2 * size) {
    const Complex first = phi(1, z.first);
    const Complex second = phi(1, z.second);
    return {0.5 * (first + second).real(), ((first - second) / gap).real()};
  }
  // phi_1 = Z^-1 (phi_0 - I), with Z^-1 = (x - N) / (x^2 - d): well conditioned here.
  const PairFunction previous = exponential(z);
  const double p = previous.mean - 1;
  const double q = previous.slope;
  const double determinant = (z.first * z.second).real();
  return {(p * z.x - q * z.d) / determinant, (q * z.x - p) / determinant};
}

Eigen::Matrix2d phi_two(int k, const Eigen::Matrix2d& A, double t) {
  const EigenvaluePair values = eigenvalue_pair(A);
  Pair z{values.mean * t, values.discriminant * t * t, values.first * t, values.second * t};
  if (t < 0) std::swap(z.first, z.second);
  const PairFunction f = pair_function(k, z);

  Eigen::Matrix2d result;
  if (A(1, 0) == 0) {  // a zero mode: both eigenvalues are on the diagonal
    result << phi(k, A(0, 0) * t).real(), f.slope * (A(0, 1) * t),  //
        0, phi(k, A(1, 1) * t).real();
    return result;
  }
  const double half_difference = 0.5 * (A(0, 0) - A(1, 1));
  result << f.mean + f.slope * (half_difference * t), f.slope * (A(0, 1) * t),
      f.slope * (A(1, 0) * t), f.mean - f.slope * (half_difference * t);
  return result;
}

/// Z e^x, without a product of zero and infinity where e^x leaves the range of numbers.
void scale_by_exponential(double x, Eigen::MatrixXd& Z) {
  const double half = std::exp(0.5 * x);
  for (double& entry : Z.reshaped()) entry = entry == 0 ? 0 : half * entry * half;
}

/// e^Z by scaling and squaring of the Taylor series. The mean eigenvalue is taken out first, which
/// leaves little to square where the eigenvalues lie close together, as they do in large blocks.
/// What the squares of a wide block grow by is taken out as well, before it is too large.
Eigen::MatrixXd matrix_exponential(const Eigen::MatrixXd& Z) {
  const auto identity = Eigen::MatrixXd::Identity(Z.rows(), Z.cols());
  const double mean = Z.trace() / static_cast<double>(Z.rows());
  Eigen::MatrixXd scaled = Z - mean * identity;
  const double norm = scaled.cwiseAbs().colwise().sum().maxCoeff();
  const int squarings = norm < 1 ? 0 : std::ilogb(norm) + 1;
  scaled *= std::ldexp(1.0, -squarings);

  double coefficient = reciprocal_factorial(kTerms);
  Eigen::MatrixXd sum = coefficient * identity;
  for (int j = kTerms - 1; j >= 0; --j) {
    coefficient *= j + 1;
    sum = coefficient * identity + sum * scaled;
  }
  constexpr double kLarge = 1e100;
  double taken_out = 0;  // the exponent of a power of e
  for (int i = 0; i < squarings; ++i) {
    sum = (sum * sum).eval();
    taken_out *= 2;
    const double size = sum.cwiseAbs().maxCoeff();
    if (size < kLarge) continue;
    sum *= 1 / size;
    taken_out += std::log(size);
  }
  scale_by_exponential(mean + taken_out, sum);
  return sum;
}

Eigen::MatrixXd phi_general(int k, const Eigen::MatrixXd& Z) {
  if (k == 0) return matrix_exponential(Z);
  const Eigen::Index n = Z.rows();
  const Eigen::MatrixXd inverse = Z.partialPivLu().inverse();
  if (inverse.cwiseAbs().colwise().sum().maxCoeff() <= 1) {  // false if it is not finite
    return inverse * (matrix_exponential(Z) - Eigen::MatrixXd::Identity(n, n));
  }
  // exp([Z I; 0 0]) = [phi_0 phi_1; 0 I]
  Eigen::MatrixXd augmented = Eigen::MatrixXd::Zero(2 * n, 2 * n);
  augmented.topLeftCorner(n, n) = Z;
  augmented.topRightCorner(n, n).setIdentity();
  return matrix_exponential(augmented).topRightCorner(n, n);
}

}  // namespace

Complex phi(int k, Complex z) {
  if (k == 0) return std::exp(z);
  if (std::abs(z) >= 1) return (std::exp(z) - 1.0) / z;
  double coefficient = reciprocal_factorial(k + kTerms);
  Complex sum = coefficient;
  for (int j = kTerms - 1; j >= 0; --j) {
    coefficient *= k + j + 1;
    sum = coefficient + sum * z;
  }
  return sum;
}

Eigen::MatrixXd phi(int k, const Eigen::MatrixXd& A, double t) {
  if (A.rows() == 1) return Eigen::MatrixXd::Constant(1, 1, phi(k, A(0, 0) * t).real());
  if (A.rows() == 2) return phi_two(k, A, t);
  return phi_general(k, A * t);
}

EigenvaluePair eigenvalue_pair(const Eigen::Matrix2d& A) {
  const double half_difference = 0.5 * (A(0, 0) - A(1, 1));
  const double mean = 0.5 * (A(0, 0) + A(1, 1));
  const double discriminant = sum_of_products(half_difference, half_difference, A(0, 1), A(1, 0));
  const double root = std::sqrt(std::abs(discriminant));
  if (discriminant < 0) return {mean, discriminant, {mean, root}, {mean, -root}};

  // The larger one has no cancellation, and the determinant gives the smaller one.
  const double larger = mean + std::copysign(root, mean);
  const double determinant = sum_of_products(A(0, 0), A(1, 1), -A(0, 1), A(1, 0));
  const double smaller = larger == 0 ? 0 : determinant / larger;
  return {mean, discriminant, std::max(smaller, larger), std::min(smaller, larger)};
}

}  // namespace dashpot::analysis
