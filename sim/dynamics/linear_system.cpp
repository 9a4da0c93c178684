#include <dashpot/sim/linear_system.hpp>

#include <Eigen/Cholesky>
#include <cmath>
#include <limits>
#include <sstream>
#include <string>

namespace dashpot::sim {
namespace {

using Eigen::MatrixXd;

void require_square(const MatrixXd& A, Eigen::Index n, const char* key) {
  if (A.rows() == n && A.cols() == n) {
    if (!A.allFinite()) throw InvalidScene(key, "has an entry that is not finite");
    return;
  }
  std::ostringstream text;
  text << "is " << A.rows() << " x " << A.cols() << ", must be " << n << " x " << n;
  throw InvalidScene(key, text.str());
}

void require_symmetric(const MatrixXd& A, const char* key) {
  for (Eigen::Index i = 0; i < A.rows(); ++i) {
    for (Eigen::Index j = 0; j < i; ++j) {
      if (std::abs(A(i, j) - A(j, i)) <= 1e-9 * (std::abs(A(i, j)) + std::abs(A(j, i)))) continue;
      std::ostringstream text;
      text << "is not symmetric: entry (" << j + 1 << "," << i + 1 << ") is " << A(j, i)
           << ", entry (" << i + 1 << "," << j + 1 << ") is " << A(i, j);
      throw InvalidScene(key, text.str());
    }
  }
}

/// The number of coordinates, after all checks.
int checked_dof(const MatrixXd& M, const MatrixXd& C, const MatrixXd& K,
                const std::vector<Piece<JointVector>>& forces) {
  const Eigen::Index n = M.rows();
  if (n < 1 || n > kMaxJoints) {
    throw InvalidScene(
        "mass", "has " + std::to_string(n) + " rows, must have 1 to " + std::to_string(kMaxJoints));
  }
  require_square(M, n, "mass");
  require_square(C, n, "damping");
  require_square(K, n, "stiffness");
  require_symmetric(M, "mass");
  require_symmetric(K, "stiffness");
  if (M.llt().info() != Eigen::Success) throw InvalidScene("mass", "is not positive definite");
  for (const Piece<JointVector>& piece : forces) {
    if (piece.value.size() != n)
      throw InvalidScene("forces", "a piece has the wrong number of entries");
    if (!piece.value.allFinite()) throw InvalidScene("forces", "a piece is not finite");
    if (!(piece.begin < piece.end))
      throw InvalidScene("forces", "a piece does not begin before it ends");
  }
  return static_cast<int>(n);
}

}  // namespace

LinearSystem::LinearSystem(const MatrixXd& mass, const MatrixXd& damping, const MatrixXd& stiffness,
                           const std::vector<Piece<JointVector>>& forces)
    : System(checked_dof(mass, damping, stiffness, forces)),
      M_(mass),
      M_inv_(mass.llt().solve(MatrixXd::Identity(dof(), dof()))),
      C_(damping),
      K_(stiffness),
      forces_(forces, JointVector::Zero(dof())),
      force_(JointVector::Zero(dof())) {}

double LinearSystem::begin_segment(double t) noexcept {
  if (forces_.empty()) return std::numeric_limits<double>::infinity();
  force_ = forces_.at(t);
  return forces_.next_edge(t);
}

void LinearSystem::rates(const StateVector& y, StateVector& y_dot) noexcept {
  const Eigen::Index n = dof();
  const auto q = y.head(n);
  const auto qd = y.segment(n, n);
  const JointVector damping = C_.lazyProduct(qd);
  JointVector rest = torque() - damping;
  rest -= K_.lazyProduct(q);
  auto work = y_dot.tail<kWorkChannels>();
  work.setZero();
  work[kByActuators] = torque().dot(qd);
  work[kViscousHeat] = damping.dot(qd);
  if (!forces_.empty()) {
    rest += force_;
    work[kByWorld] = force_.dot(qd);
  }
  y_dot.head(n) = qd;
  y_dot.segment(n, n) = M_inv_.lazyProduct(rest);
}

StoredEnergy LinearSystem::stored_energy(const StateVector& y) noexcept {
  const Eigen::Index n = dof();
  const JointVector q = y.head(n), qd = y.segment(n, n);
  return {0.5 * qd.dot(M_.lazyProduct(qd)), 0, 0.5 * q.dot(K_.lazyProduct(q))};
}

}  // namespace dashpot::sim
