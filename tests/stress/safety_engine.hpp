#pragma once
// The motion after a stop, and needless stops, on robots that another engine moves, MuJoCo: with
// rotors that the controller knows or does not, dry friction or none, links and bodies that weigh
// more or less than it knows.

#include <dashpot/controller/drives.hpp>
#include <dashpot/tests/stress/safety_scenarios.hpp>

#include <map>

namespace dashpot::stress {

/// Differences of a robot from its controller's model.
struct Variant {
  bool rotors_known;
  bool friction;       ///< kFriction of the torque limits each: dry, and viscous at full speed
  double link_factor;  ///< of masses
  double payload;      ///< kg, not known to the controller
};

constexpr double kFriction = 0.01;
constexpr double kStiction = 0.04;   ///< in slow starts, as in the wrist of a Panda
constexpr double kDoubtTime = 0.15;  ///< s after a velocity limit
constexpr double kGivenBack = 0.01;  ///< of the kinetic energy at first

inline const std::vector<Variant>& variants() {
  static const std::vector<Variant> all = {
      {true, true, 1, 0},     {true, true, 1.1, 0},   {true, true, 0.9, 0},  {true, true, 1, 3},
      {true, false, 1.1, 0},  {true, false, 1, 3},    {false, true, 1.1, 0}, {false, true, 1, 1},
      {false, false, 0.9, 0}, {false, false, 1.1, 3},
  };
  return all;
}

inline std::string name_of(const Variant& variant) {
  return std::string(variant.rotors_known ? "rotors known" : "rotors unknown") +
         (variant.friction ? "" : ", no friction") + ", mass x " + number(variant.link_factor) +
         ", " + number(variant.payload) + " kg";
}

inline int elbow_of(const TestArm& arm) {
  return arm.start.size() == 7 ? 3 : 2;
}

inline RigOptions options_of(const TestArm& arm, const Variant& variant) {
  const JointVector torque = limits_of(arm, &sim::Joint::effort);
  const controller::Drives& drives =
      controller::find_drives(arm.file, static_cast<int>(torque.size()));
  RigOptions options;
  options.start = start_of(arm);
  options.truth.reflected_inertia = drives.values(drives.reflected_inertia);
  options.truth.coulomb_friction = variant.friction * kFriction * torque;
  options.truth.viscous_friction =
      options.truth.coulomb_friction.cwiseQuotient(limits_of(arm, &sim::Joint::velocity));
  options.mujoco.emplace();
  options.mujoco->link_factor = variant.link_factor;
  options.mujoco->payload = {
      variant.payload, {0, 0, 0.05}, 1e-3 * variant.payload * Eigen::Matrix3d::Identity()};
  if (variant.rotors_known) options.robot = std::string("  drives: ") + arm.file + "\n";
  return options;
}

/// Runs a scenario with one variant; returns how bad it was, in a number that goes into the row's
/// note.
using Trial = std::function<double(const PluginFile&, const TestArm&, RigOptions, Row&)>;

/// The worst of some rows, with the promises that any of them broke.
struct Worst {
  double bad = -1;
  Row row;
  std::map<std::string, int> broken;  ///< in how many rows

