#pragma once
// One row of the table of ./run stress safety: a scenario on an arm under a plugin.

#include <dashpot/tests/stress/safety_rig.hpp>

#include <functional>
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

}  // namespace dashpot::stress
