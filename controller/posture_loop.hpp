#pragma once
#include <dashpot/controller/controller.hpp>
#include <dashpot/controller/dynamics.hpp>

namespace dashpot::controller {

/// The closed loop that gains make at any posture, with the robot at rest there, without a loop
/// that runs: the matrices that Controller::closed_loop gives once the gains are in force.
///
/// Not for the real-time thread: each call takes three ticks of a controller of its own.
class PostureLoop {
 public:
  /// Copies the model. The settings have to be valid. Position limits, walls and `analysis` are not
  /// looked at.
  PostureLoop(const RobotModel& model, const Settings& settings);

  /// Attaches something else to the tip link.
  void attach(const Attachment& attachment) noexcept {
    kernel_.attach(attachment);
    controller_.attach(attachment);
  }
  /// Sets `system` to M q'' + C q' + K q = f at the posture `q` (n, rad), in joint coordinates:
  /// mass, damping, stiffness and its factor, as Controller::closed_loop. The gains must have
  /// passed check_gains in this mode. The springs hold `external_wrench` (6, in B's axes, N and N
  /// m) there, which matters with TaskTerms::load only. Returns kOk, or the status of a controller
  /// that cannot be there, and then leaves `system` as it is.
  Status closed_loop(const JointVector& q, const Gains& gains, Mode mode,
                     analysis::System<kMaxJoints>& system,
                     const Vector6& external_wrench = Vector6::Zero());

 private:
  DynamicsKernel kernel_;
  Controller controller_;  ///< takes gains at once, at any posture
  std::int64_t time_ = 0;  ///< ns
};

}  // namespace dashpot::controller
