#pragma once
// Arms whose stiffness a policy changes as it likes, and the energy that their motors give.

#include <dashpot/controller/controller.hpp>
#include <dashpot/controller/default_settings.hpp>
#include <dashpot/controller/dynamics.hpp>
#include <dashpot/sim/arm.hpp>
#include <dashpot/sim/plant.hpp>
#include <dashpot/tests/support/dice.hpp>
#include <dashpot/tests/support/mujoco_arm.hpp>
#include <dashpot/tests/support/twin_models.hpp>

#include <algorithm>
#include <cmath>
#include <limits>
#include <optional>
#include <stdexcept>

namespace dashpot::testing {

/// A policy drawn by chance: stiffness up to tenfold at up to 1 kHz, goals that jump, a wall and
/// pushes. Every other one gives the arm energy on purpose: stiff while the springs pull it back,
/// soft while it moves away.
struct FedArm {
  explicit FedArm(std::uint64_t seed) : random(seed) {
    const auto& all = arms();
    arm = all[seed % all.size()];
    twin.emplace(arm, seed % 3 == 0);
    start = random_posture(*twin, random);
    pumps = seed % 2 == 0;
    every = pumps ? 1 : static_cast<int>(random.log_uniform(1, 1000));
    store = random.log_uniform(0.5, 20);
    controller::Settings& s = settings = controller::default_settings(twin->model);
    s.initial.mode = seed % 5 < 3 ? controller::Mode::kCartesian : controller::Mode::kJoint;
    s.initial.gains.task_damping_ratio = s.initial.gains.joint_damping_ratio = 0;
    s.initial.gains.joint_damping *= 0.2;
    s.initial.gains.task_damping = 0.2 * s.initial.gains.task_stiffness.cwiseSqrt();
    s.energy.store = store;
    s.motion.gain_time = random.log_uniform(0.001, 0.3);
    s.analysis.where = controller::Analysis::Where::kOff;
    const int delay = s.analysis.sampled.delay =
        random.integer(0, 1) == 0 ? random.integer(0, 10) : random.integer(0, 2);
    // Dampers that are stable with this delay.
    s.initial.gains.joint_damping /= 1 + delay / 2.0;
    s.initial.gains.task_damping /= 1 + delay / 2.0;
    s.watchdog.feedback = 0;
    s.watchdog.setpoint_hold = s.watchdog.setpoint_damp = 0;
    s.limits.beyond_model = true;
    s.limits.gain_margin = 1;
    s.limits.velocity.setConstant(50);
    s.limits.tip_velocity = 50;
    s.limits.torque_rate.setConstant(random.integer(0, 3) == 0 ? 1e7
                                                               : random.log_uniform(500, 1e5));
    s.analysis.sampled.cutoff = random.integer(0, 2) == 0 ? random.log_uniform(20, 300) : 0;
    s.limits.torque.setConstant(1e3);
    s.limits.position_lower.setConstant(-100);
    s.limits.position_upper.setConstant(100);
    world.coulomb_friction = seed % 3 == 0;
    world.viscous_friction = true;
    const controller::JointVector none = controller::JointVector::Zero(start.size());
    const auto there = evaluate(twin->model, start, none);
    if (random.integer(0, 1) == 1) {
      world.wall.emplace();
      world.wall->normal = random.vector(3).normalized();
      world.wall->point = there.p_BT_B - 0.02 * world.wall->normal;
    }
    for (int i = 0; i < 3; ++i) {
      const double from = random.uniform(0, kSeconds);
      controller::Vector6 push = controller::Vector6::Zero();
      push.head<3>() = random.log_uniform(3, 60) * random.vector(3).normalized();
      world.wrenches.push_back({from + 1.0 * i, from + 1.0 * i + 0.1, push});
    }
    std::sort(world.wrenches.begin(), world.wrenches.end(),
              [](const auto& a, const auto& b) { return a.begin < b.begin; });
    for (std::size_t i = 1; i < world.wrenches.size(); ++i) {
      auto& one = world.wrenches[i];
      const double shift = std::max(0.0, world.wrenches[i - 1].end - one.begin);
      one.begin += shift, one.end += shift;
    }
  }

