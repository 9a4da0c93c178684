#pragma once
// The rows of ./run stress safety; limits, encoders, feedback: points 1 to 5 of what was seen.

#include <dashpot/tests/stress/safety_rig.hpp>

#include <Eigen/Cholesky>
#include <functional>
#include <numbers>
#include <string>
#include <vector>

namespace dashpot::stress {

/// A scenario's bounds, in addition to no drive beyond the speed limits.
struct Bounds {
  double speed = 1.5;  ///< greatest joint speed over its limit
  bool rest = true;    ///< still at the end: no motion, no changes of status, no torque that turns
  bool driven = true;  ///< no joint is driven beyond 1.05 of its limit; false where sensors lie
};

/// Joints come back from outside a position limit no faster than this share of their velocity
/// limits, unless they did so when the controller saw them first.
constexpr double kSlowReturn = 0.3;
constexpr double kRest = 0.05;  ///< of the velocity limit: what is slower counts as still

struct Row {
  std::string scenario;
  std::string arm;
  std::string plugin;
  Measures seen;
  double kept = 1;                  ///< share of the kinetic energy at the end, in a stop
  std::string note;                 ///< what this scenario is about
  std::vector<std::string> broken;  ///< invariants

  void require(bool holds, const std::string& what) {
    if (!holds) broken.push_back(what);
  }
  /// Takes the measures of a rig that has run to the scenario's end, and checks the bounds.
  void finish(Rig& rig, const Bounds& bounds) {
    seen = rig.at_the_end();
    require(seen.speed_share <= bounds.speed, "too fast");
    require(!bounds.driven || seen.driven == 0,
            "driven on while too fast, " + std::to_string(std::lround(1e3 * seen.driven)) + " ms");
    if (!bounds.rest) return;
    require(seen.last_speed < kRest, "moves at the end");
    require(seen.last_changes < 5, "status changes at the end");
    require(seen.reversals < 0.2, "torque turns round at the end");
  }
};

/// Runs one scenario; throws std::runtime_error where the plugin refuses it.
using Act = std::function<void(const PluginFile& plugin, const TestArm& arm, Row& row)>;

struct Scenario {
  const char* point;  ///< of the issue's list
  const char* name;
  std::vector<std::string> arms;  ///< names; empty: all
  Act act;
  bool promised = true;  ///< or else what it breaks is shown, and does not count
};

inline Row run_scenario(const Scenario& scenario, const PluginFile& plugin, const TestArm& arm) {
  Row row;
  row.scenario = std::string(scenario.point) + " " + scenario.name;
  row.arm = arm.name;
  row.plugin = plugin.label;
  try {
    scenario.act(plugin, arm, row);
  } catch (const std::runtime_error& error) {
    row.note = std::string("refused: ") + error.what();
    row.seen.first_status = row.seen.last_status = "refused";
  }
  return row;
}

inline std::string number(double value, const char* format = "%.3g") {
  char text[32];
  std::snprintf(text, sizeof text, format, value);
  return text;
}

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

}  // namespace dashpot::stress
