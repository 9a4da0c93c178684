#pragma once
// Limits, encoders, feedback: points 1 to 5 of the list of what was seen.

#include <dashpot/tests/stress/safety_row.hpp>

#include <Eigen/Cholesky>
#include <numbers>

namespace dashpot::stress {

inline JointVector moved(JointVector q, int joint, double by) {
  q[joint] += by;
  return q;
}

/// Limits of which the upper one of one joint lies at `upper`.
inline std::string upper_limit(const TestArm& arm, int joint, double upper) {
  JointVector limits = limits_of(arm, &sim::Joint::upper);
  limits[joint] = upper;
  return "  position_upper: " + yaml_list(limits) + "\n";
}

inline bool slides(const TestArm& arm, int joint) {
  return simulated_robot(arm).joints()[static_cast<std::size_t>(joint)].prismatic;
}

/// Parked beyond a limit, maybe on the way back already.
inline Act outside(double by_angle, double by_length, double speed) {
  return [=](const PluginFile& plugin, const TestArm& arm, Row& row) {
    const int joint = arm.joint;
    RigOptions options;
    options.start = start_of(arm);
    const double by = slides(arm, joint) ? by_length : by_angle;
    const double upper = options.start[joint] - (slides(arm, joint) ? 0.05 : 0);
    options.start[joint] = upper + by;
    options.limits = upper_limit(arm, joint, upper);
    options.velocity = JointVector::Zero(options.start.size());
    options.velocity[joint] = -speed * limits_of(arm, &sim::Joint::velocity)[joint];
    Rig rig(plugin, arm, options);
    rig.run(0.002);
    const double at_first = rig.seen.kinetic_energy;
    rig.run(4);
    // A robot that was thrown swings on for a while after it met its hard stops.
    row.finish(rig, {speed + 0.3, speed == 0, true});
    const double put_in = std::max(0.0, row.seen.kinetic_energy - at_first);
    row.note = "put in " + number(put_in) + " J";
    row.require(speed == 0 || put_in < 0.1, "driven on");
    row.require(speed > 0 || row.seen.return_share <= kSlowReturn, "thrown back");
  };
}

/// The axis of a revolute joint at q, in the base.
inline Eigen::Vector3d axis_of(Rig& rig, int joint, const JointVector& q) {
  return controller::evaluate(rig.model(), q, JointVector::Zero(q.size())).J.col(joint).tail<3>();
}

/// Ordinary springs draw the light joint to its limit, through what pushes it back from there.
inline void light_joint_pressed(const PluginFile& plugin, const TestArm& arm, Row& row) {
  RigOptions options;
  const JointVector to = moved(start_of(arm), arm.light(), 0.3);
  options.limits = upper_limit(arm, arm.light(), to[arm.light()] + 1e-3);
  Rig rig(plugin, arm, options);
  const auto there = controller::evaluate(rig.model(), to, JointVector::Zero(to.size()));
  Eigen::MatrixXd K = Eigen::MatrixXd::Identity(to.size(), to.size()) * 200, D = 0 * K;
  K(arm.light(), arm.light()) = 2 * rig.limits().torque[arm.light()];
  D.diagonal() = 1.4 * K.diagonal().cwiseProduct(Eigen::VectorXd(there.M.diagonal())).cwiseSqrt();
  const bool taken = rig.set_gains(K, D) == DASHPOT_OK;
  rig.goal = Goal::joints(to);
  rig.run(5);
  row.finish(rig, {1, true, true});
  row.note = "torque turns round in " + number(100 * row.seen.reversals, "%.0f") + " % of ticks" +
             (taken ? "" : "; gains refused");
}

/// A hand guides the light joint past its limit and lets go.
inline void light_joint_let_go(const PluginFile& plugin, const TestArm& arm, Row& row) {
  RigOptions options;
  const double upper = arm.start[static_cast<std::size_t>(arm.light())] + 0.3;
  options.limits = upper_limit(arm, arm.light(), upper);
  Rig rig(plugin, arm, options);
  rig.run(0.2);
  rig.guide(moved(rig.position(), arm.light(), 0.35), 1.5);
  rig.run(4);
  row.finish(rig, {1, true, true});
  row.require(row.seen.return_share <= kSlowReturn, "thrown back");
}

/// The 4 cm finger stands a quarter of its way from one end.
inline void finger_at_rest(const PluginFile& plugin, const TestArm& arm, Row& row) {
  RigOptions options;
  options.start = start_of(arm);
  options.start[4] = 0.01;
  Rig rig(plugin, arm, options);
  rig.run(4);
  row.finish(rig, {0.5, true, true});
  const double moved_by = std::abs(rig.position()[4] - 0.01);
  row.note = "finger moved " + number(1e3 * moved_by) + " mm";
  row.require(moved_by < 1e-3, "finger moves by itself");
}

/// An encoder is off by so many radians from 0.5 s on.
inline Act encoder_off(double by) {
  return [by](const PluginFile& plugin, const TestArm& arm, Row& row) {
    const int joint = slides(arm, arm.joint) ? 1 : arm.joint;
    RigOptions options;
    sim::SensorFault fault;
    fault.begin = 0.5;
    fault.position_offset = moved(JointVector::Zero(start_of(arm).size()), joint, by);
    options.plant.faults = {fault};
    Rig rig(plugin, arm, options);
    rig.goal = Goal::joints(rig.position());
    rig.run(5);
    row.finish(rig, {1, true, false});
    const double moved_by = std::abs(rig.position()[joint] - start_of(arm)[joint]);
    const double share = std::abs(rig.given()[joint] - rig.weight(rig.position())[joint]) /
                         rig.limits().torque[joint];
    row.note = "joint moved " + number(moved_by) + " rad, pushes with " +
               number(100 * share, "%.0f") + " % of its torque";
    row.require(moved_by < 0.3 && share < 0.1, "an encoder that slipped is believed");
  };
}

/// More damping than the sampled loop stands where joints are light. After the velocity limit
/// the same gains come back.
inline void unstable_gains(const PluginFile& plugin, const TestArm& arm, Row& row) {
  Rig rig(plugin, arm, {});
  rig.run(0.2);
  const Eigen::MatrixXd one = Eigen::MatrixXd::Identity(rig.n(), rig.n());
  const double damping = 100 + 2000 * arm.reflected_inertia;  // the limit is about 2 M / T
  const bool taken = rig.set_gains(100 * one, damping * one) == DASHPOT_OK;
  rig.run(4);
  row.finish(rig, {1.5, true, true});
  row.note = (taken ? "gains taken; " : "gains refused; ") + std::to_string(row.seen.changes) +
             " changes of status";
}

inline void wrench_without_springs(const PluginFile& plugin, const TestArm& arm, Row& row) {
  RigOptions options;
  options.config =
      "control: {mode: cartesian}\ngains:\n  task: {stiffness: [0, 0, 0, 0, 0, 0], damping: [0, 0, "
      "0, 0, 0, 0]}\n";
  if (arm.start.size() > 6) options.config += "  null_space: {stiffness: 0, damping: 0}\n";
  Rig rig(plugin, arm, options);
  rig.goal = Goal::at(rig.tip_at(rig.position()));
  rig.goal->wrench << 0, 30, 0, 0, 0, 0;
  rig.run(6);
  // A wrench without springs drives the arm until it is about as fast as it may be. One step of
  // torque takes a wrist of 3e-4 kg m^2 beyond its limit before anybody knows.
  const bool light = std::string(arm.name) == "lift+gripper";
  row.finish(rig, {light ? 4.0 : 1.5, false, true});
  row.note = std::to_string(row.seen.changes) + " changes of status";
}

/// The controller is not called for 10 s; meanwhile a hand moves the robot.
inline void moved_in_a_pause(const PluginFile& plugin, const TestArm& arm, Row& row) {
  Rig rig(plugin, arm, {});
  rig.goal = Goal::joints(rig.position());
  rig.run(1);
  rig.guide(moved(rig.position(), arm.joint, slides(arm, arm.joint) ? 0.15 : 0.5), 10, true);
  rig.measure_afresh();
  const JointVector there = rig.position();
  rig.run(6);
  row.finish(rig, {1, true, true});
  const double back = (rig.position() - there).cwiseAbs().maxCoeff();
  row.note = "drives back " + number(back) + (slides(arm, arm.joint) ? " m" : " rad") + " unasked";
  row.require(back < 0.02, "drives back unasked");
}

/// Feedback fails in the middle of a motion of the tip, or of the joints. If the motion is unknown,
/// no torque is safe: the controller has to notice it and to end the springs; then the robot needs
/// brakes.
inline Act bad_feedback(const std::function<void(sim::SensorFault&, Eigen::Index)>& spoil,
                        bool blind = false) {
  return [spoil, blind](const PluginFile& plugin, const TestArm& arm, Row& row) {
    RigOptions options;
    sim::SensorFault fault;
    fault.begin = 0.5;
    spoil(fault, start_of(arm).size());
    options.plant.faults = {fault};
    Rig rig(plugin, arm, options);
    JointVector to = moved(rig.position(), arm.joint, slides(arm, arm.joint) ? 0.2 : 0.8);
    to[1] += 0.4;
    rig.goal = Goal::joints(to);
    rig.run(6);
    row.finish(rig, {blind ? 100.0 : 1.0, !blind, false});
    row.note = "status at the end: " + row.seen.last_status.substr(0, 30);
    row.require(row.seen.last_status != "ok", "goes on");
    row.require(row.seen.first_status != "ok", "never noticed");
  };
}

inline void freeze(sim::SensorFault& fault, Eigen::Index) {
  fault.frozen = true;
}
inline void no_velocity(sim::SensorFault& fault, Eigen::Index n) {
  fault.velocity_factor = JointVector::Zero(n);
}
inline void wrong_sign(sim::SensorFault& fault, Eigen::Index n) {
  fault.velocity_factor = -JointVector::Ones(n);
}

/// Something rattles at the light joint for 0.15 s: from one millisecond to the next its velocity
/// changes by 1.2 of its limit.
inline void hard_jolts(const PluginFile& plugin, const TestArm& arm, Row& row) {
  const JointVector q = start_of(arm);
  RigOptions options;
  {
    Rig rig(plugin, arm, options);
    const Eigen::Vector3d axis = axis_of(rig, arm.light(), q);
    const auto there = controller::evaluate(rig.model(), q, JointVector::Zero(q.size()));
    const Eigen::VectorXd unit = there.J.bottomRows<3>().transpose() * axis;
    const Eigen::VectorXd acceleration = Eigen::MatrixXd(there.M).ldlt().solve(unit);
    controller::Vector6 jolt = controller::Vector6::Zero();
    jolt.tail<3>() = 1200 * rig.limits().velocity[arm.light()] / acceleration[arm.light()] * axis;
    options.world.wrenches = {{0.5, 0.501, jolt / 2}};
    for (int i = 1; i < 150; ++i) {
      const double at = 0.5 + 0.001 * i;
      options.world.wrenches.push_back({at, at + 0.001, i % 2 == 0 ? jolt : -jolt});
    }
  }
  Rig rig(plugin, arm, options);
  rig.run(0.4);
  rig.measure_afresh();
  rig.run(3);
  row.finish(rig, {2, true, true});
  row.note = "carries " + number(100 * row.seen.least_weight, "%.0f") +
             " % of the weight at least, sags " + number(1e3 * row.seen.tip_moved) + " mm";
  row.require(row.seen.least_weight > 0.7, "drops the weight");
}

/// Joint 1, or all joints, at so much of their velocity limits when a gap is seen.
inline Act stop_from(double share, bool all) {
  return [=](const PluginFile& plugin, const TestArm& arm, Row& row) {
    RigOptions options;
    options.velocity = share * limits_of(arm, &sim::Joint::velocity);
    if (!all) options.velocity.tail(options.velocity.size() - 1).setZero();
    options.world.viscous_friction = options.world.coulomb_friction = false;
    Rig rig(plugin, arm, options);
    rig.run(rig.period());
    rig.skip_time(0.02);
    const JointVector from = rig.position();
    double slow = -1;  // s, when all were slower than a tenth for good
    Eigen::VectorXd way = Eigen::VectorXd::Zero(rig.n());
    for (int tick = 0; tick < 2000; ++tick) {
      rig.run(rig.period());
      const JointVector speed = rig.plant().velocity().cwiseQuotient(rig.limits().velocity);
      if (speed.cwiseAbs().maxCoeff() > 0.1 * share) {
        slow = -1;
      } else if (slow < 0) {
        slow = tick * rig.period();
      }
      way = way.cwiseMax((rig.position() - from).cwiseAbs());
    }
    row.finish(rig, {100, true, false});
    const double degrees = 180 / std::numbers::pi;
    row.note = "a tenth left after " + number(slow) + " s; joint 1 went " +
               number(slides(arm, 0) ? way[0] : degrees * way[0]) +
               (slides(arm, 0) ? " m" : " deg") + ", any " + number(degrees * way.maxCoeff());
    row.require(all || (slow >= 0 && slow <= 0.25), "goes on for long");
    row.require(all || slides(arm, 0) || degrees * way[0] <= 20, "goes far");
  };
}

/// In the settling of a move of 10 cm every state repeats the same bits.
inline void frozen_creep(const PluginFile& plugin, const TestArm& arm, Row& row) {
  RigOptions options;
  options.config = "control: {mode: cartesian}\n";
  sim::SensorFault fault;
  fault.begin = 1.2;
  fault.frozen = true;
  options.plant.faults = {fault};
  Rig rig(plugin, arm, options);
  rig.goal = Goal::at(rig.tip_at(rig.position()));
  rig.goal->tip.position.z() -= 0.1;
  rig.run(1.2);
  const bool creeps = rig.plant().velocity().cwiseAbs().maxCoeff() > 2.5e-3;
  rig.run(0.05);
  row.finish(rig, {100, false, false});
  row.note = creeps ? "creeps" : "stands";
  row.require(!creeps || row.seen.last_status != "ok", "never noticed");
}

/// From 0.5 s on time stamps are wrong by so much, and somebody bumps into the arm.
inline Act wrong_clock(double rate) {
  return [rate](const PluginFile& plugin, const TestArm& arm, Row& row) {
    RigOptions options;
    controller::Vector6 push = controller::Vector6::Zero();
    push[0] = 10;
    options.world.wrenches = {{1.0, 1.018, push}};
    Rig rig(plugin, arm, options);
    rig.run(0.5);
    rig.clock_rate = rate;
    rig.run(3);
    const bool light = std::string(arm.name) == "lift+gripper";  // 10 N on 3e-4 kg m^2
    row.finish(rig, {light ? 50.0 : 1.0, true, false});
    row.note = "carries " + number(100 * row.seen.least_weight, "%.0f") + " % of the weight";
    row.require(row.seen.least_weight > 0.5, "drops the weight");
  };
}

}  // namespace dashpot::stress