  /// What the motors gave at most beyond weight and friction, J, and the least share of the
  /// springs.
  struct Fed {
    double most = 0, share = 1;
    bool braked = false;  ///< springs ended, and with them what is counted
  };
  Fed in_stand_in(bool tank) {
    sim::Arm body(twin->robot, world);
    sim::PlantOptions options;
    options.delay = settings.analysis.sampled.delay;
    options.torque_cutoff = settings.analysis.sampled.cutoff;
    options.integrator.method = sim::Method::kRosenbrock;
    options.initial_torque = weight();
    sim::Plant plant(body, options, start);
    return run(
        tank, [&] { return plant.measured().position; }, [&] { return plant.measured().velocity; },
        [&](const controller::JointVector& torque) {
          if (plant.step(torque) != sim::Status::kOk) throw std::runtime_error("diverged");
          const sim::EnergyAudit audit = plant.audit();
          return audit.by_actuators - (audit.stored.gravity - audit.initial.gravity) -
                 audit.viscous_heat - audit.friction_heat;
        });
  }
  /// Without friction, whose heat MuJoCo does not report, delay and low-pass.
  Fed in_mujoco(bool tank) {
    twin.emplace(arm, false);
    settings.analysis.sampled.delay = 0;
    settings.analysis.sampled.cutoff = 0;
    world.coulomb_friction = false;
    const auto body = MujocoArm::make(twin->robot, world, {}, start);
    double work = 0;
    return run(
        tank, [&] { return body->position(); }, [&] { return body->velocity(); },
        [&](const controller::JointVector& torque) {
          const controller::JointVector before = body->position();
          body->step(torque, settings.period);
          work += torque.dot(body->position() - before);
          return work - raised(body->position());
        });
  }

  static constexpr double kSeconds = 3;
  Dice random;
  Arm arm{};
  std::optional<TwinModels> twin;
  controller::Settings settings;
  sim::ArmOptions world;
  controller::JointVector start;
  bool pumps;
  int every;
  double store;

 private:
  controller::JointVector weight() const {
    return evaluate(twin->model, start, controller::JointVector::Zero(start.size())).gravity;
  }
  /// The potential energy at q beyond that at the start, by Gauss along the straight line.
  double raised(const controller::JointVector& q) const {
    constexpr double kNodes[] = {0.0694318442029737, 0.3300094782075719, 0.6699905217924281,
                                 0.9305681557970262};
    constexpr double kWeights[] = {0.1739274225687269, 0.3260725774312731, 0.3260725774312731,
                                   0.1739274225687269};
    constexpr int kParts = 8;
    const controller::JointVector way = q - start, none = controller::JointVector::Zero(q.size());
    double sum = 0;
    for (int part = 0; part < kParts; ++part) {
      for (int k = 0; k < 4; ++k) {
        const controller::JointVector at = start + (part + kNodes[k]) / kParts * way;
        sum += kWeights[k] / kParts * way.dot(evaluate(twin->model, at, none).gravity);
      }
    }
    return sum;
  }
  template <class Position, class Velocity, class Step>
  Fed run(bool tank, const Position& position, const Velocity& velocity, const Step& step) {
    Dice policy = random;  // the same for both
    using From = controller::Energy::From;
    settings.energy.from = tank ? From::kTank : From::kFree;
    controller::Controller controller(twin->model, settings);
    controller.reset(weight());
    controller::RobotState state;
    controller::Setpoint setpoint = settings.initial;
    const controller::Gains base = setpoint.gains;
    const auto there = evaluate(twin->model, start, controller::JointVector::Zero(start.size()));
    setpoint.joint_position = start;
    setpoint.tip_pose = {there.p_BT_B, there.R_BT};
    controller::JointVector torque;
    Fed fed;
    for (int k = 0; k < static_cast<int>(kSeconds / settings.period); ++k) {
      state.time += std::llround(1e9 * settings.period);
      state.position = position();
      state.velocity = velocity();
      if (k % every == 0) {
        double factor = std::exp(policy.uniform(0, std::log(10)));
        if (pumps && k > 0) {
          const auto& seen = controller.snapshot();
          const bool joint = setpoint.mode == controller::Mode::kJoint;
          const auto now = evaluate(twin->model, state.position, state.velocity);
          const double back = joint ? seen.joint_error.dot(state.velocity)
                                    : seen.tip_error.dot(now.J * state.velocity);
          factor = back > 0 ? 10 : 1;
        }
        setpoint.gains.joint_stiffness = factor * base.joint_stiffness;
        setpoint.gains.task_stiffness = factor * base.task_stiffness;
        setpoint.time = state.time;
      }
      if (k % 500 == 300) {
        setpoint.wrench.head<3>() = 20 * policy.vector(3);
        setpoint.time = state.time;
      }
      if (k % 500 == 100) {
        setpoint.joint_position = start + 0.3 * policy.vector(static_cast<int>(start.size()));
        setpoint.tip_pose.position = there.p_BT_B + 0.1 * policy.vector(3);
        setpoint.time = state.time;
      }
      if (controller.update(state, setpoint, torque) >= controller::Status::kSetpointStale) {
        fed.braked = true;  // the brake is not bound by the tank
        break;
      }
      fed.share = std::min(fed.share, controller.snapshot().spring_share);
      fed.most = std::max(fed.most, step(torque));
    }
    return fed;
  }
};

}  // namespace dashpot::testing
