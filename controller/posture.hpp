#pragma once
#include <dashpot/controller/robot_model.hpp>
#include <dashpot/controller/settings.hpp>

#include <cstdint>
#include <string>

namespace dashpot::controller {

/// Postures spread evenly between the limits of all joints at once, at most half a turn each way,
/// by the sequence of Roberts (2018): joint i advances by phi^-(i + 1) of its range, with
/// phi^(n + 1) = phi + 1. One step for all joints would keep the postures on a curve.
class PostureSequence {
 public:
  /// `lower` and `upper` have n entries, rad; they may be infinite. Another seed moves all postures
  /// by one offset, around the ends of the range; seed 0 does not move them.
  PostureSequence(const JointVector& lower, const JointVector& upper, std::uint64_t seed = 0);

  /// Returns posture `index`, from 0; n, rad.
  JointVector at(std::int64_t index) const;

 private:
  JointVector lower_, upper_, step_;
  JointVector offset_;  ///< in [0, 1)
};

/// The posture of an arm for which none is given: the middle of each joint's position limits, and 0
/// for a joint without limits. If that is singular, it is the regular posture nearest to it of 256
/// spread over the limits.
JointVector default_posture(const RobotModel& model);

/// Names the directions in which the tip hardly moves at q (n, rad). They belong to the singular
/// values of J below 2 % of the largest, and each is named by its largest parts: "z", "y + 0.40
/// rx". Empty if the posture is regular: an arm of fewer than six joints then has n singular values
/// above that.
std::string lost_directions(const RobotModel& model, const JointVector& q);

/// One line that names the joint that needs most of its effort limit to hold the arm and its
/// payload at q (n, rad) and cannot; empty if all can.
std::string too_heavy(const RobotModel& model, const JointVector& q);

/// One line that names the first joint more than `tolerance` (rad or m) outside its position
/// limits, and says so if q (n, rad) fits in degrees; empty if q is inside.
std::string outside_limits(const RobotModel& model, const JointVector& q, double tolerance = 1e-3);

/// One line that says why an arm cannot be at rest at q (n, rad): a joint is 0.1 rad (0.1 m) or
/// more beyond the limits of the model, or, if the model has none, a turn beyond the limits of the
/// settings; `weight` (n, N m), which the controller is to compensate, is beyond a torque limit; or
/// the acting `torque` (n, N m, no entries if unknown) contradicts the weight by more than 5 % of a
/// torque limit, Coulomb friction, and Watchdog::start_torque. Empty if the arm may be there.
std::string start_fault(const RobotModel& model, const Settings& settings, const JointVector& q,
                        const JointVector& torque, const JointVector& weight);

}  // namespace dashpot::controller
