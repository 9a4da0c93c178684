#pragma once
// A plugin file, driven through its C interface alone, in a loop with the simulator or with MuJoCo.

#include <dashpot/controller/dynamics.hpp>
#include <dashpot/sim/plant.hpp>
#include <dashpot/tests/stress/safety_arms.hpp>
#include <dashpot/tests/support/mujoco_arm.hpp>

#include <unistd.h>

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <deque>
#include <fstream>
#include <memory>
#include <optional>
#include <stdexcept>
#include <string>
#include <vector>

namespace dashpot::stress {

/// The options of a rig; the defaults are the arm's own.
struct RigOptions {
  std::string robot;           ///< YAML lines under `robot`
  std::string config;          ///< YAML lines beside `robot`, `limits` and `analysis`
  std::string limits;          ///< lines under `limits`
  JointVector start;           ///< rad or m
  JointVector velocity;        ///< rad/s or m/s
  sim::ArmOptions world;       ///< wall, pushes; stops are added
  sim::PlantOptions plant;     ///< sensors, and their faults
  double velocity_step = 0;    ///< of the velocities that are measured, rad/s or m/s
  sim::RobotParameters truth;  ///< of the robot; without reflected inertias it has the arm's own
  std::optional<testing::MujocoOptions> mujoco;  ///< which moves the robot then
  double told_rotors = 0;  ///< kg m^2 (kg) each that the controller alone knows of
};

/// A set-point that the host repeats every 0.1 s.
struct Goal {
  std::int32_t mode = DASHPOT_MODE_JOINT;
  JointVector position;  ///< empty: NULL
  sim::Pose tip;
  controller::Vector6 wrench = controller::Vector6::Zero();

  static Goal joints(const JointVector& q) {
    Goal goal;
    goal.position = q;
    return goal;
  }
  static Goal at(const sim::Pose& pose) {
    Goal goal;
    goal.mode = DASHPOT_MODE_CARTESIAN;
    goal.tip = pose;
    return goal;
  }
};

/// Measured on the robot itself, not by its sensors, while the robot moved freely.
struct Measures {
  double speed_share = 0;     ///< greatest joint speed over its limit
  double tip_speed = 0;       ///< greatest, m/s
  double kinetic_energy = 0;  ///< greatest, J
  double driven = 0;          ///< s, a joint beyond 1.05 of its velocity limit was driven on
  double return_share = 0;    ///< greatest speed back from outside a position limit, over its limit
  double least_weight = 1;    ///< least share of its weight that the torque carried
  double tip_moved = 0;       ///< farthest from where the tip was at the start, m
  int refused_goals = 0;      ///< set-points that the plugin did not take
  int changes = 0;            ///< of the status
  std::string first_status = "ok";  ///< the first that was not ok
  std::string last_status = "ok";
  double reversals = 0;   ///< share of the last second's ticks in which a torque turned round
  double last_speed = 0;  ///< greatest joint speed over its limit in the last half second
  int last_changes = 0;   ///< of the status, in the last second
};

/// A controller of the plugin, a simulated arm, and a clock.
class Rig {
 public:
  /// Throws std::runtime_error with the plugin's words if it refuses the configuration.
  Rig(const PluginFile& plugin, const TestArm& arm, const RigOptions& options)
      : plugin_(plugin),
        config_(controller::load_config(write_config(arm, options))),
        controller_(plugin.create(write_config(arm, options).c_str()), plugin.destroy),
        velocity_step_(options.velocity_step),
        body_(simulated_robot(arm, options.truth), with_stops(options.world)) {
    unlink(path_.c_str());
    if (!controller_) throw std::runtime_error(plugin.last_error());
    const JointVector start = options.start.size() > 0 ? options.start : start_of(arm);
    n_ = static_cast<std::uint32_t>(start.size());
    sim::PlantOptions plant = options.plant;
    plant.period = config_.settings.period;
    plant.integrator.max_step = plant.period;
    plant.integrator.method = sim::Method::kRosenbrock;  // light joints on hard stops
    plant.integrator.adaptive = true;
    plant.integrator.absolute_tolerance = 1e-6;
    plant.integrator.relative_tolerance = 1e-4;
    plant.initial_torque = weight(start);
    plant_.emplace(body_, plant, start, options.velocity);
    if (options.mujoco) {
      mujoco_ = testing::MujocoArm::make(body_.robot(), with_stops(options.world), *options.mujoco,
                                         start, options.velocity);
    }
    torque_ = given_ = last_given_ = plant.initial_torque;
    motors_ = JointVector::Ones(start.size());
    last_excess_ = JointVector::Zero(start.size());
    over_ = allowed_ = last_excess_;
    first_tip_ = body_.tip_pose(start).position;
    plugin.reset(controller_.get(), torque_.data());
  }

