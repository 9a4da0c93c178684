#include <dashpot/analysis/linalg/phi_functions.hpp>
#include <dashpot/analysis/sampled/sampled_data_model.hpp>

#include <Eigen/Cholesky>
#include <Eigen/Eigenvalues>
#include <Eigen/QR>
#include <Eigen/SVD>
#include <cmath>
#include <numbers>
#include <stdexcept>
#include <string>

namespace dashpot::analysis {
namespace {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXcd;

void require(bool condition, const std::string& message) {
  if (!condition) throw std::invalid_argument("sample_loop: " + message);
}

MatrixXd checked(const MatrixXd& A, Index n, const char* name) {
  if (A.size() == 0) return MatrixXd::Zero(n, n);
  require(A.rows() == n && A.cols() == n, std::string(name) + " has to be n x n");
  require(A.allFinite(), std::string(name) + " is not finite");
  return A;
}

}  // namespace

template <int N>
SampledDataModel::SampledDataModel(const System<N>& system, const Spectrum<N>& spectrum,
                                   const SampledLoop& loop)
    : n(system.dof()), delay(loop.delay), difference(loop.difference_velocity) {
  require(std::isfinite(loop.period) && loop.period > 0, "period has to be positive, s");
  require(loop.delay >= 0, "delay must not be negative, ticks");
  require(std::isfinite(loop.torque_cutoff) && loop.torque_cutoff >= 0,
          "torque_cutoff must be finite and not negative, Hz");
  require(spectrum.status == Status::kOk || spectrum.status == Status::kUncertified,
          std::string("the spectrum failed: ") + to_text(spectrum.status));
  require(spectrum.zero_modes.basis.rows() == n, "the spectrum has another size");
  const Eigen::LLT<MatrixXd> mass(checked(system.mass, n, "mass"));
  require(mass.info() == Eigen::Success, "mass is not positive definite");
  const auto unit = [&](const MatrixXd& A) -> MatrixXd {
    const MatrixXd half = mass.matrixL().solve(A);
    return mass.matrixL().solve(half.transpose()).transpose();
  };
  const double T = loop.period;
  C = T * unit(checked(system.damping, n, "damping"));
  K = T * T * unit(checked(system.stiffness, n, "stiffness"));
  D = T * unit(checked(loop.friction, n, "friction"));
  G = T * T * unit(checked(loop.gravity_gradient, n, "gravity_gradient"));
  zero_modes = mass.matrixU() * MatrixXd(spectrum.zero_modes.basis);
  if (loop.torque_cutoff > 0) {
    filter_gain = -std::expm1(-2 * std::numbers::pi * loop.torque_cutoff * T);
  }
}

MatrixXd SampledDataModel::transition() const {
  const Index rows = 2 * n + memory();
  const MatrixXd state = MatrixXd::Identity(rows, rows);
  const auto part = [&](Index at) { return state.middleRows(at, n); };
  const Index v = difference ? 2 * n : n, queue = difference ? 3 * n : 2 * n;
  const Index filter = queue + n * delay;

  const MatrixXd command = (G - K) * part(0) - (C - D) * part(v);
  MatrixXd torque = delay > 0 ? MatrixXd(part(queue)) : command;
  if (filtered()) torque = filter_gain * torque + (1 - filter_gain) * part(filter);
  // d/dt (y, y', f) = rate (y, y', f)
  MatrixXd rate = MatrixXd::Zero(3 * n, 3 * n);
  rate.block(0, n, n, n).setIdentity();
  rate.middleRows(n, n) << -G, -D, MatrixXd::Identity(n, n);
  const MatrixXd motion = phi(0, rate, 1).real();
  MatrixXd A(rows, rows);
  A.topRows(2 * n) = motion.topLeftCorner(2 * n, 2 * n) * state.topRows(2 * n) +
                     motion.topRightCorner(2 * n, n) * torque;
  if (difference) A.middleRows(v, n) = A.topRows(n) - part(0);
  if (delay > 0) {
    A.middleRows(queue, n * (delay - 1)) = state.middleRows(queue + n, n * (delay - 1));
    A.middleRows(queue + n * (delay - 1), n) = command;
  }
  if (filtered()) A.middleRows(filter, n) = torque;
  return A;
}

MatrixXd SampledDataModel::unit_motions() const {
  const Index r = zero_modes.cols();
  if (r == 0) return MatrixXd(2 * n + memory(), 0);
  MatrixXd forces(3 * n, r);
  forces << C * zero_modes, D * zero_modes, G * zero_modes;
  const Eigen::JacobiSVD<MatrixXd, Eigen::FullPivHouseholderQRPreconditioner> svd(
      forces, Eigen::ComputeFullV);
  const double negligible = 1e-10 * (C.norm() + D.norm() + G.norm());
  Index undamped = 0;
  while (undamped < r && svd.singularValues()[r - 1 - undamped] <= negligible) ++undamped;
  MatrixXd X = MatrixXd::Zero(2 * n + memory(), r + undamped);
  X.topLeftCorner(n, r) = zero_modes;
  for (Index at = difference ? 3 * n : 2 * n; at < X.rows(); at += n) {
    X.block(at, 0, n, r) = G * zero_modes;
  }
  const MatrixXd drifts = zero_modes * svd.matrixV().rightCols(undamped);
  X.block(n, r, n, undamped) = drifts;
  if (difference) X.block(2 * n, r, n, undamped) = drifts;
  return X;
}

VectorXcd SampledDataModel::discrete_eigenvalues() const {
  if (n == 0) return {};
  MatrixXd A = transition();
  if (const MatrixXd X = unit_motions(); X.cols() > 0) {
    const MatrixXd Q = Eigen::HouseholderQR<MatrixXd>(X).householderQ();
    const MatrixXd rest = Q.rightCols(A.rows() - X.cols());
    A = (rest.transpose() * A * rest).eval();
  }
  if (A.rows() == 0) return {};  // nothing holds or damps any motion
  const Eigen::EigenSolver<MatrixXd> solver(A, false);
  if (solver.info() != Eigen::Success) {
    throw std::runtime_error("sample_loop: the eigenvalue iteration did not converge");
  }
  return solver.eigenvalues();
}

template SampledDataModel::SampledDataModel(const System<kDynamic>&, const Spectrum<kDynamic>&,
                                            const SampledLoop&);
template SampledDataModel::SampledDataModel(const System<kMaxDof>&, const Spectrum<kMaxDof>&,
                                            const SampledLoop&);

}  // namespace dashpot::analysis
