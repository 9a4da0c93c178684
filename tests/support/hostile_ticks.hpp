#pragma once
// Input for a controller as it should never come: an arm that wanders about, and now and then
// states, clocks, set-points and gains that are broken in every way.

#include <dashpot/controller/controller.hpp>
#include <dashpot/controller/robot_model.hpp>

#include <Eigen/Geometry>
#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <limits>
#include <random>

namespace dashpot::testing {

class HostileTicks {
 public:
  using JointVector = controller::JointVector;

  /// `share`: of ticks with something broken.
  HostileTicks(const controller::RobotModel& model, const controller::Settings& settings,
               std::uint64_t seed, double share)
      : n_(model.dof()), settings_(settings), engine_(seed), share_(share) {
    state.position = settings.initial.joint_position;
    state.velocity = JointVector::Zero(n_);
    good_ = state;
    good_setpoint_ = setpoint = settings.initial;
    setpoint.tip_pose.position.setZero();
  }

  controller::RobotState state;
  controller::Setpoint setpoint;

  /// The next tick's input. Allocates nothing.
  void next() {
    wander();
    state = good_;
    if (chance(0.05)) change_setpoint();
    if (chance(0.0001)) silent_ = static_cast<int>(engine_() % 3000);  // the set-point ages
    if (--silent_ < 0) good_setpoint_.time = good_.time;
    setpoint = good_setpoint_;
    if (chance(share_)) spoil_state();
    if (chance(share_)) spoil_setpoint();
  }

  /// Whether a latched fault is to be released before this tick: often, so that springs come back.
  bool releases() { return chance(0.02); }

  /// Settings with every feature on.
  static controller::Settings everything_on(const controller::RobotModel& model) {
    controller::Settings settings = controller::default_settings(model);
    settings.feed_forward = {true, true, true, true, true};
    settings.analysis.where = controller::Analysis::Where::kInline;
    settings.analysis.every = 100;
    settings.analysis.share = 1;
    return settings;
  }

 private:
  double uniform(double low, double high) {
    return low + (high - low) * (static_cast<double>(engine_() >> 11) * 0x1p-53);
  }
  bool chance(double probability) { return uniform(0, 1) < probability; }
  Eigen::Index joint() {
    return static_cast<Eigen::Index>(engine_() % static_cast<std::uint64_t>(n_));
  }
  /// Not finite, or of any magnitude.
  double odd() {
    constexpr std::array<double, 8> kOdd = {std::numeric_limits<double>::quiet_NaN(),
                                            std::numeric_limits<double>::infinity(),
                                            -std::numeric_limits<double>::infinity(),
                                            1e308,
                                            -1e200,
                                            5e-324,
                                            0,
                                            -0.0};
    return chance(0.5) ? kOdd[engine_() % kOdd.size()]
                       : std::ldexp(uniform(-1, 1), static_cast<int>(uniform(-60, 60)));
  }

  /// Moves as an arm might, at times too fast or out of its range.
  void wander() {
    good_.time += 1'000'000;
    if (chance(0.0005)) wild_ = 200;
    --wild_;
    const double most = wild_ > 0 ? 1.1 : 0.5, room = wild_ > 0 ? -0.05 : 0.05;
    for (Eigen::Index i = 0; i < n_; ++i) {
      const double limit = settings_.limits.velocity[i];
      double &q = good_.position[i], &qd = good_.velocity[i];
      double push = uniform(-0.1, 0.1) - (wild_ > 0 ? 0 : 0.02) * qd / limit;
      if (q < std::max(settings_.limits.position_lower[i], -10.0) + room) push = 0.1;
      if (q > std::min(settings_.limits.position_upper[i], 10.0) - room) push = -0.1;
      const double slowest = std::min(-most, qd / limit + 0.1);  // brakes from wild to tame
      const double fastest = std::max(most, qd / limit - 0.1);
      qd = limit * std::clamp(qd / limit + push, slowest, fastest);
      q += 1e-3 * qd;
    }
    if (chance(0.01)) good_.external_wrench[static_cast<int>(engine_() % 6)] = uniform(-50, 50);
  }

