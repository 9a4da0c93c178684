#include <dashpot/controller/audit/stated_gains.hpp>
#include <dashpot/controller/default_settings.hpp>

#include <Eigen/Eigenvalues>
#include <cmath>
#include <stdexcept>

namespace dashpot::controller {
namespace {

using Eigen::Index;
using Eigen::MatrixXd;

/// Returns the symmetric part of a gain matrix, which may be empty, after checking it.
MatrixXd checked_matrix(const std::string& name, const MatrixXd& given, Index n) {
  if (given.size() == 0) return MatrixXd::Zero(n, n);
  require(given.rows() == n && given.cols() == n,
          name + ": is " + std::to_string(given.rows()) + " x " + std::to_string(given.cols()) +
              ", expected " + std::to_string(n) + " x " + std::to_string(n));
  require(given.allFinite(), name + ": has an entry that is not a finite number");
  require((given - given.transpose()).cwiseAbs().maxCoeff() <= 1e-10 * given.cwiseAbs().maxCoeff(),
          name + ": is not symmetric");
  return 0.5 * (given + given.transpose());
}

JointVector checked_vector(const std::string& name, const JointVector& given, Index n) {
  if (given.size() == 0) return JointVector::Zero(n);
  require(given.size() == n, name + ": has " + std::to_string(given.size()) +
                                 " entries, expected " + std::to_string(n));
  require(given.allFinite(), name + ": has an entry that is not a finite number");
  return given;
}

/// Throws unless A = diag(a I, b I).
void require_two_numbers(const std::string& name, const Matrix6& A) {
  Vector6 diagonal;
  diagonal << A(0, 0), A(0, 0), A(0, 0), A(3, 3), A(3, 3), A(3, 3);
  require(A == Matrix6(diagonal.asDiagonal()),
          name + ": needs one number for translation and one for rotation with inertia_blocks");
}

}  // namespace

void require(bool condition, const std::string& message) {
  if (!condition) throw std::invalid_argument(message);
}

int checked_rank(const std::string& name, const MatrixXd& stiffness) {
  const Eigen::SelfAdjointEigenSolver<MatrixXd> solver(stiffness, Eigen::EigenvaluesOnly);
  const double rounding = 1e-12 * solver.eigenvalues().cwiseAbs().maxCoeff();
  require(solver.eigenvalues().minCoeff() >= -rounding, name + ": is not positive semidefinite");
  return static_cast<int>((solver.eigenvalues().array() > rounding).count());
}

Impedance stated_impedance(const AuditOptions& stated, int n) {
  const Gains& gains = stated.gains;
  Setpoint setpoint;
  setpoint.mode = stated.mode;
  setpoint.gains = gains;
  Gains& checked = setpoint.gains;
  checked.joint_damping_ratio = checked.task_damping_ratio = checked.null_damping_ratio = 0;
  checked.joint_stiffness = checked_matrix("joint_stiffness", gains.joint_stiffness, n);
  checked.joint_damping = checked_matrix("joint_damping", gains.joint_damping, n);
  checked.task_stiffness = checked_matrix("task_stiffness", gains.task_stiffness, 6);
  checked.task_damping = checked_matrix("task_damping", gains.task_damping, 6);
  checked.null_stiffness = checked_vector("null_stiffness", gains.null_stiffness, n);
  checked.null_damping = checked_vector("null_damping", gains.null_damping, n);
  require(checked.null_stiffness.minCoeff() >= 0, "null_stiffness: has a negative entry");
  if (stated.inertia_blocks) {
    require_two_numbers("task_stiffness", checked.task_stiffness);
    require_two_numbers("task_damping", checked.task_damping);
  }
  if (stated.half_quaternion) {
    const Vector6 share = (Vector6() << 1, 1, 1, 0.5, 0.5, 0.5).finished();
    const Vector6 root = share.cwiseSqrt();  // both sides of a K with coupling
    checked.task_stiffness = root.asDiagonal() * checked.task_stiffness * root.asDiagonal();
  }
  for (Index i = 0; i < 6; ++i) {
    checked.directions[static_cast<std::size_t>(i)] =
        !checked.task_stiffness.row(i).isZero(0) || !checked.task_damping.row(i).isZero(0);
  }
  return Impedance(setpoint, n);
}

AuditOptions audit_options(const Settings& settings) {
  AuditOptions options;
  static_cast<LoopTiming&>(options) = timing_of(settings);
  options.mode = settings.initial.mode;
  options.gains = settings.initial.gains;
  for (Index i = 0; i < 6; ++i) {
    if (options.gains.directions[static_cast<std::size_t>(i)]) continue;
    for (Matrix6* gain : {&options.gains.task_stiffness, &options.gains.task_damping}) {
      gain->row(i).setZero();
      gain->col(i).setZero();
    }
  }
  options.margin = settings.limits.gain_margin;
  options.null_weights = settings.null_weights;
  options.lower = settings.limits.position_lower;
  options.upper = settings.limits.position_upper;
  options.settings = settings;
  return options;
}

std::optional<Settings> designing_settings(const RobotModel& model, const AuditOptions& options) {
  if (options.settings) return options.settings;
  const Gains& gains = options.gains;
  const bool any = options.mode == Mode::kJoint
                       ? gains.joint_damping_ratio > 0
                       : gains.task_damping_ratio > 0 || gains.null_damping_ratio > 0;
  if (!any) return std::nullopt;
  require(!options.inertia_blocks && !options.half_quaternion,
          "damping_ratio: only Dashpot's own law designs damping, with rotation vectors and gains "
          "that are not multiplied by inertia");
  Settings settings = default_settings(model);
  set_timing(options, settings);
  settings.limits.gain_margin = options.period > 0 ? options.margin : 1;
  settings.null_weights = options.null_weights;
  settings.initial.gains = gains;
  Gains& stated = settings.initial.gains;
  for (JointMatrix* matrix : {&stated.joint_stiffness, &stated.joint_damping}) {
    if (matrix->size() == 0) matrix->setZero(model.dof(), model.dof());
  }
  return settings;
}

}  // namespace dashpot::controller