  void add(const Row& one, double how_bad) {
    for (const std::string& what : one.broken) ++broken[what.substr(0, what.find(','))];
    if (how_bad <= bad) return;
    bad = how_bad;
    row = one;
  }
};

/// Does it with all variants, and shows the worst one.
inline Act on_variants(const Trial& trial) {
  return [trial](const PluginFile& plugin, const TestArm& arm, Row& row) {
    if (!testing::MujocoArm::available()) throw std::runtime_error("no MuJoCo (libmujoco-dev)");
    Worst worst;
    for (const Variant& variant : variants()) {
      Row one = row;
      double bad = 0;
      try {
        bad = trial(plugin, arm, options_of(arm, variant), one);
      } catch (const std::runtime_error& error) {
        one.note = std::string("refused: ") + error.what();
        one.require(false, one.note);
      }
      one.note += " (" + name_of(variant) + ")";
      worst.add(one, bad);
    }
    row = worst.row;
    row.broken.clear();
    for (const auto& [what, count] : worst.broken) {
      row.broken.push_back(what + " (" + std::to_string(count) + " of " +
                           std::to_string(variants().size()) + ")");
    }
  };
}

/// Notes how far the tip has moved, in cm, 1, 4 and 9 s later.
inline double watch_it_sink(Rig& rig, Row& row) {
  const Eigen::Vector3d from = rig.tip_at(rig.position()).position;
  std::string ways;
  double way = 0;
  for (const double seconds : {1.0, 3.0, 5.0}) {
    rig.run(seconds);
    way = 100 * (rig.tip_at(rig.position()).position - from).norm();
    ways += (ways.empty() ? "" : ", ") + number(way, "%.1f");
  }
  row.finish(rig, {1, false, true});
  row.note = "sinks " + ways + " cm after 1, 4, 9 s";
  row.require(way < 3, "sinks");
  return way;
}

inline double gap_at_rest(const PluginFile& plugin, const TestArm& arm, const RigOptions& options,
                          Row& row) {
  Rig rig(plugin, arm, options);
  rig.run(1);
  rig.skip_time(0.02);
  return watch_it_sink(rig, row);
}

inline double setpoints_end(const PluginFile& plugin, const TestArm& arm, const RigOptions& options,
                            Row& row) {
  Rig rig(plugin, arm, options);
  rig.goal = Goal::joints(rig.position());
  rig.run(1);
  rig.goal.reset();
  return watch_it_sink(rig, row);
}

/// From 1 s on the states are not finite, or lack a joint, for half a second.
inline Trial lost_state(bool wrong_size) {
  return [=](const PluginFile& plugin, const TestArm& arm, RigOptions options, Row& row) {
    sim::SensorFault fault;
    fault.begin = 1;
    fault.end = 1.5;
    fault.not_a_number = true;
    if (!wrong_size) options.plant.faults = {fault};
    Rig rig(plugin, arm, options);
    rig.run(1);
    rig.measure_afresh();
    rig.missing = wrong_size ? 1 : 0;
    rig.run(0.5);
    rig.missing = 0;
    const double speed = rig.seen.tip_speed;
    rig.run(1.5);
    row.finish(rig, {1, true, true});
    row.note =
        "tip at " + number(speed) + " m/s after 0.5 s, " + number(row.seen.tip_speed) + " at most";
    row.require(speed < 0.25, "falls");
    return row.seen.tip_speed;
  };
}

/// A stop from 0.9 of the velocity limit of joint 2, either way, and of all joints, with the elbow
/// half straight, and a payload that the controller knows of if there is none that it does not. The
/// kinetic energy may fall only.
inline Trial stop_with(double rate) {
  return [=](const PluginFile& plugin, const TestArm& arm, RigOptions options, Row& row) {
    const double mass = std::string(arm.name) == "ur10e" ? 10 : 2;
    const double known = options.mujoco->payload.mass > 0 ? 0 : mass;
    options.start[elbow_of(arm)] *= 0.4;
    const JointVector fastest = 0.9 * limits_of(arm, &sim::Joint::velocity);
    options.limits =
        "  torque_rate: " + yaml_list(JointVector::Constant(fastest.size(), rate)) + "\n";
    if (known > 0) {
      options.robot += "  payload: {mass: " + number(known) + ", center: [0, 0, 0.05], inertia: [" +
                       number(1e-3 * known) + ", " + number(1e-3 * known) + ", " +
                       number(1e-3 * known) + "]}\n";
      options.mujoco->payload = {known, {0, 0, 0.05}, 1e-3 * known * Eigen::Matrix3d::Identity()};
    }
    Worst worst;
    for (const double turn : {1.0, -1.0, 0.0}) {
      options.velocity = turn == 0 ? fastest : JointVector(JointVector::Zero(fastest.size()));
      if (turn != 0) options.velocity[1] = turn * fastest[1];
      Rig rig(plugin, arm, options);
      rig.run(rig.period());
      rig.skip_time(0.02);
      const double first = rig.kinetic();
      double least = first, given_back = 0, slow = 0;
      for (int tick = 1; tick <= 1500; ++tick) {
        rig.run(rig.period());
        least = std::min(least, rig.kinetic());
        given_back = std::max(given_back, (rig.kinetic() - least) / first);
        if (rig.kinetic() > 0.01 * first) slow = tick * rig.period();
      }
      Row one = row;
      one.finish(rig, {1.1, true, true});
      one.note = "from " + number(first) + " J, " + number(100 * given_back, "%.1f") +
                 " % given back; a tenth of the speed after " + number(slow) + " s";
      one.require(given_back < kGivenBack, "gives energy back");
      worst.add(one, given_back);
    }
    row = worst.row;
    row.broken.clear();
    for (const auto& [what, count] : worst.broken) row.broken.push_back(what);
    return worst.bad;
  };
}

/// The shoulder's motor gives so many times its torque from 0.5 s on.
inline Trial bad_motor(double factor) {
  return [=](const PluginFile& plugin, const TestArm& arm, const RigOptions& options, Row& row) {
    Rig rig(plugin, arm, options);
    rig.run(0.5);
    rig.measure_afresh();
    rig.spoil_motor(1, factor);
    double limit = -1, doubt = -1;
    for (int tick = 1; tick <= 2000 && doubt < 0; ++tick) {
      rig.run(rig.period());
      if (limit < 0 && rig.seen.speed_share > 1) limit = tick * rig.period();
      const std::string& status = rig.seen.last_status;
      if (status.find("brake does not stop") != std::string::npos) doubt = tick * rig.period();
    }
    row.finish(rig, {100, false, false});
    row.note =
        (limit < 0 ? "never beyond a velocity limit" : "too fast after " + number(limit) + " s") +
        (doubt < 0 ? std::string(", never doubted") : ", doubted after " + number(doubt) + " s") +
        ", tip at " + number(row.seen.tip_speed) + " m/s";
    const double late = (doubt < 0 ? 2 : doubt) - limit;
    row.require(limit < 0 || late <= kDoubtTime, "doubted too late");
    return row.seen.tip_speed;
  };
}

/// After a gap somebody leans on the elbow with 150 N for 2 s.
inline double lean_on_the_elbow(const PluginFile& plugin, const TestArm& arm,
                                const RigOptions& options, Row& row) {
  Rig rig(plugin, arm, options);
  rig.run(0.5);
  rig.skip_time(0.02);
  rig.run(1);
  const JointVector from = rig.position();
  const int elbow = elbow_of(arm);
  rig.mujoco().push(elbow, Eigen::Vector3d::Zero(), {0, 150, 0});
  rig.run(2);
  const JointVector pushed = rig.position();
  rig.mujoco().push(elbow, Eigen::Vector3d::Zero(), Eigen::Vector3d::Zero());
  rig.run(2);
  row.finish(rig, {1.05, false, true});
  const double degrees = 180 / std::numbers::pi;
  const double turned = degrees * (pushed - from).cwiseAbs().maxCoeff();
  const double after = degrees * (rig.position() - pushed).cwiseAbs().maxCoeff();
  row.note = "a joint turns " + number(turned, "%.0f") + " deg, and " + number(after, "%.0f") +
             " afterwards";
  row.require(after < 10, "goes on when it is let go");
  return turned;
}

/// From 0.5 s on, in a motion of the joints, velocities have the wrong sign.
inline double wrong_velocity(const PluginFile& plugin, const TestArm& arm, RigOptions options,
                             Row& row) {
  sim::SensorFault fault;
  fault.begin = 0.5;
  wrong_sign(fault, options.start.size());
  options.plant.faults = {fault};
  Rig rig(plugin, arm, options);
  JointVector to = moved(rig.position(), 0, 0.8);
  to[1] += 0.4;
  rig.goal = Goal::joints(to);
  rig.run(0.5);
  double found = -1, still = 0;
  for (int tick = 1; tick <= 2000; ++tick) {
    rig.run(rig.period());
    if (found < 0 && rig.faulted) found = tick * rig.period();
    const JointVector speed = rig.plant().velocity().cwiseQuotient(rig.limits().velocity);
    if (speed.cwiseAbs().maxCoeff() > 0.05) still = tick * rig.period();
  }
  row.finish(rig, {1, true, false});
  row.note = "found after " + number(found) + " s, still after " + number(still);
  row.require(found >= 0, "never noticed");
  return still;
}

/// The robot's brakes hold it for 2 s, in which noise hides that it does not follow its goal.
inline double brakes_open_late(const PluginFile& plugin, const TestArm& arm, RigOptions options,
                               Row& row) {
  const auto n = options.start.size();
  options.config = "control: {mode: cartesian}\n";
  options.plant.position_noise = JointVector::Constant(n, 1e-5);
  options.plant.velocity_noise = JointVector::Constant(n, 1e-3);
  Rig rig(plugin, arm, options);
  rig.goal = Goal::at(rig.tip_at(rig.position()));
  rig.guide(rig.position(), 0.5);
  rig.goal->tip.position.z() -= 0.15;
  rig.guide(rig.position(), 2);
  rig.measure_afresh();
  rig.run(2);
  row.finish(rig, {1, false, true});
  row.note = "the tip leaps with " + number(row.seen.tip_speed) + " m/s";
  row.require(row.seen.tip_speed < 0.5, "leaps");
  return row.seen.tip_speed;
}

/// Slow moves of one joint of the wrist, back and forth from rest, through kStiction of its torque
/// limit. Encoders have so many bits; where these are few velocities are measured by themselves.
inline Trial slow_starts(int bits) {
  return [=](const PluginFile& plugin, const TestArm& arm, RigOptions options, Row& row) {
    if (options.truth.coulomb_friction.isZero() || options.mujoco->payload.mass > 0) return -1.0;
    options.truth.coulomb_friction *= kStiction / kFriction;
    const auto n = options.start.size();
    options.plant.position_resolution =
        JointVector::Constant(n, 2 * std::numbers::pi / std::exp2(bits));
    options.plant.difference_velocity = bits > 16;
    options.velocity_step = bits > 16 ? 0 : 1e-3;
    Rig rig(plugin, arm, options);
    JointVector goal = rig.position();
    int faults = 0;
    for (const double rate : {0.02, -0.02, 0.02}) {  // rad/s
      for (int k = 0; k < 30 && faults == 0; ++k) {
        if (k >= 5) goal[n - 3] += 0.1 * rate;
        rig.goal = Goal::joints(goal);
        rig.run(0.1);
        faults += rig.faulted ? 1 : 0;
      }
    }
    row.finish(rig, {1, false, true});
    row.note = faults > 0 ? "a fault: " + row.seen.last_status.substr(0, 40) : "no fault";
    row.require(faults == 0, "a fault without need");
    return static_cast<double>(faults);
  };
}

/// A hand pushes the tip with 40 N for 0.7 s, six times.
inline double pushes(const PluginFile& plugin, const TestArm& arm, RigOptions options, Row& row) {
  options.config = "control: {mode: cartesian}\n";
  constexpr int kPushes = 6;
  for (int i = 0; i < kPushes; ++i) {
    controller::Vector6 push = controller::Vector6::Zero();
    push[i % 3] = i < 3 ? 40 : -40;
    options.world.wrenches.push_back({1 + 1.5 * i, 1.7 + 1.5 * i, push});
  }
  Rig rig(plugin, arm, options);
  rig.goal = Goal::at(rig.tip_at(rig.position()));
  rig.run(1 + 1.5 * kPushes);
  row.finish(rig, {1, false, true});
  row.note = rig.faulted ? "a fault: " + row.seen.last_status.substr(0, 40) : "no fault";
  row.require(!rig.faulted, "a fault without need");
  return row.seen.speed_share;
}

}  // namespace dashpot::stress
