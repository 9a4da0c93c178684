#pragma once
#include <dashpot/controller/robot_model.hpp>
#include <dashpot/controller/settings.hpp>

#include <stdexcept>
#include <string>
#include <utility>
#include <vector>

namespace dashpot::controller {

/// Thrown at set-up; `key` is the setting's key in a configuration file, such as "limits.torque",
/// or for gains the member, such as "initial.gains.task_stiffness".
class InvalidSettings : public std::invalid_argument {
 public:
  InvalidSettings(std::string key, const std::string& reason)
      : std::invalid_argument(key + ": " + reason), key_(std::move(key)) {}
  const std::string& key() const noexcept { return key_; }

 private:
  std::string key_;
};

/// Throws InvalidSettings, with key, value and unit, unless all sizes are n, all numbers are finite
/// and in their ranges, and all gains are symmetric positive semidefinite. Without
/// Limits::beyond_model it also refuses limits of torque, velocity and position beyond the model's,
/// speeds and errors of the tip beyond what its joints and links allow, and times that are hardly
/// in seconds; what it says names the likely unit.
void validate(const Settings& settings, const RobotModel& model);

/// Returns lines that ask about gains: whether the rotations of the task's stiffness or damping
/// stand first, if a tip on a lever of twice the arm's reach would turn harder than it moves; and
/// whether a damping holds ratios, if no number is above 2 and the largest, at the tip against
/// translation, leaves a mass or an inertia of 1 a ratio below 0.1. Ignores joints that turn with
/// less than 100 N m/rad.
std::vector<std::string> doubtful_gains(const RobotModel& model, const Gains& gains);
/// Asks the same about an arm of known reach, m; without `joints` all joints are taken to turn.
std::vector<std::string> doubtful_gains(double reach, const Gains& gains,
                                        const std::vector<Joint>& joints = {});
/// The one of these lines that asks whether a task's stiffness is in N/mm; empty: there is none.
std::string soft_stiffness(const Gains& gains);

/// How the brake stops an arm that is as its model: each joint alone from 0.9 of its velocity
/// limit, with the mass matrix and weight of one posture, rigid gears, and no friction.
struct Stopping {
  JointVector time;  ///< n, s, until no joint is faster than a tenth of that; at most 2 s
  JointVector way;   ///< n, rad, m for prismatic joints, that the joint goes in this time
};

/// Computes this at q (n, rad), with the limits, period and delay of `settings`. Takes about a
/// millisecond a joint.
Stopping stopping(const RobotModel& model, const Settings& settings, const JointVector& q);

/// One line that names the joint that stops last, if that takes more than 0.25 s and more than
/// half as long again as with faster torques, and a limits.torque_rate that would do; empty if
/// none does.
std::string slow_stop(const RobotModel& model, const Settings& settings, const JointVector& q);

}  // namespace dashpot::controller
