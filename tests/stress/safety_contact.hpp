#pragma once
// Contact, references and gains: points 6, 7 and 9 of the list of what was seen.

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

/// Stops from 0.9 of the limits of all joints at a gap, and says what energy it put in.
inline void stop_all(const PluginFile& plugin, const TestArm& arm, RigOptions options,
                     const std::function<void(Rig&)>& spoil, const Bounds& bounds, Row& row) {
  options.velocity = 0.9 * limits_of(arm, &sim::Joint::velocity);
  options.world.viscous_friction = options.world.coulomb_friction = false;
  Rig rig(plugin, arm, options);
  spoil(rig);
  rig.run(rig.period());
  const double at_first = rig.kinetic();
  rig.skip_time(0.02);
  rig.run(3);
  row.finish(rig, bounds);
  row.kept = rig.kinetic() / at_first;
  row.note = "from " + number(at_first) + " J to " + number(rig.kinetic()) + " J; at the end " +
             row.seen.last_status.substr(0, 30);
}

/// States are so many periods late.
inline Act late_states(int periods, double share, bool rest) {
  return [=](const PluginFile& plugin, const TestArm& arm, Row& row) {
    stop_all(
        plugin, arm, {}, [periods](Rig& rig) { rig.late = periods; }, {share, rest, false}, row);
  };
}

/// Torque beyond the weight acts the other way.
inline void wrong_torque(const PluginFile& plugin, const TestArm& arm, Row& row) {
  stop_all(
      plugin, arm, {}, [](Rig& rig) { rig.excess_factor = -1; }, {100, false, false}, row);
  row.require(row.seen.last_status.find("brake does not stop") != std::string::npos,
              "never doubted");
}

/// The controller knows of rotors that are not there: 200 times the inertia of a light wrist.
inline void no_rotors(const PluginFile& plugin, const TestArm& arm, Row& row) {
  RigOptions options;
  options.told_rotors = 0.2;
  const auto leave = [](Rig&) {};
  stop_all(plugin, arm, options, leave, {10, false, false}, row);  // a light wrist shakes at first
  row.require(row.kept < 0.2, "goes on");
}

}  // namespace dashpot::stress