  void change_setpoint() {
    controller::Setpoint& s = good_setpoint_;
    controller::Gains& gains = s.gains;
    const Eigen::Index i = joint();
    const auto what = engine_() % 8;
    if (what == 0) {
      const bool joint_mode = s.mode == controller::Mode::kJoint;
      s.mode = joint_mode ? controller::Mode::kCartesian : controller::Mode::kJoint;
    } else if (what == 1) {
      s.joint_position[i] = uniform(std::max(settings_.limits.position_lower[i], -10.0),
                                    std::min(settings_.limits.position_upper[i], 10.0));
    } else if (what == 2) {
      s.tip_pose.position = {uniform(-2, 2), uniform(-2, 2), uniform(-2, 2)};
      s.tip_pose.rotation = Eigen::Quaterniond(uniform(-1, 1), uniform(-1, 1), uniform(-1, 1), 2)
                                .normalized()
                                .toRotationMatrix();
    } else if (what == 3) {
      gains.frame = chance(0.5) ? controller::Frame::kBase : controller::Frame::kTool;
      gains.directions[engine_() % 6] ^= true;
    } else if (what == 4) {
      Eigen::Matrix<double, 6, 1> u;
      for (int k = 0; k < 6; ++k) u[k] = uniform(-30, 30);
      gains.task_stiffness = u * u.transpose();
      gains.task_damping_ratio = std::max(0.0, u[0] / 15);
    } else if (what == 5) {
      gains.joint_stiffness(i, i) = uniform(0, 1000);
      gains.joint_damping(i, i) = uniform(0, 100);
    } else if (what == 6) {
      gains.null_stiffness[i] = uniform(0, 100);
      gains.null_damping[i] = uniform(0, 10);
    } else {
      s.wrench[static_cast<int>(engine_() % 6)] = uniform(-100, 100);
    }
  }

  Eigen::Index odd_size() { return static_cast<Eigen::Index>(engine_() % 17); }

  void spoil_state() {
    const auto what = engine_() % 8;
    if (what == 0) state.position[joint()] = odd();
    if (what == 1) state.velocity[joint()] = odd();
    if (what == 2) state.position.resize(odd_size());
    if (what == 3) state.velocity.resize(odd_size());
    if (what == 4) state.time = static_cast<std::int64_t>(engine_());
    if (what == 5) {  // a real gap
      state.time = good_.time += static_cast<std::int64_t>(engine_() % 100'000'000);
    }
    if (what == 6) state.external_wrench[static_cast<int>(engine_() % 6)] = odd();
    if (what == 7) state.position[joint()] += uniform(-1, 1);
  }

  void spoil_setpoint() {
    controller::Setpoint& s = setpoint;
    const int k = static_cast<int>(engine_() % 6);
    const auto what = engine_() % 10;
    if (what == 0) s.joint_position[joint()] = odd();
    if (what == 1) s.joint_position.resize(odd_size());
    if (what == 2) s.tip_pose.position[k % 3] = odd();
    if (what == 3) s.tip_pose.rotation(k % 3, k / 3) = odd();
    if (what == 4) s.wrench[k] = odd();
    if (what == 5) s.time = static_cast<std::int64_t>(engine_());
    if (what == 6) s.gains.joint_stiffness(joint(), joint()) = odd();
    if (what == 7) (k == 0 ? s.gains.task_damping_ratio : s.gains.task_damping(k, k)) = odd();
    if (what == 8) s.gains.null_stiffness.resize(odd_size());
    if (what == 9) s.mode = static_cast<controller::Mode>(engine_() % 256);
  }

  Eigen::Index n_;
  controller::Settings settings_;
  std::mt19937_64 engine_;
  double share_;
  int wild_ = 0;    ///< ticks to go
  int silent_ = 0;  ///< ticks without a new set-point
  controller::RobotState good_;
  controller::Setpoint good_setpoint_;
};

/// Watches what comes out: finite, of n entries, within the limits of torque and of its rate.
class TorqueWatch {
 public:
  explicit TorqueWatch(const controller::Settings& settings)
      : limits_(settings.limits), period_(settings.period) {
    last_.setZero(settings.limits.torque.size());
  }
  /// Null, or what is wrong.
  const char* see(const controller::JointVector& torque) {
    if (torque.size() != last_.size()) return "wrong size";
    for (Eigen::Index i = 0; i < torque.size(); ++i) {
      if (!std::isfinite(torque[i])) return "not finite";
      if (std::abs(torque[i]) > limits_.torque[i]) return "above the torque limit";
      if (!first_ &&
          std::abs(torque[i] - last_[i]) > limits_.torque_rate[i] * period_ * (1 + 1e-9)) {
        return "above the torque-rate limit";
      }
    }
    first_ = false;  // which may be the weight at once
    last_ = torque;
    return nullptr;
  }

 private:
  controller::Limits limits_;
  double period_;
  bool first_ = true;
  controller::JointVector last_;
};

}  // namespace dashpot::testing
