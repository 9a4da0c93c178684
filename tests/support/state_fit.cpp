#include <dashpot/tests/support/state_fit.hpp>

#include <Eigen/Cholesky>
#include <Eigen/Eigenvalues>
#include <Eigen/SVD>
#include <algorithm>
#include <cmath>
#include <limits>

namespace dashpot::testing {
namespace {

using Complex = std::complex<double>;
using Eigen::Index;
using Eigen::MatrixXd;

// Directions in which the motions are smaller than this times their largest are not shown: above
// rounding errors and nonlinear effects, below the least excitation.
constexpr double kRankTolerance = 1e-10;

struct Root {
  Complex value;
  double error;           // first-order estimate, relative
  Eigen::VectorXcd side;  // of the state, unit length
};

struct Roots {
  std::vector<Root> roots;
  double residual;
};

Roots find_roots(const std::vector<MatrixXd>& states, Index stride, double period) {
  Index count = 0;
  for (const MatrixXd& x : states) count += std::max<Index>(0, x.cols() - stride);
  MatrixXd X0(states.front().rows(), count), X1(states.front().rows(), count);
  Index at = 0;
  for (const MatrixXd& x : states) {
    const Index m = std::max<Index>(0, x.cols() - stride);
    X0.middleCols(at, m) = x.leftCols(m);
    X1.middleCols(at, m) = x.rightCols(m);
    at += m;
  }
  // The transpose is tall, so that a QR factorisation comes first.
  const Eigen::JacobiSVD<MatrixXd> svd(X0.transpose(), Eigen::ComputeThinU | Eigen::ComputeThinV);
  const Eigen::VectorXd& S = svd.singularValues();
  const Index rank = (S.array() > kRankTolerance * S[0]).count();
  const MatrixXd U = svd.matrixV().leftCols(rank), V = svd.matrixU().leftCols(rank);
  const Eigen::VectorXd per_S = S.head(rank).cwiseInverse();
  const MatrixXd UX1 = U.transpose() * X1, A = UX1 * V * per_S.asDiagonal();
  const MatrixXd left_over = UX1 - A * S.head(rank).asDiagonal() * V.transpose();
  Roots found{{}, (X1 - U * (UX1 - left_over)).norm() / X1.norm()};

  const Eigen::EigenSolver<MatrixXd> solver(A);
  const Eigen::MatrixXcd right = solver.eigenvectors(), left = right.inverse();
  const Index n = X0.rows() / 2;
  for (Index i = 0; i < rank; ++i) {
    const Complex z = solver.eigenvalues()[i];
    if (z.imag() == 0 && z.real() <= 0) continue;  // no eigenvalue of a motion in time
    const Eigen::VectorXcd x = U * right.col(i);
    const bool still = x.head(n).norm() > x.tail(n).norm();
    const double error = (left.row(i) * left_over).norm() * per_S.cwiseProduct(right.col(i)).norm();
    found.roots.push_back({std::log(z) / (static_cast<double>(stride) * period),
                           error / std::abs(z), (still ? x.head(n) : x.tail(n)).normalized()});
  }
  return found;
}

FittedMode mode_of(Complex first, Complex second) {
  const double omega = std::sqrt(std::abs(first * second));
  return {{first, second}, omega, -(first + second).real() / (2 * omega)};
}

}  // namespace

StateFit fit_states(const std::vector<Recording>& recordings, double period, const MatrixXd& mass) {
  const MatrixXd L_T = mass.llt().matrixU();
  double q_size = 0, v_size = 0;
  Index shortest = std::numeric_limits<Index>::max();
  for (const auto& [q, v] : recordings) {
    q_size += (L_T * q).squaredNorm();
    v_size += (L_T * v).squaredNorm();
    shortest = std::min(shortest, q.cols());
  }
  std::vector<MatrixXd> states;
  for (const auto& [q, v] : recordings) {
    states.emplace_back(2 * q.rows(), q.cols()) << std::sqrt(v_size / q_size) * L_T * q, L_T * v;
  }
  double fastest = 0;
  for (const Root& root : find_roots(states, 1, period).roots) {
    const double size = std::abs(root.value) * period;
    if (root.error < 0.1 * size) fastest = std::max(fastest, size);
  }
  const double stride = fastest > 0 ? std::nearbyint(1 / fastest) : 1;
  const auto longest = static_cast<double>(std::max<Index>(1, shortest / 4));
  auto [roots, residual] =
      find_roots(states, static_cast<Index>(std::clamp(stride, 1.0, longest)), period);

  StateFit fit{{}, residual};
  std::vector<Root> real;
  for (const Root& root : roots) {
    if (root.value.imag() > 0) fit.modes.push_back(mode_of(root.value, std::conj(root.value)));
    if (root.value.imag() == 0) real.push_back(root);
  }
  while (real.size() > 1) {  // two real ones belong together whose shapes are most alike
    std::size_t a = 0, b = 1;
    double best = -1;
    for (std::size_t i = 0; i < real.size(); ++i) {
      for (std::size_t j = i + 1; j < real.size(); ++j) {
        const double likeness = std::norm(real[i].side.dot(real[j].side));
        if (likeness > best) best = likeness, a = i, b = j;
      }
    }
    fit.modes.push_back(mode_of(real[a].value, real[b].value));
    real.erase(real.begin() + static_cast<std::ptrdiff_t>(b));
    real.erase(real.begin() + static_cast<std::ptrdiff_t>(a));
  }
  std::sort(fit.modes.begin(), fit.modes.end(), [](const FittedMode& a, const FittedMode& b) {
    return a.natural_frequency > b.natural_frequency;
  });
  return fit;
}

}  // namespace dashpot::testing
