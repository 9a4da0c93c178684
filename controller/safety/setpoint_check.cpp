#include <dashpot/controller/base/orientation.hpp>
#include <dashpot/controller/setpoint_check.hpp>

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstring>

namespace dashpot::controller {
namespace {

constexpr double kLargestGain = 1e9;

/// Almost always the bits are equal, which takes a tenth of the time of a comparison of numbers.
template <class Matrix>
bool same(const Matrix& a, const Matrix& b) noexcept {
  if (a.rows() != b.rows() || a.cols() != b.cols()) return false;
  const auto bytes = static_cast<std::size_t>(a.size()) * sizeof(double);
  return std::memcmp(a.data(), b.data(), bytes) == 0 || a == b;
}

/// Whether A + slack I has a Cholesky factor.
template <class Matrix>
bool positive_semidefinite(Matrix A, double slack) noexcept {
  for (Eigen::Index k = 0; k < A.rows(); ++k) {
    const double pivot = A(k, k) + slack;
    if (!(pivot > 0)) return false;
    for (Eigen::Index j = k + 1; j < A.rows(); ++j) {
      const double factor = A(j, k) / pivot;
      for (Eigen::Index i = j; i < A.rows(); ++i) A(i, j) -= factor * A(i, k);
    }
  }
  return true;
}

/// Returns the reason why `A` is not an n x n stiffness or damping, or null.
template <class Matrix>
const char* matrix_fault(const Matrix& A, Eigen::Index n) noexcept {
  if (A.rows() != n || A.cols() != n) return "is not n x n for the robot's n joints";
  if (!A.allFinite()) return "has an entry that is not finite";
  const double largest = A.cwiseAbs().maxCoeff();
  if (largest > kLargestGain) return "has an entry above 1e9";
  for (Eigen::Index j = 0; j < n; ++j) {
    for (Eigen::Index i = 0; i < j; ++i) {
      if (std::abs(A(i, j) - A(j, i)) > 1e-9 * largest) return "is not symmetric";
    }
  }
  if (largest > 0 && !positive_semidefinite(A, 1e-10 * largest)) {
    return "is not positive semidefinite";
  }
  return nullptr;
}

const char* vector_fault(const JointVector& v, Eigen::Index n) noexcept {
  if (v.size() == 0) return nullptr;
  if (v.size() != n) return "has not as many entries as the robot has joints";
  if (!v.allFinite()) return "has an entry that is not finite";
  if (v.minCoeff() < 0) return "has a negative entry";
  if (v.maxCoeff() > kLargestGain) return "has an entry above 1e9";
  return nullptr;
}

const char* position_fault(const JointVector& q, const Limits& limits) noexcept {
  if (q.size() != limits.torque.size()) return "has not as many entries as the robot has joints";
  if (!q.allFinite()) return "has an entry that is not finite";
  if ((q.array() < limits.position_lower.array()).any()) return "is below a position limit";
  if ((q.array() > limits.position_upper.array()).any()) return "is above a position limit";
  if (q.cwiseAbs().maxCoeff() > 1e6) return "has an entry beyond 1e6";
  return nullptr;
}

constexpr const char* kNoRatio = "is not between 0 and 2";

bool is_ratio(double ratio) noexcept {
  return ratio >= 0 && ratio <= kLargestDampingRatio;
}

}  // namespace

SetpointFault check_gains(const Gains& gains, Mode mode, Eigen::Index n) noexcept {
  const char* reason = nullptr;
  if (mode == Mode::kJoint) {
    if ((reason = matrix_fault(gains.joint_stiffness, n))) return {"joint_stiffness", reason};
    if ((reason = matrix_fault(gains.joint_damping, n))) return {"joint_damping", reason};
    if (!is_ratio(gains.joint_damping_ratio)) return {"joint_damping_ratio", kNoRatio};
    return {};
  }
  if ((reason = matrix_fault(gains.task_stiffness, 6))) return {"task_stiffness", reason};
  if ((reason = matrix_fault(gains.task_damping, 6))) return {"task_damping", reason};
  if (!is_ratio(gains.task_damping_ratio)) return {"task_damping_ratio", kNoRatio};
  if ((reason = vector_fault(gains.null_stiffness, n))) return {"null_stiffness", reason};
  if ((reason = vector_fault(gains.null_damping, n))) return {"null_damping", reason};
  if (!is_ratio(gains.null_damping_ratio)) return {"null_damping_ratio", kNoRatio};
  if (static_cast<std::size_t>(gains.null_projector) >= kNullProjectors.size()) {
    return {"null_projector", "is unknown"};
  }
  if (gains.frame != Frame::kBase && gains.frame != Frame::kTool) return {"frame", "is unknown"};
  return {};
}

SetpointFault check_setpoint(const Setpoint& setpoint, const Limits& limits,
                             bool known_gains) noexcept {
  if (setpoint.mode != Mode::kJoint && setpoint.mode != Mode::kCartesian) {
    return {"mode", "is unknown"};
  }
  if (!setpoint.wrench.allFinite() || setpoint.wrench.cwiseAbs().maxCoeff() > kLargestGain) {
    return {"wrench", "is not finite, or above 1e9"};
  }
  const bool cartesian = setpoint.mode == Mode::kCartesian;
  if (!cartesian || setpoint.joint_position.size() > 0) {
    const char* reason = position_fault(setpoint.joint_position, limits);
    if (reason != nullptr) return {"joint_position", reason};
  }
  if (cartesian) {
    if (!(setpoint.tip_pose.position.cwiseAbs().maxCoeff<Eigen::PropagateNaN>() <= 1e6)) {
      return {"tip_pose.position", "is not set, not finite, or beyond 1e6 m"};
    }
    if (!(rotation_defect(setpoint.tip_pose.rotation) <= 1e-6)) {
      return {"tip_pose.rotation", "is not a rotation matrix"};
    }
    for (const Wall& wall : limits.walls) {
      if (wall.distance(setpoint.tip_pose.position) < 0) {
        return {"tip_pose.position", "is beyond a wall"};
      }
    }
  }
  if (known_gains) return {};
  return check_gains(setpoint.gains, setpoint.mode, limits.torque.size());
}

bool same_gains(const Gains& a, const Gains& b, Mode mode) noexcept {
  if (mode == Mode::kJoint) {
    return same(a.joint_stiffness, b.joint_stiffness) && same(a.joint_damping, b.joint_damping) &&
           a.joint_damping_ratio == b.joint_damping_ratio;
  }
  return a.frame == b.frame && a.directions == b.directions &&
         same(a.task_stiffness, b.task_stiffness) && same(a.task_damping, b.task_damping) &&
         a.task_damping_ratio == b.task_damping_ratio && same(a.null_stiffness, b.null_stiffness) &&
         same(a.null_damping, b.null_damping) && a.null_damping_ratio == b.null_damping_ratio &&
         a.null_projector == b.null_projector;
}

}  // namespace dashpot::controller
