#include <dashpot/analysis/base/arithmetic.hpp>
#include <dashpot/analysis/base/require.hpp>
#include <dashpot/analysis/linalg/phi_functions.hpp>
#include <dashpot/analysis/response.hpp>

#include <Eigen/LU>
#include <cmath>
#include <limits>
#include <numbers>
#include <string>
#include <vector>

namespace dashpot::analysis {

using Eigen::Index;
using Eigen::MatrixXcd;
using Eigen::MatrixXd;
using Eigen::VectorXd;

namespace {

void require_vector(const VectorXd& vector, Index n, const std::string& name) {
  require(
      "Response", vector.size() == n,
      name + " has " + std::to_string(vector.size()) + " entries, expected " + std::to_string(n));
  require("Response", vector.allFinite(), name + " is not finite");
}

void require_forced_time(double time) {
  require("Response", std::isfinite(time) && time >= 0,
          "time is not a finite number of at least 0 s");
}

/// The square block of a block-diagonal matrix.
MatrixXd part(const MatrixXd& matrix, const Block& block) {
  return matrix.block(block.first, block.first, block.size, block.size);
}

/// Adds numerator / 0 + finite to the receptance: infinite where the numerator is not zero to
/// rounding, `finite` elsewhere.
void add_singular(const MatrixXcd& numerator, const MatrixXcd& finite, MatrixXcd& receptance) {
  const double negligible = 16 * kEps * numerator.cwiseAbs().maxCoeff();
  for (Index j = 0; j < numerator.cols(); ++j) {
    for (Index i = 0; i < numerator.rows(); ++i) {
      const bool reached = std::abs(numerator(i, j)) > negligible;
      receptance(i, j) += reached ? Complex(kInfinity, 0) : finite(i, j);
    }
  }
}

/// Adds left (i omega I - A)^-1 right for a block A with one row or two.
void add_small_resolvent(const MatrixXcd& left, const MatrixXd& A, const MatrixXcd& right,
                         double omega, MatrixXcd& receptance) {
  const Complex shift(0, omega);
  Complex determinant = shift - A(0, 0);
  Complex slope = 1;  // d determinant / d shift
  MatrixXcd adjugate = MatrixXcd::Ones(1, 1);
  if (A.rows() == 2) {
    const EigenvaluePair values = eigenvalue_pair(A);
    determinant = (shift - values.first) * (shift - values.second);
    slope = 2.0 * (shift - values.mean);
    adjugate.resize(2, 2);
    adjugate << shift - A(1, 1), A(0, 1), A(1, 0), shift - A(0, 0);
  }
  const MatrixXcd numerator = left * adjugate * right;
  if (determinant != 0.0) {
    receptance += numerator / determinant;
    return;
  }
  // Where the numerator vanishes with the determinant, the quotient of their slopes is the limit.
  MatrixXcd limit = MatrixXcd::Zero(numerator.rows(), numerator.cols());
  if (A.rows() == 2 && slope != 0.0) limit = left * right / slope;
  add_singular(numerator, limit, receptance);
}

}  // namespace

Response::Response(const System<>& system, const Spectrum<>& spectrum)
    : mass_(system.mass), damping_(system.damping), basis_(spectrum.basis) {
  const Index n = system.dof();
  require("Response", spectrum.status == Status::kOk || spectrum.status == Status::kUncertified,
          std::string("the spectrum holds no modes: ") + to_text(spectrum.status));
  require("Response", basis_.U.rows() == n && basis_.U.cols() == 2 * n,
          "the spectrum does not belong to a system with " + std::to_string(n) + " coordinates");
  velocity_basis_ = basis_.U * basis_.Lambda;
  const MatrixXd& zero_modes = spectrum.zero_modes.basis;
  zero_projector_ = zero_modes * (zero_modes.transpose() * mass_);
}

Motion Response::free(const VectorXd& position, const VectorXd& velocity, double time) const {
  require("Response", std::isfinite(time), "time is not a finite number");
  require_vector(position, mass_.rows(), "position");
  require_vector(velocity, mass_.rows(), "velocity");
  const VectorXd xi = coordinates(basis_, mass_, damping_, position, velocity);
  return time == 0 ? motion(position, velocity) : motion(phi_of_basis(0, time) * xi);
}

Motion Response::impulse(const VectorXd& impulse, double time) const {
  require_forced_time(time);
  Motion result = motion(phi_of_basis(0, time) * drive_of(impulse, "impulse"));
  if (time == 0) result.position.setZero(), result.zero_mode_position.setZero();
  return result;
}

Motion Response::step(const VectorXd& force, double time) const {
  require_forced_time(time);
  return motion(time * (phi_of_basis(1, time) * drive_of(force, "force")));
}

Motion Response::caused(const Cause& cause, double time) const {
  const VectorXd zero = VectorXd::Zero(mass_.rows());
  Motion sum{zero, zero, zero, zero};
  const auto add = [&](const Motion& part) {
    sum.position += part.position;
    sum.velocity += part.velocity;
    sum.zero_mode_position += part.zero_mode_position;
    sum.zero_mode_velocity += part.zero_mode_velocity;
  };
  if (cause.position || cause.velocity) {
    add(free(cause.position.value_or(zero), cause.velocity.value_or(zero), time));
  }
  if (cause.impulse) add(impulse(*cause.impulse, time));
  if (cause.force) add(step(*cause.force, time));
  return sum;
}

MatrixXcd Response::receptance(double omega) const {
  require("Response", std::isfinite(omega), "omega is not a finite number");
  const Index n = mass_.rows();
  MatrixXcd sum = MatrixXcd::Zero(n, n);
  if (n == 0) return sum;
  // (s - A)^-1 = (I + A (s - A)^-1) / s. The first term adds up to U weight Y' / s = 0, so leave it
  // out at high frequencies, where the small sum would drown in its rounding errors.
  const Complex s(0, omega);
  const bool high = std::abs(omega) > basis_.Lambda.cwiseAbs().rowwise().sum().maxCoeff();
  const MatrixXcd modes = high ? MatrixXcd(velocity_basis_ / s) : MatrixXcd(basis_.U);
  for (const Block& block : basis_.blocks) {
    const MatrixXcd left = modes.middleCols(block.first, block.size);
    const MatrixXcd right =
        part(basis_.weight, block) * basis_.Y.middleCols(block.first, block.size).transpose();
    const MatrixXd A = part(basis_.Lambda, block);
    if (block.size <= 2) {
      add_small_resolvent(left, A, right, omega, sum);
      continue;
    }
    const Eigen::FullPivLU<MatrixXcd> resolvent(s * MatrixXcd::Identity(block.size, block.size) -
                                                A);
    if (resolvent.isInvertible()) {
      sum += left * resolvent.solve(right);
    } else {
      sum.array() += Complex(kInfinity, 0);
    }
  }
  return sum;
}

VectorXd Response::drive_of(const VectorXd& force, const char* name) const {
  require_vector(force, mass_.rows(), name);
  return drive(basis_, force);
}

/// phi_k(Lambda time), block by block.
MatrixXd Response::phi_of_basis(int k, double time) const {
  MatrixXd result = MatrixXd::Zero(basis_.Lambda.rows(), basis_.Lambda.cols());
  for (const Block& block : basis_.blocks) {
    result.block(block.first, block.first, block.size, block.size) =
        phi(k, part(basis_.Lambda, block), time);
  }
  return result;
}

Motion Response::motion(const VectorXd& xi) const {
  return motion(basis_.U * xi, velocity_basis_ * xi);
}

Motion Response::motion(const VectorXd& position, const VectorXd& velocity) const {
  Motion result;
  result.position = position;
  result.velocity = velocity;
  if (zero_projector_.isZero(0)) {  // not 0 times what may have grown beyond all numbers
    result.zero_mode_position = result.zero_mode_velocity = Eigen::VectorXd::Zero(mass_.rows());
    return result;
  }
  result.zero_mode_position = zero_projector_ * result.position;
  result.zero_mode_velocity = zero_projector_ * result.velocity;
  return result;
}

namespace {

/// Position and velocity of one part of a motion at t = 0.
struct PartOfMotion {
  VectorXd q, v;
};

double energy_of(const System<>& system, const PartOfMotion& part) {
  return 0.5 * (part.q.dot(system.stiffness * part.q) + part.v.dot(system.mass * part.v));
}

/// Returns the largest |p(t)|, t >= 0, of  p'' - (l1 + l2) p' + l1 l2 p = 0  from p and v. After
/// the first time at which p' = 0 no stable motion comes as far again.
double farthest(const Mode<>& mode, double p, double v) {
  if (p == 0 && v == 0) return 0;
  if (mode.kind == ModeKind::kUnstable) return std::numeric_limits<double>::infinity();
  const auto& [first, second] = mode.eigenvalues;
  const double decay = -0.5 * (first + second).real();
  const Complex half = 0.5 * (first - second);
  // p' = exp(-decay t) (v cos(w t) - slope sin(w t) / w), with hyperbolic functions of two real
  // eigenvalues, and p likewise.
  const double slope = decay * v + (first * second).real() * p;
  double time = 0, cosine = 1, sine = 0;  // sine: sin(w t) / w
  if (half.imag() != 0) {
    const double w = std::abs(half.imag());
    double angle = std::atan2(w * v, slope);
    if (angle <= 0) angle += std::numbers::pi;
    time = angle / w, cosine = std::cos(angle), sine = std::sin(angle) / w;
  } else if (v / slope > 0) {
    constexpr double kNever = 1 - 1e-15;  // it only creeps away from p
    const double s = std::abs(half.real()), r = v / slope;
    time = s > 0 ? std::atanh(std::min(s * r, kNever)) / s : r;
    cosine = std::cosh(s * time), sine = s > 0 ? std::sinh(s * time) / s : time;
  }
  const double there = std::exp(-decay * time) * (p * cosine + (v + decay * p) * sine);
  return std::max(std::abs(p), std::abs(there));
}

/// The coordinates of the free motion; after a step, about its rest.
VectorXd free_coordinates(const System<>& system, const ModalBasis<>& basis, const Cause& cause) {
  const VectorXd zero = VectorXd::Zero(system.dof());
  VectorXd xi = coordinates<kDynamic>(basis, system.mass, system.damping,
                                      cause.position.value_or(zero), cause.velocity.value_or(zero));
  if (cause.impulse) xi += drive<kDynamic>(basis, *cause.impulse);
  if (!cause.force) return xi;
  const VectorXd pushed = drive<kDynamic>(basis, *cause.force);
  for (const Block& block : basis.blocks) {
    if (block.zero_mode) continue;
    xi.segment(block.first, block.size) +=
        basis.Lambda.block(block.first, block.first, block.size, block.size)
            .fullPivLu()
            .solve(pushed.segment(block.first, block.size));
  }
  return xi;
}

}  // namespace

ModeShares mode_shares(const System<>& system, const Spectrum<>& spectrum, const Cause& cause,
                       const MatrixXd& points) {
  Response(system, spectrum).caused(cause, 0);  // throws if the cause does not fit the system
  const Index n = system.dof();
  require("mode_shares", points.cols() == n, "points has not as many columns as coordinates");
  const ModalBasis<>& basis = spectrum.basis;
  const VectorXd xi = free_coordinates(system, basis, cause);
  const PartOfMotion none{VectorXd::Zero(n), VectorXd::Zero(n)};
  PartOfMotion zero_modes = none, whole = none;
  std::vector<PartOfMotion> parts(static_cast<std::size_t>(spectrum.modes.size()), none);
  for (const Block& block : basis.blocks) {
    const auto within = [&](int column) {
      return column >= block.first && column < block.first + block.size;
    };
    const MatrixXd U = basis.U.middleCols(block.first, block.size);
    const VectorXd x = xi.segment(block.first, block.size);
    const VectorXd x_rate =
        basis.Lambda.block(block.first, block.first, block.size, block.size) * x;
    const PartOfMotion moved{U * x, U * x_rate};
    whole.q += moved.q, whole.v += moved.v;
    double eigenvalues = 0;  // of modes that are in the block
    for (const Mode<>& mode : spectrum.modes) {
      for (const int column : mode.columns) eigenvalues += within(column) ? 1 : 0;
    }
    if (eigenvalues == 0) zero_modes.q += moved.q, zero_modes.v += moved.v;
    for (int i = 0; i < spectrum.modes.size(); ++i) {
      for (const int column : spectrum.modes[i].columns) {
        if (!within(column)) continue;
        PartOfMotion& part = parts[static_cast<std::size_t>(i)];
        part.q += moved.q / eigenvalues, part.v += moved.v / eigenvalues;
      }
    }
  }

  ModeShares result;
  result.energy.resize(spectrum.modes.size());
  result.amplitude.resize(points.rows(), spectrum.modes.size());
  for (int i = 0; i < spectrum.modes.size(); ++i) {
    const PartOfMotion& part = parts[static_cast<std::size_t>(i)];
    result.energy[i] = energy_of(system, part);
    for (Index k = 0; k < points.rows(); ++k) {
      result.amplitude(k, i) =
          farthest(spectrum.modes[i], points.row(k).dot(part.q), points.row(k).dot(part.v));
    }
  }
  result.zero_modes = energy_of(system, zero_modes);
  const double sum = result.energy.sum() + result.zero_modes;
  result.energy /= sum;
  result.zero_modes /= sum;
  result.cross = energy_of(system, whole) / sum - 1;
  return result;
}

}  // namespace dashpot::analysis
