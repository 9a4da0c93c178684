#include <dashpot/analysis/rigid_body_elimination.hpp>

#include <Eigen/Cholesky>
#include <Eigen/SVD>
#include <algorithm>
#include <cmath>
#include <limits>
#include <numeric>
#include <stdexcept>
#include <string>

namespace dashpot::analysis {
namespace {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

/// S' A S, exactly symmetric if A is.
MatrixXd congruence(const MatrixXd& S, const MatrixXd& A) {
  MatrixXd product = S.transpose() * A * S;
  if (A == A.transpose()) product = (0.5 * (product + product.transpose())).eval();
  return product;
}

void check(const System<>& system, const ZeroModes<>& zero_modes) {
  if (zero_modes.basis.rows() != system.dof() || zero_modes.basis.cols() != zero_modes.count) {
    throw std::invalid_argument("elimination: the zero modes do not belong to the system");
  }
}

/// Directions y in which no spring acts, y' K = 0: the zero modes where K is symmetric, and
/// otherwise as many left singular vectors of L^-1 K L^-T, M = L L'.
MatrixXd unsprung_directions(const System<>& system, const ZeroModes<>& zero_modes) {
  if (zero_modes.count == 0 || system.stiffness == system.stiffness.transpose()) {
    return zero_modes.basis;
  }
  const Eigen::LLT<MatrixXd> cholesky(system.mass);
  MatrixXd K = system.stiffness.transpose();
  cholesky.matrixL().solveInPlace(K);
  K.transposeInPlace();
  cholesky.matrixL().solveInPlace(K);
  const Eigen::JacobiSVD<MatrixXd> svd(K, Eigen::ComputeFullU);
  return cholesky.matrixU().solve(svd.matrixU().rightCols(zero_modes.count));
}

RigidBodyElimination nothing_removed(const System<>& system) {
  RigidBodyElimination elimination;
  elimination.constraint_matrix = MatrixXd::Identity(system.dof(), system.dof());
  return elimination;
}

/// Index among the coordinates left of the one to eliminate, for s = M u.
Index choose_pivot(const VectorXd& s, Pivot pivot) {
  Index largest = 0;
  const double scale = s.cwiseAbs().maxCoeff(&largest);
  if (pivot == Pivot::kLargest) return largest;
  const Index last = s.size() - 1;
  if (std::abs(s(last)) <= 16 * std::numeric_limits<double>::epsilon() * scale) {
    throw std::domain_error(
        "elimination: the zero mode does not move the last coordinate, which therefore cannot be "
        "eliminated; use the largest pivot");
  }
  return last;
}

/// Appends the step that removes the null vector u of the current reduced system with mass `mass`
/// (Eqs. 8-13), and returns its matrix: an identity with a row put in that gives the eliminated
/// coordinate from the others.
MatrixXd append_step(const MatrixXd& mass, const VectorXd& u, Pivot pivot,
                     RigidBodyElimination& elimination) {
  const Index n = u.size();
  const VectorXd s = mass * u;
  const Index i = choose_pivot(s, pivot);
  MatrixXd step = MatrixXd::Zero(n, n - 1);
  for (Index j = 0; j < n - 1; ++j) {
    const Index kept = j < i ? j : j + 1;
    step(kept, j) = 1;
    step(i, j) = -s(kept) / s(i);
  }

  std::vector<int> left(static_cast<std::size_t>(elimination.constraint_matrix.rows()));
  std::iota(left.begin(), left.end(), 0);
  for (const int index : elimination.eliminated)
    left.erase(std::find(left.begin(), left.end(), index));
  elimination.eliminated.push_back(left[static_cast<std::size_t>(i)]);
  elimination.steps.push_back(step);
  elimination.constraint_matrix = elimination.constraint_matrix * step;
  return step;
}

/// S* x = (S' M S)^-1 S' M x, where reduced_mass = S' M S.
MatrixXd pseudo_inverse_times(const MatrixXd& S, const MatrixXd& mass, const MatrixXd& reduced_mass,
                              const MatrixXd& x) {
  if (x.cols() == 0) return MatrixXd(S.cols(), 0);
  return reduced_mass.llt().solve(S.transpose() * (mass * x));
}

}  // namespace

RigidBodyElimination eliminate_zero_modes(const System<>& system, const ZeroModes<>& zero_modes,
                                          Pivot pivot) {
  check(system, zero_modes);
  RigidBodyElimination elimination = nothing_removed(system);
  MatrixXd mass = system.mass;
  MatrixXd remaining = unsprung_directions(system, zero_modes);
  while (remaining.cols() > 0) {
    const MatrixXd step = append_step(mass, remaining.col(0), pivot, elimination);
    const MatrixXd reduced_mass = congruence(step, mass);
    remaining =
        pseudo_inverse_times(step, mass, reduced_mass, remaining.rightCols(remaining.cols() - 1));
    mass = reduced_mass;
  }
  elimination.mass = congruence(elimination.constraint_matrix, system.mass);
  elimination.damping = congruence(elimination.constraint_matrix, system.damping);
  elimination.stiffness = congruence(elimination.constraint_matrix, system.stiffness);
  return elimination;
}

}  // namespace dashpot::analysis
