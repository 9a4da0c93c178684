#pragma once
#include <dashpot/controller/dynamics.hpp>

namespace dashpot::controller {

/// The last good state, and the robot there.
struct Sensed {
  bool any = false;                           ///< there was one since the last reset
  std::int64_t time = 0;                      ///< ns
  double dt = 0;                              ///< since the one before, at least a period, s
  JointVector q, qd;                          ///< n
  Vector6 external_wrench = Vector6::Zero();  ///< the last finite one
  DynamicsResult robot;
  JointVector weight;  ///< the gravity torque that Dashpot compensates, n, N m
};

}  // namespace dashpot::controller
