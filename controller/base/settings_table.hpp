#pragma once
#include <dashpot/controller/settings.hpp>
#include <dashpot/text/range.hpp>

#include <limits>

namespace dashpot::controller {

/// One setting: its key in a configuration file, its unit, and what it may be.
struct Setting {
  const char* key;
  const char* unit = "";
  const char* prismatic =
      "";  ///< unit of the entry of a prismatic joint, or of a rotation of the tip
  text::Range range = text::kAnyNumber;
  double none =
      std::numeric_limits<double>::quiet_NaN();  ///< infinity that the word none stands for
};

/// Calls visit(setting, member) for every setting but the gains and the walls. `Struct` is
/// Settings or const Settings. Members are double, int, bool, JointVector (n entries), Vector6 (of
/// the tip), Mode, Load, NullProjector, Energy::From, Analysis::Where and FeedForward::FrictionAt.
template <class Struct, class Visitor>
void for_each_setting(Struct& settings, Visitor&& visit) {
  constexpr double kInfinity = std::numeric_limits<double>::infinity();
  visit(Setting{"control.period", "s", "", text::kPositive}, settings.period);
  visit(Setting{"control.mode"}, settings.initial.mode);
  visit(Setting{"control.load"}, settings.task_terms.load);
  visit(Setting{"control.null_projector"}, settings.initial.gains.null_projector);
  visit(Setting{"control.null_weights", "", "", {1e-3, true, 1e3}}, settings.null_weights);
  visit(Setting{"control.energy"}, settings.energy.from);
  visit(Setting{"control.energy_store", "J", "", text::kPositive}, settings.energy.store);
  visit(Setting{"control.jacobian_rate"}, settings.task_terms.jacobian_rate);
  visit(Setting{"control.subtract_friction"}, settings.subtract_friction);

  auto& environment = settings.environment;
  visit(Setting{"environment.tip_stiffness", "N/m", "N m/rad", text::kNotNegative},
        environment.tip_stiffness);
  visit(Setting{"environment.tip_damping", "N s/m", "N m s/rad", text::kNotNegative},
        environment.tip_damping);
  visit(Setting{"environment.joint_stiffness", "N m/rad", "N/m", text::kNotNegative},
        environment.joint_stiffness);
  visit(Setting{"environment.joint_damping", "N m s/rad", "N s/m", text::kNotNegative},
        environment.joint_damping);

  auto& limits = settings.limits;
  visit(Setting{"limits.torque", "N m", "N", text::kPositive}, limits.torque);
  visit(Setting{"limits.torque_rate", "N m/s", "N/s", text::kPositive}, limits.torque_rate);
  visit(Setting{"limits.velocity", "rad/s", "m/s", text::kPositive}, limits.velocity);
  visit(Setting{"limits.tip_velocity", "m/s", "", text::kPositive}, limits.tip_velocity);
  visit(Setting{"limits.position_lower", "rad", "m", text::kAnyNumber, -kInfinity},
        limits.position_lower);
  visit(Setting{"limits.position_upper", "rad", "m", text::kAnyNumber, kInfinity},
        limits.position_upper);
  visit(Setting{"limits.stopping_time", "s", "", text::kPositive}, limits.stopping_time);
  visit(Setting{"limits.linear_error", "m", "", text::kPositive}, limits.linear_error);
  visit(Setting{"limits.angular_error", "rad", "", text::kPositive}, limits.angular_error);
  visit(Setting{"limits.power", "W", "", text::kPositive, kInfinity}, limits.power);
  visit(Setting{"limits.external_torque", "N m", "N", text::kPositive, kInfinity},
        limits.external_torque);
  visit(Setting{"limits.external_force", "N", "", text::kPositive, kInfinity},
        limits.external_force);
  visit(Setting{"limits.gain_margin", "", "", {1, true, 1000}}, limits.gain_margin);
  visit(Setting{"limits.beyond_model"}, limits.beyond_model);

  auto& motion = settings.motion;
  visit(Setting{"motion.velocity", "rad/s", "m/s", text::kPositive}, motion.velocity);
  visit(Setting{"motion.acceleration", "rad/s^2", "m/s^2", text::kPositive}, motion.acceleration);
  visit(Setting{"motion.linear_velocity", "m/s", "", text::kPositive}, motion.linear_velocity);
  visit(Setting{"motion.linear_acceleration", "m/s^2", "", text::kPositive},
        motion.linear_acceleration);
  visit(Setting{"motion.angular_velocity", "rad/s", "", text::kPositive}, motion.angular_velocity);
  visit(Setting{"motion.angular_acceleration", "rad/s^2", "", text::kPositive},
        motion.angular_acceleration);
  visit(Setting{"motion.smoothing", "s", "", text::kNotNegative}, motion.smoothing);
  visit(Setting{"motion.gain_time", "s", "", text::kPositive}, motion.gain_time);

  auto& feed_forward = settings.feed_forward;
  visit(Setting{"feed_forward.gravity"}, feed_forward.gravity);
  visit(Setting{"feed_forward.coriolis"}, feed_forward.coriolis);
  visit(Setting{"feed_forward.friction"}, feed_forward.friction);
  visit(Setting{"feed_forward.friction_at"}, feed_forward.friction_at);
  visit(Setting{"feed_forward.friction_share", "", "", {0, true, 1}}, feed_forward.friction_share);
  visit(Setting{"feed_forward.friction_rise", "rad/s", "", text::kPositive},
        feed_forward.friction_rise);
  visit(Setting{"feed_forward.acceleration"}, feed_forward.acceleration);
  visit(Setting{"feed_forward.wrench"}, feed_forward.wrench);

  auto& integral = settings.integral;
  visit(Setting{"integral.time", "s", "", text::kNotNegative}, integral.time);
  visit(Setting{"integral.force", "N", "", text::kNotNegative}, integral.force);
  visit(Setting{"integral.moment", "N m", "", text::kNotNegative}, integral.moment);
  visit(Setting{"integral.torque", "N m", "N", text::kNotNegative}, integral.torque);

  auto& watchdog = settings.watchdog;
  visit(Setting{"watchdog.setpoint_hold", "s", "", text::kNotNegative}, watchdog.setpoint_hold);
  visit(Setting{"watchdog.setpoint_damp", "s", "", text::kNotNegative}, watchdog.setpoint_damp);
  visit(Setting{"watchdog.longest_gap", "s", "", text::kPositive}, watchdog.longest_gap);
  visit(Setting{"watchdog.feedback", "s", "", text::kNotNegative}, watchdog.feedback);
  visit(Setting{"watchdog.start_torque", "", "", text::kPositive, kInfinity},
        watchdog.start_torque);
  visit(Setting{"watchdog.release_after", "s", "", text::kNotNegative}, watchdog.release_after);

  auto& analysis = settings.analysis;
  visit(Setting{"analysis.where"}, analysis.where);
  visit(Setting{"analysis.every", "ticks", "", {1}}, analysis.every);
  visit(Setting{"analysis.share", "", "", {0, false, 1}}, analysis.share);
  visit(Setting{"analysis.soft_frequency", "rad/s", "", text::kNotNegative},
        analysis.soft_frequency);
  visit(Setting{"analysis.shapes"}, analysis.shapes);
  visit(Setting{"analysis.sampled.interval", "s", "", text::kNotNegative},
        analysis.sampled.interval);
  visit(Setting{"analysis.sampled.delay", "ticks", "", {0, true, Analysis::Sampled::kMostDelay}},
        analysis.sampled.delay);
  visit(Setting{"analysis.sampled.cutoff", "Hz", "", text::kNotNegative}, analysis.sampled.cutoff);
  visit(Setting{"analysis.sampled.difference_velocity"}, analysis.sampled.difference_velocity);
}

}  // namespace dashpot::controller
