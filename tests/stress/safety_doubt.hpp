#pragma once
// Causes by which a brake feeds the arm: states that are late, torques of the wrong sign, rotors
// that are configured but missing.

#include <dashpot/tests/stress/safety_scenarios.hpp>

namespace dashpot::stress {

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
