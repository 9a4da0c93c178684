#include <dashpot/controller/law/spring_integral.hpp>

#include <algorithm>
#include <cmath>

namespace dashpot::controller {
namespace {

/// Moves one part of the wrench, and keeps it within its bound.
void move(Eigen::Vector3d& stored, const Eigen::Vector3d& step, double bound,
          bool may_grow) noexcept {
  Eigen::Vector3d next = stored + step;
  const double size = next.norm(), before = stored.norm();
  if (!std::isfinite(size) || (!may_grow && size > before)) return;
  if (size > bound) next *= bound / size;
  stored = next;
}

}  // namespace

SpringIntegral::SpringIntegral(const Integral& settings, double period) noexcept
    : rate_(settings.time > 0 ? period / settings.time : 0),
      force_(settings.force),
      moment_(settings.moment),
      bound_(settings.torque),
      torque_(JointVector::Zero(settings.torque.size())) {}

void SpringIntegral::reset() noexcept {
  torque_.setZero();
  wrench_.setZero();
}

void SpringIntegral::step(const JointVector& joint_pull, const Vector6& tip_pull,
                          bool may_grow) noexcept {
  for (Eigen::Index i = 0; i < torque_.size(); ++i) {
    const double next = torque_[i] + rate_ * joint_pull[i];
    if (!std::isfinite(next) || (!may_grow && std::abs(next) > std::abs(torque_[i]))) continue;
    torque_[i] = std::clamp(next, -bound_[i], bound_[i]);
  }
  Eigen::Vector3d force = wrench_.head<3>(), moment = wrench_.tail<3>();
  move(force, rate_ * tip_pull.head<3>(), force_, may_grow);
  move(moment, rate_ * tip_pull.tail<3>(), moment_, may_grow);
  wrench_.head<3>() = force;
  wrench_.tail<3>() = moment;
}

void SpringIntegral::fade(double ticks) noexcept {
  const double share = 1 - 1 / std::max(1.0, ticks);
  for (Eigen::Index i = 0; i < torque_.size(); ++i) torque_[i] *= share;
  wrench_ *= share;
}

}  // namespace dashpot::controller
