#include <dashpot/analysis/sampled/small_problem.hpp>

#include <Eigen/Eigenvalues>
#include <Eigen/LU>
#include <Eigen/QR>
#include <Eigen/SVD>
#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>
#include <stdexcept>
#include <utility>
#include <vector>

namespace dashpot::analysis {
namespace {

using Eigen::Index;
using Eigen::MatrixXcd;
using Eigen::MatrixXd;
using Eigen::VectorXcd;

constexpr double kNoGain = 1e-13;
/// Roots below this are of high multiplicity, or nearly, and die out within a few ticks.
constexpr double kShort = 0.2;
/// By how much the sum of the roots may miss the trace, because of these.
constexpr double kSumMissed = 1e-2;

/// e^zeta - 1 without cancellation.
Complex expm1(Complex zeta) {
  const double sine = std::sin(0.5 * zeta.imag()), grown = std::expm1(zeta.real());
  return {grown * std::cos(zeta.imag()) - 2 * sine * sine, (1 + grown) * std::sin(zeta.imag())};
}

VectorXcd eigenvalues(const MatrixXcd& A) {
  if (A.rows() == 1) return VectorXcd::Constant(1, A(0, 0));
  const Eigen::ComplexEigenSolver<MatrixXcd> solver(A, false);
  if (solver.info() != Eigen::Success) {
    throw std::runtime_error("sample_loop: the eigenvalue iteration did not converge");
  }
  return solver.eigenvalues();
}

/// Where z is real so is A, and its eigenvalues are exactly real or conjugate pairs.
VectorXcd eigenvalues(const MatrixXcd& A, Complex zeta) {
  const bool real = zeta.imag() == 0 || zeta.imag() == std::numbers::pi;
  if (!real || A.rows() == 1) return eigenvalues(A);
  MatrixXd B = A.real();
  return eigenvalues_of(B);
}

}  // namespace

SmallProblem::SmallProblem(const SampledDataModel& model)
    : model_(model), masses_alone_(model.masses_alone()) {
  const Eigen::JacobiSVD<MatrixXd> svd(model.gain, Eigen::ComputeThinU);
  const double negligible =
      kNoGain * (svd.singularValues().size() > 0 ? svd.singularValues()[0] : 0);
  const Index r = (svd.singularValues().array() > negligible).count();
  const MatrixXd Q = svd.matrixU().leftCols(r);
  gain_ = Q.transpose() * model.gain;
  input_ = model.input * Q;
  stiffness_ = Q.transpose() * model.K * Q;
  damping_ = Q.transpose() * (model.C - model.D) * Q;
  if (has_gravity()) {
    SampledDataModel light = model;
    light.set_gravity(MatrixXd::Zero(model.n, model.n));
    without_gravity_ = light.change;
  }
}

MatrixXcd SmallProblem::open_loop(Complex zeta) const {
  MatrixXcd P = -model_.change.cast<Complex>();
  P.diagonal().array() += expm1(zeta);
  if (has_gravity()) {
    const Complex h = std::exp(model_.log_actuation(zeta));
    P.noalias() -= (h * model_.input.cast<Complex>()) * model_.uncontrolled.cast<Complex>();
  }
  return P;
}

VectorXcd SmallProblem::values(Complex zeta) const {
  if (!masses_alone_) {
    const MatrixXcd motion = open_loop(zeta).partialPivLu().solve(input_.cast<Complex>());
    return eigenvalues(gain_.cast<Complex>() * motion, zeta);
  }
  const Complex d = expm1(zeta), z = 1.0 + d;
  const Complex position = (z + 1.0) / (2.0 * d * d);
  const Complex velocity = model_.difference ? (z + 1.0) / (2.0 * z * d) : 1.0 / d;
  return eigenvalues(position * stiffness_.cast<Complex>() + velocity * damping_.cast<Complex>(),
                     zeta);
}

VectorXcd SmallProblem::gravity_values(Complex zeta) const {
  const Complex h = std::exp(model_.log_actuation(zeta));
  MatrixXcd P = -without_gravity_.cast<Complex>();
  P.diagonal().array() += expm1(zeta);
  MatrixXcd E = (without_gravity_ - model_.change).cast<Complex>();
  E.noalias() -= (h * model_.input.cast<Complex>()) * model_.uncontrolled.cast<Complex>();
  const MatrixXcd motion = P.partialPivLu().solve(E);
  if (motion.squaredNorm() < 1) return {};
  return eigenvalues(motion, zeta);
}

Complex SmallProblem::log_slope(Complex z) const {
  const double a = 1 - model_.filter_gain;
  const double wait = model_.delay;
  Complex h = std::pow(z, -model_.delay), slope = -wait / z;
  if (model_.filtered()) h *= model_.filter_gain * z / (z - a), slope += 1.0 / z - 1.0 / (z - a);
  const MatrixXcd loop =
      model_.input.cast<Complex>() * (model_.uncontrolled - model_.gain).cast<Complex>();
  MatrixXcd P = -model_.change.cast<Complex>() - h * loop;
  P.diagonal().array() += z - 1.0;
  MatrixXcd change = -h * slope * loop;
  change.diagonal().array() += 1.0;
  const Complex result = P.partialPivLu().solve(change).trace();
  return std::isfinite(modulus(result)) ? result : Complex(std::numeric_limits<double>::infinity());
}

namespace {

/// All roots, moved together.
class Aberth {
 public:
  Aberth(const SampledDataModel& model, std::vector<Complex> roots, Index ones)
      : model_(model), problem_(model), roots_(std::move(roots)), ones_(ones) {}

