#pragma once
// Settings for tests that want to know the damping, in place of one that is designed at every tick.

#include <dashpot/controller/default_settings.hpp>
#include <dashpot/controller/model/least_inertia.hpp>

#include <algorithm>
#include <numbers>

namespace dashpot::testing {

/// The default settings with constant damping, which suits the middle of the workspace, and springs
/// at the tip that suit it: velocities there decay no faster than 200 1/s.
inline controller::Settings constant_damping(const controller::RobotModel& model) {
  constexpr double kRate = 1.4 / (3 * std::numbers::pi);  // ratio 0.7 at 1.5 Hz, s
  controller::Settings settings = controller::default_settings(model);
  controller::Gains& gains = settings.initial.gains;
  const controller::TipInertia least = controller::least_tip_inertia(
      model, settings.limits.position_lower, settings.limits.position_upper);
  const double linear = std::min(40.0, 200 * least.linear);
  const double angular = std::min(2.0, 200 * least.angular);
  gains.joint_damping_ratio = gains.task_damping_ratio = gains.null_damping_ratio = 0;
  gains.joint_damping = kRate * gains.joint_stiffness;
  gains.task_damping.diagonal() << linear, linear, linear, angular, angular, angular;
  gains.task_stiffness = 10 * gains.task_damping;
  gains.null_damping = 2 * kRate * gains.null_stiffness;
  return settings;
}

}  // namespace dashpot::testing
