#include <dashpot/analysis/base/arithmetic.hpp>
#include <dashpot/analysis/base/require.hpp>
#include <dashpot/analysis/spectrum/mode_numbers.hpp>
#include <dashpot/tests/support/state_fit.hpp>

#include <Eigen/Cholesky>
#include <Eigen/Eigenvalues>
#include <Eigen/LU>
#include <Eigen/SVD>
#include <algorithm>
#include <cmath>
#include <string>

namespace dashpot::testing {
namespace {

using analysis::kEps;
using analysis::kInfinity;
using analysis::mode_numbers;
using analysis::ModeNumbers;
using analysis::modulus;
using analysis::require;
using analysis::Root;
using analysis::root_invariants;
using Eigen::Index;
using Eigen::MatrixXcd;
using Eigen::MatrixXd;
using Eigen::VectorXcd;
using Eigen::VectorXd;

/// n, after all checks but that of the number of samples.
Index checked_dof(const std::vector<Recording>& recordings, const IdentificationOptions& options) {
  require("identify_modes", !recordings.empty(), "there is no recording");
  const Index n = recordings.front().position.rows();
  require("identify_modes", n > 0, "the positions have no rows");
  for (std::size_t k = 0; k < recordings.size(); ++k) {
    const auto& [q, v] = recordings[k];
    const std::string name = "recording " + std::to_string(k + 1);
    require(
        "identify_modes", q.rows() == n && v.rows() == n && q.cols() == v.cols(),
        name + ": positions and velocities have to be of one size, with as many rows as others");
    require("identify_modes", q.allFinite() && v.allFinite(), name + ": an entry is not finite");
  }
  require("identify_modes", std::isfinite(options.period) && options.period > 0,
          "period has to be positive, s");
  require("identify_modes", options.stride >= 0, "stride must not be negative");
  require("identify_modes", options.rank_tolerance > 0 && options.rank_tolerance < 1,
          "rank_tolerance has to be between 0 and 1");
  require("identify_modes",
          options.mass.size() == 0 || (options.mass.rows() == n && options.mass.cols() == n),
          "mass has to be n x n");
  return n;
}

/// The recordings in the coordinates x.
struct MotionStates {
  std::vector<MatrixXd> of;  // 2n x samples each
  MatrixXd L_T;              // n x n
  double weight = 1;         // w, 1/s

  MotionStates(const std::vector<Recording>& recordings, const MatrixXd& mass, Index n)
      : L_T(MatrixXd::Identity(n, n)) {
    if (mass.size() != 0) {
      const Eigen::LLT<MatrixXd> factors(mass);
      require("identify_modes", mass.allFinite() && factors.info() == Eigen::Success,
              "mass is not positive definite");
      L_T = factors.matrixU();
    }
    double q_size = 0, v_size = 0;
    for (const auto& [q, v] : recordings) {
      MatrixXd x(2 * n, q.cols());
      x << L_T * q, L_T * v;
      q_size += x.topRows(n).squaredNorm();
      v_size += x.bottomRows(n).squaredNorm();
      of.push_back(std::move(x));
    }
    require("identify_modes", q_size + v_size > 0, "nothing moves");
    if (q_size > 0 && v_size > 0) weight = std::sqrt(v_size / q_size);
    for (MatrixXd& x : of) x.topRows(n) *= weight;
  }

  /// X0 and X1, 2n x pairs; without columns if there are none.
  void pairs(int stride, MatrixXd& X0, MatrixXd& X1) const {
    Index count = 0;
    for (const MatrixXd& x : of) count += std::max<Index>(0, x.cols() - stride);
    X0.resize(of.front().rows(), count);
    X1.resize(of.front().rows(), count);
    Index at = 0;
    for (const MatrixXd& x : of) {
      const Index m = std::max<Index>(0, x.cols() - stride);
      X0.middleCols(at, m) = x.leftCols(m);
      X1.middleCols(at, m) = x.rightCols(m);
      at += m;
    }
  }
};

/// An eigenvalue of A with what belongs to it.
struct FittedRoot : Root {
  VectorXcd shape;  // n, in the coordinates L' q, unit length
  bool pairs = false;
};

/// The fit with one stride, its eigenvalues not yet paired.
struct LinearFit {
  std::vector<FittedRoot> roots;
  int rank = 0;
  double residual = 0, condition = 0;