  int n() const { return static_cast<int>(n_); }
  double period() const { return config_.settings.period; }
  const controller::Limits& limits() const { return config_.settings.limits; }
  const controller::RobotModel& model() const { return config_.model; }
  const sim::Plant& plant() const { return *plant_; }
  testing::MujocoArm& mujoco() { return *mujoco_; }
  JointVector position() const { return plant_->position(); }
  const JointVector& given() const { return given_; }  ///< torque that acts on the robot
  double kinetic() const {
    return mujoco_ ? mujoco_->kinetic_energy() : plant_->audit().stored.kinetic;
  }
  sim::Pose tip_at(const JointVector& q) { return body_.tip_pose(q); }
  JointVector weight(const JointVector& q) const {
    return controller::evaluate(config_.model, q, JointVector::Zero(q.size())).gravity;
  }

  std::optional<Goal> goal;  ///< what the host wants
  int late = 0;              ///< periods of the states
  double excess_factor = 1;  ///< of what exceeds the weight, between controller and robot
  int missing = 0;           ///< joints that the states lack
  bool faulted = false;      ///< a fault has ended the springs
  Measures seen;

  /// `seen`, with what the last second was like.
  const Measures& at_the_end();
  /// Everything that happens from now on is measured afresh, but for the statuses.
  void measure_afresh() {
    seen.speed_share = seen.tip_speed = seen.kinetic_energy = seen.driven = 0;
    seen.return_share = 0;
    seen.least_weight = 1;
    first_tip_ = body_.tip_pose(position()).position;
  }

  /// Returns what dashpot_set_gains does: of the joints, or of the tip.
  std::int32_t set_gains(const Eigen::MatrixXd& K, const Eigen::MatrixXd& D, bool task = false) {
    dashpot_gains gains{};
    gains.struct_size = sizeof gains;
    gains.joints = n_;
    (task ? gains.task_stiffness : gains.joint_stiffness) = K.data();
    (task ? gains.task_damping : gains.joint_damping) = D.data();
    return plugin_.set_gains(controller_.get(), &gains);
  }

  /// From now on a motor gives so many times the torque that it is to give.
  void spoil_motor(int joint, double factor) { motors_[joint] = factor; }
  /// The time stamps from now on are so much later, s.
  void skip_time(double seconds) { skipped_ += std::llround(1e9 * seconds); }

  /// Ticks with the robot free.
  void run(double seconds) {
    for (std::int64_t i = std::llround(seconds / period()); i > 0; --i) {
      control();
      ++ticks_;
      move();
      watch();
    }
  }
  /// A hand guides the robot to q within some seconds.
  void guide(const JointVector& to, double seconds) {
    const JointVector from = position();
    const std::int64_t ticks = std::max<std::int64_t>(1, std::llround(seconds / period()));
    for (std::int64_t i = 1; i <= ticks; ++i) {
      control();
      ++ticks_;
      const double s = static_cast<double>(i) / static_cast<double>(ticks);
      const double place = s * s * s * (10 + s * (-15 + 6 * s));
      const double slope = 30 * s * s * (1 - s) * (1 - s) / (static_cast<double>(ticks) * period());
      plant_->carry(from + place * (to - from), slope * (to - from));
    }
    if (mujoco_) mujoco_->place(plant_->position(), plant_->velocity());
  }

