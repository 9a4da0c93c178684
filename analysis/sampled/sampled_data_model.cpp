#include <dashpot/analysis/base/require.hpp>
#include <dashpot/analysis/linalg/hessenberg_qr.hpp>
#include <dashpot/analysis/sampled/sampled_data_model.hpp>

#include <Eigen/Cholesky>
#include <Eigen/QR>
#include <Eigen/SVD>
#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>
#include <stdexcept>
#include <string>

namespace dashpot::analysis {
namespace {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXcd;

MatrixXd checked(const MatrixXd& A, Index n, const char* name) {
  if (A.size() == 0) return MatrixXd::Zero(n, n);
  require("sample_loop", A.rows() == n && A.cols() == n, std::string(name) + " has to be n x n");
  require("sample_loop", A.allFinite(), std::string(name) + " is not finite");
  return A;
}

/// Returns (y, y') after a tick from (y, y', f), 2n x 3n, of y'' = -G y - D y' + f. The motion y =
/// V1 from y' = I is a Taylor series over the tick / 2^s, which is doubled; V0 is its velocity and
/// V2 its integral. From y = I it is I - V2 G, and constant f moves by V2.
MatrixXd motion_of_tick(const MatrixXd& G, const MatrixXd& D) {
  const auto norm = [](const MatrixXd& A) {
    return A.size() == 0 ? 0.0 : A.cwiseAbs().colwise().sum().maxCoeff();
  };
  const double size = std::max(norm(D), std::sqrt(norm(G)));
  if (!std::isfinite(size)) throw std::invalid_argument("sample_loop: the friction is too large");
  const int doublings = size < 0.5 ? 0 : std::ilogb(size) + 2;
  const double t = std::ldexp(1.0, -doublings);
  const MatrixXd identity = MatrixXd::Identity(G.rows(), G.cols());
  const bool damped = !D.isZero(0);
  MatrixXd V0 = identity, V1 = t * identity, V2 = 0.5 * t * t * identity;
  MatrixXd before = 0 * identity, term = V1, next;  // of V1
  double largest = t;  // of a term: they fall like powers of the golden ratio times `size`
  for (int k = 2; (largest *= std::numbers::phi * size * t / k) > 1e-18 * t; ++k) {
    if (damped || k % 2 == 1) {  // the other terms are zero
      next = -t * t / (k * (k - 1.0)) * G.lazyProduct(before);
      if (damped) next -= t / k * D.lazyProduct(term);
      V0 += k / t * next;
      V1 += next;
      V2 += t / (k + 1) * next;
    }
    before.swap(term);
    term.swap(next);
  }
  for (int i = 0; i < doublings; ++i) {
    const MatrixXd Y0 = identity - V2 * G, square = V1 * V1;
    V2 = (V2 + Y0 * V2 + square).eval();
    const MatrixXd twice = Y0 * V1 + V1 * V0;
    V0 = (V0 * V0 - V1 * G * V1).eval();
    V1 = twice;
  }
  MatrixXd motion(2 * G.rows(), 3 * G.rows());
  motion << identity - V2 * G, V1, V2, -V1 * G, V0, V1;
  return motion;
}

}  // namespace

SampledLoop with_gears(const SampledLoop& loop) {
  const Gears& gears = loop.gears;
  if (!gears.any()) return loop;
  const Index n = gears.data().stiffness.size(), size = gears.coordinates();
  const MatrixXd none = MatrixXd::Zero(size, size);
  SampledLoop result = loop;
  result.gears = {};
  MatrixXd outside = checked(loop.friction, n, "friction");
  if (gears.data().friction.size() > 0) outside -= gears.data().friction;
  result.friction = result.passive_stiffness = none;
  gears.add_on_links(outside, result.friction);
  gears.add_friction(result.friction);
  gears.add_gears(gears.data().damping, result.friction);
  gears.add_on_links(checked(loop.passive_stiffness, n, "passive_stiffness"),
                     result.passive_stiffness);
  gears.add_gears(gears.data().stiffness, result.passive_stiffness);
  const MatrixXd gravity = checked(loop.gravity_gradient, n, "gravity_gradient");
  result.gravity_gradient = result.compensation = none;
  gears.add_on_links(gravity, result.gravity_gradient);
  gears.add_of_controller(loop.compensation.size() > 0 ? loop.compensation : gravity,
                          result.compensation);
  const auto& [state, position, output] = loop.memory;
  const Index states = state.rows();
  if (states == 0) return result;
  require("sample_loop", position.cols() == n && output.rows() == n,
          "memory has to be m x m, m x n and n x m");
  result.memory.position = MatrixXd::Zero(position.rows(), size);
  result.memory.output = MatrixXd::Zero(size, output.cols());
  for (Index i = 0; i < n; ++i) {
    result.memory.position.col(gears.measured(i)) = position.col(i);
    result.memory.output.row(gears.motor(i)) = output.row(i);
  }
  return result;
}

void SampledDataModel::set_loop(const SampledLoop& loop) {
  require("sample_loop", !loop.gears.any(), "a loop with gears has to be extended first");
  require("sample_loop", std::isfinite(loop.period) && loop.period > 0,
          "period has to be positive, s");
  require("sample_loop", loop.delay >= 0, "delay must not be negative, ticks");
  require("sample_loop", std::isfinite(loop.torque_cutoff) && loop.torque_cutoff >= 0,
          "torque_cutoff must be finite and not negative, Hz");
  delay = loop.delay;
  difference = loop.difference_velocity;
  if (loop.torque_cutoff > 0) {
    filter_gain = -std::expm1(-2 * std::numbers::pi * loop.torque_cutoff * loop.period);
  }
}

template <int N>
SampledDataModel::SampledDataModel(const System<N>& system, const Spectrum<N>& spectrum,
                                   const SampledLoop& loop)
    : n(system.dof()) {
  set_loop(loop);
  require("sample_loop", spectrum.status == Status::kOk || spectrum.status == Status::kUncertified,
          std::string("the spectrum failed: ") + to_text(spectrum.status));
  require("sample_loop", spectrum.zero_modes.basis.rows() == n, "the spectrum has another size");
  const Eigen::LLT<MatrixXd> mass(checked(system.mass, n, "mass"));
  require("sample_loop", mass.info() == Eigen::Success, "mass is not positive definite");
  const auto unit = [&](const MatrixXd& A) -> MatrixXd {
    const MatrixXd half = mass.matrixL().solve(A);
    return mass.matrixL().solve(half.transpose()).transpose();
  };
  const double T = loop.period;
  C = T * unit(checked(system.damping, n, "damping"));
  K = T * T * unit(checked(system.stiffness, n, "stiffness"));
  D = T * unit(checked(loop.friction, n, "friction"));
  P = T * T * unit(checked(loop.passive_stiffness, n, "passive_stiffness"));
  G = P + T * T * unit(checked(loop.gravity_gradient, n, "gravity_gradient"));
  H = loop.compensation.size() == 0 ? MatrixXd(G - P)
                                    : T * T * unit(checked(loop.compensation, n, "compensation"));
  zero_modes = mass.matrixU() * MatrixXd(spectrum.zero_modes.basis);
  remember(loop, mass.matrixU().solve(MatrixXd::Identity(n, n)));
  integrate();
}

template <int N>
SampledDataModel::SampledDataModel(const ElasticForm<N>& form, const SampledLoop& loop)
    : n(form.coordinates.rows()) {
  set_loop(loop);
  const Index m = form.modes();
  const bool plain = loop.friction.isZero(0) && loop.gravity_gradient.isZero(0) &&
                     loop.passive_stiffness.isZero(0) && loop.compensation.isZero(0) &&
                     loop.memory.state.size() == 0;
  if (plain && form.free_zero_modes) n = m;
  const auto unit = [&](const MatrixXd& A) -> MatrixXd {
    if (plain) return MatrixXd::Zero(n, n);
    const MatrixXd given =
        checked(A, n, "friction, gravity_gradient, compensation and passive_stiffness");
    return form.coordinates.transpose() * given * form.coordinates;
  };
  const double T = loop.period;
  C = T * form.damping.topLeftCorner(n, n);
  K = MatrixXd::Zero(n, n);
  K.topLeftCorner(m, m).noalias() = T * T * form.root.lazyProduct(form.root.transpose());
  D = T * unit(loop.friction);
  P = T * T * unit(loop.passive_stiffness);
  G = P + T * T * unit(loop.gravity_gradient);
  H = loop.compensation.size() == 0 ? MatrixXd(G - P) : T * T * unit(loop.compensation);
  zero_modes = MatrixXd::Identity(n, n).rightCols(n - m);
  remember(loop, form.coordinates.leftCols(n));
  integrate();
}

void SampledDataModel::remember(const SampledLoop& loop, const MatrixXd& coordinates) {
  const auto& [state, position, output] = loop.memory;
  const Index m = state.rows(), joints = coordinates.rows();
  require("sample_loop",
          state.cols() == m && position.rows() == m && output.cols() == m &&
              (m == 0 || (position.cols() == joints && output.rows() == joints)),
          "memory has to be m x m, m x n and n x m");
  require("sample_loop", state.allFinite() && position.allFinite() && output.allFinite(),
          "memory is not finite");
  states = {MatrixXd(0, 0), MatrixXd(0, n), MatrixXd(n, 0)};
  if (m == 0) return;
  const double T = loop.period;
  states = {state, position * coordinates, T * T * coordinates.transpose() * output};
  if ((states.position * zero_modes).norm() > 1e-10 * states.position.norm()) {
    zero_modes.resize(n, 0);
  }
}

void SampledDataModel::integrate() {
  const MatrixXd uncompensated = (G - P - H) * zero_modes;
  if (uncompensated.norm() > 1e-10 * (G.norm() + H.norm())) zero_modes.resize(n, 0);
  span_commands();
  motion = motion_of_tick(G, D);
}

void SampledDataModel::touch(const Eigen::VectorXd& a) {
  const Index r = zero_modes.cols();
  if (r == 0) return;
  const Eigen::HouseholderQR<MatrixXd> qr(zero_modes);  // another mass may have made it oblique
  zero_modes = MatrixXd(qr.householderQ()).leftCols(r);
  const Eigen::VectorXd touched = zero_modes.transpose() * a;
  if (!(touched.norm() > 1e-10 * a.norm())) return;
  const Eigen::HouseholderQR<MatrixXd> free(touched);
  zero_modes = zero_modes * MatrixXd(free.householderQ()).rightCols(r - 1);
}

void SampledDataModel::press(const Eigen::VectorXd& a, double stiffness) {
  for (MatrixXd* spring : {&G, &K, &P}) *spring += stiffness * a * a.transpose();
  motion = motion_of_tick(G, D);  // the commands are the same
}

void SampledDataModel::hold(const Eigen::VectorXd& a) {
  touch(a);
  const Eigen::HouseholderQR<MatrixXd> qr(a);
  const MatrixXd Q = MatrixXd(qr.householderQ()).rightCols(--n);
  for (MatrixXd* part : {&C, &K, &D, &G, &P, &H}) *part = Q.transpose() * *part * Q;
  zero_modes = (Q.transpose() * zero_modes).eval();
  states.position = (states.position * Q).eval();
  states.output = (Q.transpose() * states.output).eval();
  integrate();
}

void SampledDataModel::span_commands() {
  commands.setIdentity(n, n);
  if (n == 0 || (delay == 0 && !filtered())) return;
  const Index m = states.state.rows();
  MatrixXd parts(n, 3 * n + m);
  parts << H, K - P, C - D, states.output * std::max(1.0, states.position.norm());
  const Eigen::ColPivHouseholderQR<MatrixXd> qr(parts);
  const double rounding = static_cast<double>(n) * std::numeric_limits<double>::epsilon();
  const Index count = n - (qr.matrixR().diagonal().array().abs() <= rounding).count();
  if (count < n) commands = MatrixXd(qr.householderQ()).leftCols(count);
}

MatrixXd SampledDataModel::transition(double factor) const {
  const Index rows = this->rows(), m = states.state.rows(), r = commands.cols();
  const Index v = difference ? 2 * n : n, queue = difference ? 3 * n : 2 * n;
  const Index filter = queue + r * delay;

  MatrixXd command = MatrixXd::Zero(n, rows);
  command.leftCols(n) = H - factor * (K - P);
  command.middleCols(v, n) -= factor * (C - D);
  command.rightCols(m) = -factor * states.output;
  if (r < n) command = commands.transpose() * command;
  MatrixXd torque = command;
  if (delay > 0) torque.setZero(), torque.middleCols(queue, r).setIdentity();
  if (filtered()) {
    torque *= filter_gain;
    torque.middleCols(filter, r).diagonal().array() += 1 - filter_gain;
  }
  MatrixXd A = MatrixXd::Zero(rows, rows);
  A.topRows(2 * n).noalias() = motion.rightCols(n) * commands * torque;
  A.topLeftCorner(2 * n, 2 * n) += motion.leftCols(2 * n);
  if (difference) {
    A.middleRows(v, n) = A.topRows(n);
    A.block(v, 0, n, n).diagonal().array() -= 1;
  }
  if (delay > 0) {
    A.block(queue, queue + r, r * (delay - 1), r * (delay - 1)).setIdentity();
    A.middleRows(queue + r * (delay - 1), r) = command;
  }
  if (filtered()) A.middleRows(filter, r) = torque;
  A.bottomLeftCorner(m, n) = states.position;
  A.bottomRightCorner(m, m) = states.state;
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
  const MatrixXd held = commands.transpose() * H * zero_modes;
  const Index step = std::max<Index>(1, commands.cols());
  for (Index at = difference ? 3 * n : 2 * n; at < X.rows() - states.state.rows(); at += step) {
    X.block(at, 0, step, r) = held;
  }
  const MatrixXd drifts = zero_modes * svd.matrixV().rightCols(undamped);
  X.block(n, r, n, undamped) = drifts;
  if (difference) X.block(2 * n, r, n, undamped) = drifts;
  return X;
}

MatrixXd SampledDataModel::on_other_motions(MatrixXd A, const MatrixXd& X) {
  if (X.cols() == 0) return A;
  const Eigen::HouseholderQR<MatrixXd> qr(X);
  A.applyOnTheLeft(qr.householderQ().adjoint());
  A.applyOnTheRight(qr.householderQ());
  const Index rest = X.rows() - X.cols();
  return A.bottomRightCorner(rest, rest);
}

VectorXcd SampledDataModel::discrete_eigenvalues() const {
  if (n == 0) return {};
  MatrixXd A = on_other_motions(transition());
  const VectorXcd z = eigenvalues_of(A);
  // Where nothing is commanded, a delay and a filter do by themselves.
  const Index filters = filtered() ? n - commands.cols() : 0;
  VectorXcd all(z.size() + idle());
  all << z, VectorXcd::Zero(idle() - filters), VectorXcd::Constant(filters, 1 - filter_gain);
  return all;
}

VectorXcd eigenvalues_of(MatrixXd& A) {
  VectorXcd result(A.rows());
  reduce_to_hessenberg(A);
  if (!A.allFinite() || !hessenberg_eigenvalues(A, result.data())) {
    throw std::runtime_error("sample_loop: the eigenvalue iteration did not converge");
  }
  return result;
}

template SampledDataModel::SampledDataModel(const System<kDynamic>&, const Spectrum<kDynamic>&,
                                            const SampledLoop&);
template SampledDataModel::SampledDataModel(const System<kMaxDof>&, const Spectrum<kMaxDof>&,
                                            const SampledLoop&);
template SampledDataModel::SampledDataModel(const ElasticForm<kDynamic>&, const SampledLoop&);
template SampledDataModel::SampledDataModel(const ElasticForm<kMaxDof>&, const SampledLoop&);

}  // namespace dashpot::analysis
