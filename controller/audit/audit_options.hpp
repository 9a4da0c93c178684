#pragma once
#include <dashpot/controller/base/impedance.hpp>
#include <dashpot/controller/posture_loop.hpp>

#include <optional>

namespace dashpot::controller {

/// The gains of a controller and the loop that they act in, as its documentation states them.
/// Without a period no gain margin is computed, and in it alone an integral counts.
struct AuditOptions : LoopTiming {
  Mode mode = Mode::kCartesian;  ///< which of the gains act
  /// Stiffness and damping as stated. `directions` in it is ignored: a direction of the task
  /// without stiffness and damping is free. Joint matrices and null-space vectors without entries
  /// count as zero. With a ratio the damping is designed at each posture as Controller does,
  /// lowered so that the loop keeps `margin`. Many controllers have NullProjector::kKinematic.
  Gains gains;
  /// True if the controller takes the vector part of the error's quaternion, which is half of the
  /// rotation vector, for its rotational error. The springs then act with half of the stated
  /// rotational stiffness; the dampers act as stated.
  bool half_quaternion = false;
  /// True for operational-space controllers that multiply gains by the tip's inertia, for
  /// translation and rotation apart: the wrench is blkdiag(L_v, L_w) (K_C e + C_C v) with
  /// L_v = (J_v M^-1 J_v')^-1, L_w likewise. Stiffness is then in 1/s^2, damping in 1/s, and each
  /// has one number for the three translations and one for the three rotations.
  bool inertia_blocks = false;
  double margin = 2;  ///< gain margin that is asked for, see PostureAudit::rotors; at least 1
  JointVector null_weights;  ///< W of NullProjector::kWeighted, n, positive; without entries I
  double soft_frequency = kSoftFrequency;  ///< modes below this are called soft, rad/s
  /// Range of sampled postures, n, rad; without entries the position limits of the model.
  JointVector lower, upper;
  /// Settings of Dashpot's controller, whose loop it then is; the members above say the same.
  std::optional<Settings> settings = {};
};

/// Returns the gains, loop and range of a controller with these settings; a direction of the task
/// that is not selected has no gains.
AuditOptions audit_options(const Settings& settings);

}  // namespace dashpot::controller
