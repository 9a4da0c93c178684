#pragma once
// Contact, references, gains and timing: points 6, 7, 9 and 10 of the list of what was seen.

#include <dashpot/tests/stress/safety_scenarios.hpp>

#include <random>

namespace dashpot::stress {

/// The tip is held, at first where the arm starts.
inline RigOptions cartesian(const JointVector& start = {}) {
  RigOptions options;
  options.config = "control: {mode: cartesian}\n";
  options.start = start;
  return options;
}

/// The tip is to go `depth` below a table that stands 3 cm below it, a springy one without friction
/// in the arm if it is `smooth`.
inline Act table(double depth, bool smooth = false) {
  return [=](const PluginFile& plugin, const TestArm& arm, Row& row) {
    RigOptions options = cartesian();
    options.config += std::string("gains:\n  task: {stiffness: [1500, 1500, 1500, ") +
                      (smooth ? "80, 80, 80" : "30, 30, 30") + "], damping_ratio: 0.7}\n";
    sim::Wall wall;
    wall.point = sim::Arm(simulated_robot(arm)).tip_pose(start_of(arm)).position;
    wall.point.z() -= 0.03;
    wall.contact = smooth ? sim::Contact{1e4, 50} : sim::Contact{2e4, 200};
    options.world.wall = wall;
    options.world.viscous_friction = options.world.coulomb_friction = !smooth;
    Rig rig(plugin, arm, options);
    rig.goal = Goal::at(rig.tip_at(rig.position()));
    rig.goal->tip.position.z() -= 0.03 + depth;
    rig.run(8);
    // A springy plane throws a light wrist when the springs end.
    row.finish(rig, {smooth ? 4 : 1.1, true, true});
    row.note = std::to_string(row.seen.changes) + " changes of status";
  };
}

/// Moves of the tip from one random posture to another.
inline void default_moves(const PluginFile& plugin, const TestArm& arm, Row& row) {
  constexpr int kMoves = 40;
  std::mt19937_64 engine(1);
  const auto uniform = [&engine](double low, double high) {
    return std::uniform_real_distribution<double>(low, high)(engine);
  };
  int faults = 0, missed = 0;
  Measures worst;
  for (int move = 0; move < kMoves; ++move) {
    RigOptions options = cartesian(start_of(arm));
    JointVector to = options.start;
    const sim::Robot robot = simulated_robot(arm);
    for (int i = 0; i < robot.dof(); ++i) {
      const sim::Joint& joint = robot.joints()[static_cast<std::size_t>(i)];
      const double lower = std::max(joint.lower, -2.5), upper = std::min(joint.upper, 2.5);
      const double middle = 0.5 * (lower + upper), half = 0.4 * (upper - lower);
      options.start[i] = middle + half * uniform(-1, 1);
      to[i] = std::clamp(options.start[i] + half * uniform(-1, 1), middle - half, middle + half);
    }
    Rig rig(plugin, arm, options);
    rig.goal = Goal::at(rig.tip_at(to));
    rig.run(4);
    row.finish(rig, {1, false, true});
    faults += rig.faulted ? 1 : 0;
    missed += (rig.tip_at(rig.position()).position - rig.goal->tip.position).norm() > 0.02 ? 1 : 0;
    if (move == 0 || row.seen.speed_share > worst.speed_share) worst = row.seen;
  }
  row.seen = worst;
  std::sort(row.broken.begin(), row.broken.end());
  row.broken.erase(std::unique(row.broken.begin(), row.broken.end()), row.broken.end());
  row.note = std::to_string(faults) + " faults, " + std::to_string(missed) +
             " goals missed by 2 cm, of " + std::to_string(kMoves);
  row.require(faults == 0, "a fault in a move");
}

/// The tip goes to the pose of a posture that is not far, by way of a joint limit.
inline void past_a_limit(const PluginFile& plugin, const TestArm& arm, Row& row) {
  JointVector from(7), to(7);
  from << -0.882, -0.915, -0.314, -1.785, 1.04, 2.137, 1.217;
  to << -2, -0.095, -2, -2.265, 1.843, 1.859, 2;
  Rig rig(plugin, arm, cartesian(from));
  rig.goal = Goal::at(rig.tip_at(to));
  rig.run(6);
  row.finish(rig, {1, false, true});
  row.require(!rig.faulted, "a fault in a move");
}

/// Upright, and pulled outward.
inline void upright(const PluginFile& plugin, const TestArm& arm, Row& row) {
  Rig rig(plugin, arm, cartesian(JointVector::Constant(start_of(arm).size(), 0.01)));
  rig.goal = Goal::at(rig.tip_at(rig.position()));
  rig.goal->tip.position.x() += 0.4;
  rig.run(6);
  row.finish(rig, {1, false, true});
  row.require(!rig.faulted, "a fault in a move");
}

/// Straight out, to 10 cm beyond where the arm ends.
inline void stretched(const PluginFile& plugin, const TestArm& arm, Row& row) {
  Rig rig(plugin, arm, cartesian());
  rig.goal = Goal::at(rig.tip_at(rig.position()));
  Eigen::Vector3d out = rig.goal->tip.position;
  out.z() = 0;
  rig.goal->tip.position += 0.6 * out.normalized();
  rig.run(6);
  row.finish(rig, {1.05, false, true});  // it creeps along the singularity for long
  row.note = std::to_string(row.seen.changes) + " changes of status";
}

/// Commands within what is accepted: hard springs without damping, and a goal that alternates.
inline void stiff_undamped(const PluginFile& plugin, const TestArm& arm, Row& row) {
  Rig rig(plugin, arm, cartesian());
  rig.run(0.1);
  const Eigen::MatrixXd D = Eigen::MatrixXd::Zero(6, 6);
  Eigen::MatrixXd K = D;
  K.diagonal() << 50000, 50000, 50000, 500, 500, 500;
  const bool taken = rig.set_gains(K, D, true) == DASHPOT_OK;
  rig.goal = Goal::at(rig.tip_at(rig.position()));
  const Eigen::Vector3d middle = rig.goal->tip.position;
  for (int i = 0; i < 12; ++i) {
    rig.goal->tip.position = middle + Eigen::Vector3d(0, i % 2 == 0 ? 0.2 : -0.2, 0);
    rig.run(0.3);
  }
  row.finish(rig, {1.5, false, true});
  row.note = taken ? "gains taken" : "gains refused";
}

inline void over_damped(const PluginFile& plugin, const TestArm& arm, Row& row) {
  Rig rig(plugin, arm, cartesian());
  rig.run(0.1);
  Eigen::MatrixXd K = Eigen::MatrixXd::Zero(6, 6), D = K;
  K.diagonal() << 1000, 1000, 1000, 50, 50, 50;
  D.diagonal() << 5000, 5000, 5000, 5000, 5000, 5000;
  const bool taken = rig.set_gains(K, D, true) == DASHPOT_OK;
  rig.run(3);
  row.finish(rig, {1.5, true, true});
  row.note = taken ? "gains taken" : "gains refused";
}

/// Every so many periods a state, each with its right time.
inline Act slow_loop(int every) {
  return [every](const PluginFile& plugin, const TestArm& arm, Row& row) {
    Rig rig(plugin, arm, {});
    rig.every = every;
    JointVector to = moved(rig.position(), arm.joint, slides(arm, arm.joint) ? 0.1 : 0.4);
    rig.goal = Goal::joints(to);
    rig.run(6);
    row.finish(rig, {1.5, true, true});
    row.require(row.seen.first_status != "ok", "never noticed");
  };
}

inline void reset_in_motion(const PluginFile& plugin, const TestArm& arm, Row& row) {
  Rig rig(plugin, arm, {});
  JointVector to = moved(rig.position(), arm.joint, slides(arm, arm.joint) ? 0.2 : 1.0);
  to[1] -= 0.3;
  rig.goal = Goal::joints(to);
  rig.run(1);
  rig.goal.reset();
  rig.measure_afresh();
  rig.reset(nullptr);
  rig.run(0.003);
  const double step = rig.seen.torque_step;
  rig.run(3);
  row.finish(rig, {1.2, false, true});
  row.note = "torque steps by " + number(step) + " N m, carries " +
             number(100 * row.seen.least_weight, "%.0f") + " % of the weight at least";
  row.require(step <= 1.01 * rig.limits().torque_rate.maxCoeff() * rig.period(), "torque steps");
  row.require(row.seen.least_weight > 0.7, "drops the weight");
}

inline void untold_weight(const PluginFile& plugin, const TestArm& arm, Row& row) {
  RigOptions options;
  options.told_weight = false;
  Rig rig(plugin, arm, options);
  rig.run(3);
  row.finish(rig, {1, true, true});
  row.note = "sags " + number(1e3 * row.seen.tip_moved) + " mm";
  row.require(row.seen.tip_moved < 2e-3, "sags at the start");
}

/// Every torque limit at half of the largest weight.
inline void too_weak(const PluginFile& plugin, const TestArm& arm, Row& row) {
  RigOptions options;
  const double heaviest = Rig(plugin, arm, {}).weight(start_of(arm)).cwiseAbs().maxCoeff();
  const JointVector most = limits_of(arm, &sim::Joint::effort).cwiseMin(0.5 * heaviest);
  options.limits = "  torque: " + yaml_list(most) + "\n";
  Rig rig(plugin, arm, options);
  rig.run(4);
  row.finish(rig, {1e9, false, false});
  row.note = "falls " + number(1e3 * row.seen.tip_moved) + " mm; at the end " +
             row.seen.last_status.substr(0, 30);
  row.require(row.seen.first_status.find("torque limited") == std::string::npos &&
                  row.seen.first_status.find("torque rate limited") == std::string::npos,
              "not noticed at first");
}

}  // namespace dashpot::stress
