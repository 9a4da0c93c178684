#include <dashpot/analysis/base/arithmetic.hpp>
#include <dashpot/analysis/base/require.hpp>
#include <dashpot/analysis/linalg/phi_functions.hpp>
#include <dashpot/analysis/response.hpp>

#include <Eigen/LU>
#include <cmath>
#include <string>

namespace dashpot::analysis {
namespace {

using Eigen::Index;
using Eigen::MatrixXcd;
using Eigen::MatrixXd;
using Eigen::VectorXd;

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

}  // namespace dashpot::analysis
