#include <dashpot/controller/base/joint_algebra.hpp>
#include <dashpot/controller/safety/brake_doubt.hpp>

#include <algorithm>
#include <cmath>

namespace dashpot::controller {

bool BrakeDoubt::grows(double dt, const DynamicsResult& robot, const JointVector& qd) noexcept {
  constexpr double kMemory = 0.5;  // s, ten times as long as the brake needs
  constexpr double kPushed = 0.5;  // of a velocity limit
  constexpr double kLeast = 1;     // rad/s (m/s): somebody pushes as fast, however low the limit
  JointVector momentum = JointVector::Zero(qd.size());
  add_product(robot.M, qd, momentum);
  const double energy = 0.5 * product(momentum, qd);
  double pushed = 0, power = 0;
  for (Eigen::Index i = 0; i < qd.size(); ++i) {
    const double v = std::max(kPushed * velocity_[i], kLeast);
    pushed += 0.5 * robot.M(i, i) * v * v;
    power += std::abs(robot.gravity[i] * qd[i]);
  }
  if (least_ < 0 || energy < least_) {
    least_ = energy;
    given_ = 0;
  }
  given_ = given_ * std::max(0.0, 1 - dt / kMemory) + power * dt;
  return energy > least_ + given_ + pushed;
}

}  // namespace dashpot::controller
