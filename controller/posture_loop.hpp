#pragma once
#include <dashpot/analysis/system.hpp>
#include <dashpot/controller/elastic_joints.hpp>
#include <dashpot/controller/law/designed_damping.hpp>
#include <dashpot/controller/settings.hpp>
#include <dashpot/controller/tick_status.hpp>

namespace dashpot::controller {

/// The closed loop that gains make at any posture, with the robot at rest there, without a loop
/// that runs: the matrices that Controller::closed_loop gives once the gains are in force.
class PostureLoop {
 public:
  /// Copies the model. The settings have to be valid. Limits, but the gain margin, and `analysis`,
  /// but the sampled loop's delays, are not looked at.
  PostureLoop(const RobotModel& model, const Settings& settings);

  /// Attaches something else to the tip link.
  void attach(const Attachment& attachment) noexcept { kernel_.attach(attachment); }
  /// Sets `system` to M q'' + C q' + K q = f at the posture `q` (n, rad), in joint coordinates, or
  /// those of analysis::Gears: mass, damping, stiffness and its factor, as Controller::closed_loop.
  /// The gains must have passed check_gains in this mode. The springs hold `external_wrench` (6, in
  /// B's axes, N and N m) there, which matters with TaskTerms::load only. Returns kOk, or, if q or
  /// the wrench are no state, kStateWrongSize, kStateNotFinite or kWrenchNotFinite, and then leaves
  /// `system` as it is.
  Status closed_loop(const JointVector& q, const Gains& gains, Mode mode,
                     analysis::System<kMaxJoints>& system,
                     const Vector6& external_wrench = Vector6::Zero());
  /// Returns what the sampled loop leaves of the ratios of the last closed_loop.
  const analysis::DampingLevel& level() const noexcept { return level_; }

 private:
  DynamicsKernel kernel_;
  analysis::Gears elastic_;
  Settings settings_;
  JointVector friction_left_;
  DesignedDamping damping_;
  analysis::DampingLevel level_;
};

}  // namespace dashpot::controller