 private:
  static sim::ArmOptions with_stops(sim::ArmOptions world) {
    world.stops = sim::Contact{2000, 20};
    return world;
  }
  std::string write_config(const TestArm& arm, const RigOptions& options) {
    if (path_.empty()) {
      char name[] = "/tmp/dashpot_safety.XXXXXX.yaml";
      const int file = mkstemps(name, 5);
      if (file < 0) throw std::runtime_error("cannot write a temporary file");
      close(file);
      path_ = name;
    }
    std::ofstream(path_) << robot_yaml(arm, options.told_rotors) << options.robot
                         << "analysis: {where: off}\n"
                         << options.config << (options.limits.empty() ? "" : "limits:\n")
                         << options.limits;
    return path_;
  }

  void tell() {
    const std::vector<double> tip(goal->tip.position.begin(), goal->tip.position.end());
    const Eigen::Matrix<double, 3, 3, Eigen::RowMajor> rotation = goal->tip.rotation;
    const dashpot_setpoint setpoint = {sizeof(dashpot_setpoint),
                                       n_,
                                       DASHPOT_ON_ARRIVAL,
                                       goal->mode,
                                       goal->position.size() > 0 ? goal->position.data() : nullptr,
                                       tip.data(),
                                       rotation.data(),
                                       goal->wrench.data()};
    if (plugin_.set_setpoint(controller_.get(), &setpoint) != DASHPOT_OK) ++seen.refused_goals;
  }

  void move() {
    given_ = torque_;
    if (excess_factor != 1) {
      const JointVector g = weight(position());
      given_ = g + excess_factor * (torque_ - g);
    }
    given_ = given_.cwiseProduct(motors_);
    if (mujoco_) {
      mujoco_->step(given_, period());
      plant_->carry(mujoco_->position(), mujoco_->velocity());
    } else if (plant_->step(given_) != sim::Status::kOk) {
      throw std::runtime_error("the simulation failed at " + std::to_string(plant_->time()) + " s");
    }
  }

  void control() {
    if (goal && ticks_ % 100 == 0) tell();
    for (int k = measured_.empty() ? late : 0; k > 0; --k) {  // the robot came this way
      sim::Measurement before = plant_->measured();
      before.position -= k * period() * before.velocity;
      before.time -= std::llround(1e9 * k * period());
      measured_.push_back(before);
    }
    measured_.push_back(plant_->measured());
    while (measured_.size() > static_cast<std::size_t>(late) + 1) measured_.pop_front();
    sim::Measurement measured = measured_.front();
    if (velocity_step_ > 0) {
      for (double& v : measured.velocity) v = velocity_step_ * std::nearbyint(v / velocity_step_);
    }
    const std::int64_t time = skipped_ + measured.time;
    const dashpot_state state = {sizeof(dashpot_state),
                                 n_ - static_cast<std::uint32_t>(missing),
                                 time,
                                 measured.position.data(),
                                 measured.velocity.data(),
                                 nullptr};
    dashpot_output output = {sizeof(dashpot_output), n_, torque_.data()};
    const std::int32_t status = plugin_.update(controller_.get(), &state, nullptr, &output);
    if (status < 0) torque_.setZero();
    note(status);
  }

  void note(std::int32_t status) {
    if (status != last_status_) {
      if (last_status_ != DASHPOT_OK || status != DASHPOT_OK) ++seen.changes;
      change_times_.push_back(plant_->time());
    }
    const char* text = plugin_.status_text(status);
    if (seen.first_status == "ok") seen.first_status = text;
    seen.last_status = text;
    faulted |= status >= DASHPOT_FAULT_LATCHED;
    last_status_ = status;
  }

  void watch();