  LinearFit(const MotionStates& states, int stride, const IdentificationOptions& options);
};

LinearFit::LinearFit(const MotionStates& states, int stride, const IdentificationOptions& options) {
  MatrixXd X0, X1;
  states.pairs(stride, X0, X1);
  require("identify_modes", X0.cols() > X0.rows(),
          std::to_string(X0.cols()) + " pairs of samples are too few, need " +
              std::to_string(X0.rows() + 1) + " or more");
  // The transpose is tall, so that a QR factorisation comes first.
  const Eigen::JacobiSVD<MatrixXd> svd(X0.transpose(), Eigen::ComputeThinU | Eigen::ComputeThinV);
  const VectorXd& S = svd.singularValues();
  while (rank < S.size() && S[rank] > options.rank_tolerance * S[0]) ++rank;
  require("identify_modes", rank > 0, "nothing moves");
  condition = S[0] / S[rank - 1];
  const MatrixXd U = svd.matrixV().leftCols(rank), V = svd.matrixU().leftCols(rank);
  const VectorXd per_S = S.head(rank).cwiseInverse();
  const MatrixXd UX1 = U.transpose() * X1;
  const MatrixXd A = UX1 * V * per_S.asDiagonal();
  const MatrixXd left_over = UX1 - A * S.head(rank).asDiagonal() * V.transpose();
  residual = (X1 - U * (UX1 - left_over)).norm() / X1.norm();

  const Eigen::EigenSolver<MatrixXd> solver(A);
  require("identify_modes", solver.info() == Eigen::Success,
          "the eigenvalue iteration did not converge");
  const VectorXcd& z = solver.eigenvalues();
  const MatrixXcd right = solver.eigenvectors(), left = right.inverse();
  const double duration = stride * options.period;
  const Index n = X0.rows() / 2;
  for (Index i = 0; i < z.size(); ++i) {
    const VectorXcd x = right.col(i);
    const double noise = (left.row(i) * left_over).norm();
    const double rounding = kEps * left.row(i).norm() * X1.norm();
    const double error = (noise + rounding) * per_S.cwiseProduct(x).norm();
    FittedRoot root;
    root.value = std::log(z[i]) / duration;  // of a negative z too
    root.bound = error < std::abs(z[i]) ? error / std::abs(z[i]) / duration : kInfinity;
    root.pairs = z[i].imag() != 0 || z[i].real() > 0;
    const VectorXcd state = U * x;
    const bool still = state.head(n).norm() > state.tail(n).norm();
    root.shape = (still ? state.head(n) : state.tail(n)).normalized();
    roots.push_back(std::move(root));
  }
}

/// About 1 rad of the fastest mode that the data determine.
int chosen_stride(const MotionStates& states, const IdentificationOptions& options) {
  Index shortest = states.of.front().cols();
  for (const MatrixXd& x : states.of) shortest = std::min(shortest, x.cols());
  double fastest = 0;
  for (const FittedRoot& root : LinearFit(states, 1, options).roots) {
    const double size = modulus(root.value);
    if (root.pairs && root.bound < 0.1 * size) fastest = std::max(fastest, size);
  }
  const double stride = fastest > 0 ? std::nearbyint(1 / (fastest * options.period)) : 1;
  const auto longest = static_cast<double>(std::max<Index>(1, shortest / 4));
  return static_cast<int>(std::clamp(stride, 1.0, longest));
}

IdentifiedMode to_mode(const FittedRoot& first, const FittedRoot& second, const MatrixXd& L_T,
                       double soft_frequency) {
  const ModeNumbers numbers =
      mode_numbers(first, second, root_invariants(first, second), soft_frequency);
  const VectorXcd& shape = numbers.eigenvalues[0] == first.value ? first.shape : second.shape;
  VectorXcd u(shape.size());
  u.real() = L_T.triangularView<Eigen::Upper>().solve(shape.real());
  u.imag() = L_T.triangularView<Eigen::Upper>().solve(shape.imag());
  return {numbers.eigenvalues,
          numbers.natural_frequency,
          numbers.damping_ratio,
          numbers.damped_frequency,
          numbers.kind,
          numbers.error_bound,
          numbers.natural_frequency_bound,
          numbers.damping_ratio_bound,
          u.normalized()};
}

/// The two real eigenvalues, not yet in a pair, whose shapes are most alike; equal ones for none.
std::pair<std::size_t, std::size_t> most_alike(const std::vector<FittedRoot>& roots,
                                               const std::vector<bool>& used) {
  std::pair<std::size_t, std::size_t> pair{0, 0};
  double best = -1;
  for (std::size_t i = 0; i < roots.size(); ++i) {
    for (std::size_t j = i + 1; j < roots.size(); ++j) {
      if (used[i] || used[j]) continue;
      const double likeness = std::norm(roots[i].shape.dot(roots[j].shape));
      if (likeness > best) best = likeness, pair = {i, j};
    }
  }
  return pair;
}

}  // namespace

IdentifiedModes identify_modes(const std::vector<Recording>& recordings,
                               const IdentificationOptions& options) {
  const Index n = checked_dof(recordings, options);
  const MotionStates states(recordings, options.mass, n);
  IdentifiedModes fit;
  fit.stride = options.stride > 0 ? options.stride : chosen_stride(states, options);
  const LinearFit linear(states, fit.stride, options);
  fit.rank = linear.rank;
  fit.residual = linear.residual;
  fit.condition = linear.condition;

  const std::vector<FittedRoot>& roots = linear.roots;
  std::vector<bool> used(roots.size());
  for (std::size_t i = 0; i < roots.size(); ++i) {
    used[i] = roots[i].value.imag() != 0 || !roots[i].pairs;
    if (!roots[i].pairs) fit.unpaired.push_back(roots[i].value);
    if (!roots[i].pairs || roots[i].value.imag() <= 0) continue;
    FittedRoot conjugate = roots[i];
    conjugate.value = std::conj(conjugate.value);
    fit.modes.push_back(to_mode(roots[i], conjugate, states.L_T, options.soft_frequency));
  }
  for (;;) {
    const auto [i, j] = most_alike(roots, used);
    if (i == j) break;
    used[i] = used[j] = true;
    fit.modes.push_back(to_mode(roots[i], roots[j], states.L_T, options.soft_frequency));
  }
  for (std::size_t i = 0; i < roots.size(); ++i) {
    if (!used[i]) fit.unpaired.push_back(roots[i].value);
  }
  std::sort(fit.modes.begin(), fit.modes.end(),
            [](const IdentifiedMode& a, const IdentifiedMode& b) {
              const auto size = [](const IdentifiedMode& mode) {
                return modulus(mode.eigenvalues[0]) * modulus(mode.eigenvalues[1]);
              };
              return size(a) > size(b);
            });
  return fit;
}

}  // namespace dashpot::testing