  std::vector<Complex> solve() {
    constexpr int kMost = 60;
    const double a = 1 - model_.filter_gain;
    std::vector<bool> done(roots_.size());
    for (std::size_t i = 0; i < roots_.size(); ++i) {
      // Commands that nothing gives, and their filters
      done[i] = modulus(roots_[i]) < 1e-3 || (model_.filtered() && modulus(roots_[i] - a) < 1e-9);
      if (!done[i] && roots_[i].imag() == 0)
        roots_[i] += Complex(0, 1e-7 * static_cast<double>(1 + i % 7));
    }
    double worst = 0;
    for (int k = 0; k < kMost; ++k) {
      worst = 0;
      for (std::size_t i = 0; i < roots_.size(); ++i) {
        if (done[i]) continue;
        const double moved = move(roots_[i], i);
        const bool fades = modulus(roots_[i]) < kShort;
        if (!fades) worst = std::max(worst, moved);
        done[i] = moved < 1e-14 || (fades && k > kMost / 4);
      }
      if (worst < 1e-13) break;
    }
    if (!(worst < 1e-7)) throw std::runtime_error("sample_loop: the roots did not converge");
    return roots_;
  }

 private:
  /// Returns how far the root has moved.
  double move(Complex& root, std::size_t number) const {
    const double queue = static_cast<double>(model_.n * model_.delay);
    Complex sum = problem_.log_slope(root) + queue / root;
    if (model_.filtered()) sum += static_cast<double>(model_.n) / (root - 1.0 + model_.filter_gain);
    sum -= static_cast<double>(ones_) / (root - 1.0);
    for (std::size_t j = 0; j < roots_.size(); ++j) {
      if (j != number && roots_[j] != root) sum -= 1.0 / (root - roots_[j]);
    }
    Complex step = 1.0 / sum;
    if (!std::isfinite(modulus(step))) return 0;
    const double size = modulus(step), most = 0.3 * (modulus(root - 1.0) + 0.01);
    if (size > most) step *= most / size;
    root -= step;
    return std::min(size, most);
  }

  const SampledDataModel& model_;
  SmallProblem problem_;
  std::vector<Complex> roots_;
  Index ones_;
};

/// Motions that hardly touch each other: the zero modes, and what moves under the springs.
MatrixXd directions(const SampledDataModel& model) {
  const Index n = model.n, r = model.zero_modes.cols();
  MatrixXd Z = MatrixXd::Identity(n, n);
  if (r > 0) {
    Z = Eigen::HouseholderQR<MatrixXd>(model.zero_modes).householderQ();
    Z.leftCols(r) = model.zero_modes;
  }
  const auto scaled = [](const MatrixXd& A) -> MatrixXd {
    const MatrixXd S = A + A.transpose();
    return S.norm() > 0 ? MatrixXd(S / S.norm()) : S;
  };
  const MatrixXd B = scaled(model.K) + 0.618 * scaled(model.C) + 0.1 * scaled(model.D);
  for (const auto& [from, count] : {std::pair<Index, Index>{0, r}, {r, n - r}}) {
    if (count == 0) continue;
    const MatrixXd part = Z.middleCols(from, count);
    const Eigen::SelfAdjointEigenSolver<MatrixXd> eigen(part.transpose() * B * part);
    Z.middleCols(from, count) = part * eigen.eigenvectors();
  }
  return Z;
}

/// Makes pairs exactly conjugate, and real what is so to rounding, or has no partner.
VectorXcd in_pairs(std::vector<Complex> roots) {
  std::sort(roots.begin(), roots.end(),
            [](Complex a, Complex b) { return std::abs(a.imag()) > std::abs(b.imag()); });
  VectorXcd result(static_cast<Index>(roots.size()));
  Index count = 0;
  while (!roots.empty()) {
    const Complex z = roots.front();
    roots.erase(roots.begin());
    auto nearest = roots.end();
    const auto distance = [&](Complex other) { return modulus(other - std::conj(z)); };
    for (auto it = roots.begin(); it != roots.end(); ++it) {
      if (nearest == roots.end() || distance(*it) < distance(*nearest)) nearest = it;
    }
    const bool real = std::abs(z.imag()) <= 1e-10 * modulus(z);
    const bool alone = nearest == roots.end() || distance(*nearest) > std::abs(z.imag());
    if (real || alone) {
      if (modulus(z) > kShort && !real) {
        throw std::runtime_error("sample_loop: the roots did not converge");
      }
      result[count++] = z.real();
      continue;
    }
    roots.erase(nearest);
    result[count++] = z;
    result[count++] = std::conj(z);
  }
  return result;
}

}  // namespace

VectorXcd roots_of_small_problem(const SampledDataModel& model) {
  const Index ones = model.unit_motions().cols();
  const MatrixXd Z = directions(model);
  std::vector<Complex> starts;
  for (Index j = 0; j < model.n; ++j) {
    MatrixXd A = model.along(Z.col(j)).transition();
    for (const Complex z : eigenvalues_of(A)) starts.push_back(z);
  }
  const Index states = model.inner() - (model.difference ? 3 : 2) * model.n;
  if (states > 0) {
    MatrixXd A = model.change.bottomRightCorner(states, states);
    for (const Complex z : eigenvalues_of(A)) starts.push_back(1.0 + z - 1e-3);
  }
  std::sort(starts.begin(), starts.end(),
            [](Complex a, Complex b) { return std::norm(a - 1.0) > std::norm(b - 1.0); });
  starts.resize(starts.size() - static_cast<std::size_t>(ones));
  const std::vector<Complex> roots = Aberth(model, std::move(starts), ones).solve();
  Complex sum = static_cast<double>(ones);
  for (const Complex z : roots) sum += z;
  const double trace = model.transition().trace();
  if (!(modulus(sum - trace) < kSumMissed)) {
    throw std::runtime_error("sample_loop: the roots did not converge");
  }
  return in_pairs(roots);
}

}  // namespace dashpot::analysis