  const PluginFile& plugin_;
  std::string path_;
  controller::Config config_;
  std::unique_ptr<dashpot_controller, void (*)(dashpot_controller*)> controller_;
  double velocity_step_;
  sim::Arm body_;
  std::optional<sim::Plant> plant_;
  std::unique_ptr<testing::MujocoArm> mujoco_;
  std::uint32_t n_ = 0;
  std::int64_t ticks_ = 0;
  JointVector torque_;
  std::deque<sim::Measurement> measured_;  ///< on their way
  std::int64_t skipped_ = 0;               ///< ns
  std::int32_t last_status_ = DASHPOT_OK;
  std::deque<double> change_times_;  ///< of the status, s
  Eigen::Vector3d first_tip_;
  JointVector motors_;
  JointVector given_, last_given_, last_excess_;
  JointVector over_;                  ///< for how long a joint has been too fast, s
  JointVector allowed_;               ///< for how long it may be driven on then, s
  std::deque<std::uint32_t> turned_;  ///< of the last second: which torques turned round, by bits
  std::deque<double> speeds_;         ///< of the last half second
};

/// After a free period: what the robot does, and whether it is driven where it must not be.
inline void Rig::watch() {
  const JointVector q = plant_->position(), qd = plant_->velocity();
  const controller::Limits& limit = limits();
  const JointVector g = weight(q);
  const JointVector excess = given_ - g;
  double fastest = 0;
  std::uint32_t turns = 0;
  for (int i = 0; i < n(); ++i) {
    const double share = std::abs(qd[i]) / limit.velocity[i];
    fastest = std::max(fastest, share);
    // Too fast: the torque may go on as long as its rate limit takes to bring the slowest down.
    if (share <= 1.05) {
      over_[i] = 0;
    } else {
      if (over_[i] == 0) {
        allowed_[i] = 0.005 + last_excess_.cwiseAbs().cwiseQuotient(limit.torque_rate).maxCoeff();
      }
      over_[i] += period();
      const double change = std::copysign(1, qd[i]) * (given_[i] - last_given_[i]);
      const bool ends = change < -0.999 * limit.torque_rate[i] * period();  // as fast as it may
      if (over_[i] > allowed_[i] && !ends && excess[i] * qd[i] > 0 &&
          std::abs(excess[i]) > 0.02 * limit.torque[i]) {
        seen.driven += period();
      }
    }
    const bool above = q[i] > limit.position_upper[i], below = q[i] < limit.position_lower[i];
    if ((above && qd[i] < 0) || (below && qd[i] > 0)) {
      seen.return_share = std::max(seen.return_share, share);
    }
    const double least = 1e-3 * limit.torque[i];
    if (excess[i] * last_excess_[i] < 0 && std::abs(excess[i]) > least &&
        std::abs(last_excess_[i]) > least) {
      turns |= 1U << static_cast<unsigned>(i);
    }
  }
  last_excess_ = excess;
  last_given_ = given_;
  seen.speed_share = std::max(seen.speed_share, fastest);
  seen.tip_speed = std::max(seen.tip_speed, body_.tip_twist(q, qd).head<3>().norm());
  seen.kinetic_energy = std::max(seen.kinetic_energy, kinetic());
  seen.tip_moved = std::max(seen.tip_moved, (body_.tip_pose(q).position - first_tip_).norm());
  if (g.norm() > 1) {
    seen.least_weight = std::min(seen.least_weight, given_.dot(g) / g.squaredNorm());
  }
  const auto second = static_cast<std::size_t>(std::llround(1 / period()));
  turned_.push_back(turns);
  if (turned_.size() > second) turned_.pop_front();
  speeds_.push_back(fastest);
  if (speeds_.size() > second / 2) speeds_.pop_front();
}

inline const Measures& Rig::at_the_end() {
  while (!change_times_.empty() && change_times_.front() < plant_->time() - 1) {
    change_times_.pop_front();
  }
  seen.last_changes = static_cast<int>(change_times_.size());
  seen.last_speed = speeds_.empty() ? 0 : *std::max_element(speeds_.begin(), speeds_.end());
  seen.reversals = 0;
  for (unsigned i = 0; i < n_; ++i) {
    const auto count = std::count_if(turned_.begin(), turned_.end(),
                                     [i](std::uint32_t turns) { return (turns >> i & 1U) != 0; });
    seen.reversals =
        std::max(seen.reversals, static_cast<double>(count) / static_cast<double>(turned_.size()));
  }
  return seen;
}

}  // namespace dashpot::stress
