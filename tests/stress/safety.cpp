// Drives plugin files through every scenario that this project has seen go wrong, on several arms,
// of its own simulator and of MuJoCo (point M), and shows in one table what comes of it. The last
// plugin has to keep what is promised; the others are there to compare it with.
#include <dashpot/tests/stress/part.hpp>
#include <dashpot/tests/stress/safety_contact.hpp>
#include <dashpot/tests/stress/safety_engine.hpp>
#include <dashpot/tests/support/places.hpp>

namespace {

using namespace dashpot::stress;  // NOLINT(google-build-using-namespace)

std::vector<Scenario> scenarios() {
  using std::numbers::pi;
  const std::vector<std::string> lift = {"lift+gripper"};
  const std::vector<std::string> three = {"panda", "iiwa14", "ur5"};
  const std::vector<std::string> six = {"panda", "fr3", "iiwa14", "ur10e", "xarm7", "gen3"};
  std::vector<std::string> all;
  for (const TestArm& arm : test_arms()) all.emplace_back(arm.name);
  return {
      {"0", "joint 1 at 0.9 of its limit, a gap", all, stop_from(0.9, false)},
      {"0", "all joints at 0.9 of their limits, a gap", all, stop_from(0.9, true)},
      {"0", "the same, states 30 ms late", {}, late_states(30, 3, true)},
      {"0", "the same, states 100 ms late", {}, late_states(100, 100, false)},
      {"0", "the same, torque of the wrong sign", {}, wrong_torque},
      {"0", "the same, rotors told and not there", {}, no_rotors},
      {"1", "parked 60 deg outside (lift: 0.2 m)", {}, outside(pi / 3, 0.2, 0)},
      {"1", "5 deg outside (lift: 2 cm)", {}, outside(pi / 36, 0.02, 0)},
      {"1", "outside, moving inward at 3.7 x limit", {}, outside(pi / 3, 0.2, 3.7)},
      {"2", "light joint pressed to its limit", {}, light_joint_pressed},
      {"2", "light joint let go past its limit", {}, light_joint_let_go},
      {"2", "finger of 4 cm, left alone", lift, finger_at_rest},
      {"3", "encoder wraps by 2 pi", {}, encoder_off(-2 * pi)},
      {"3", "encoder slips by 0.5 rad", {}, encoder_off(-0.5)},
      {"4", "unstable gains", {}, unstable_gains},
      {"4", "wrench without springs", {}, wrench_without_springs},
      {"5", "feedback frozen", {}, bad_feedback(freeze, true)},
      {"5", "velocity always zero", {}, bad_feedback(no_velocity)},
      {"5", "velocity of the wrong sign", {}, bad_feedback(wrong_sign)},
      {"5", "hard jolts at the wrist", {}, hard_jolts},
      {"6", "table, goal 15 cm below", three, table(0.15)},
      {"6", "table, goal 20 cm below", three, table(0.2)},
      {"6", "springy plane, goal 15 cm below", {}, table(0.15, true)},
      {"6", "springy plane, goal 20 cm below", {}, table(0.2, true)},
      {"7", "40 moves of the tip, all defaults", {}, default_moves},
      {"7", "a move past a joint limit", {"fr3"}, past_a_limit},
      {"7", "upright, pulled outward", {"iiwa14", "iiwa7"}, upright},
      {"7", "toward a stretched arm", {}, stretched},
      {"9", "K = 50000, D = 0, alternating goals", {}, stiff_undamped},
      {"9", "D = 5000 at rest", {}, over_damped},
      {"M", "a gap at rest, then 9 s", six, on_variants(gap_at_rest), false},
      {"M", "set-points end", six, on_variants(setpoints_end), false},
      {"M", "state not finite for 0.5 s", six, on_variants(lost_state(false)), false},
      {"M", "state without a joint for 0.5 s", six, on_variants(lost_state(true)), false},
      {"M", "stops, torque_rate 1000", six, on_variants(stop_with(1000)), false},
      {"M", "stops, torque_rate 5000", six, on_variants(stop_with(5000)), false},
      {"M", "shoulder motor dead", six, on_variants(bad_motor(0))},
      {"M", "shoulder motor at half", six, on_variants(bad_motor(0.5)), false},
      {"M", "shoulder motor reversed", six, on_variants(bad_motor(-1))},
      {"M", "150 N on the elbow after a gap", six, on_variants(lean_on_the_elbow), false},
      {"M", "velocity of the wrong sign", six, on_variants(wrong_velocity), false},
      {"M", "robot's brakes open late", six, on_variants(brakes_open_late), false},
      {"M", "slow starts, 18 bits", six, on_variants(slow_starts(18))},
      {"M", "slow starts, 12 bits", six, on_variants(slow_starts(12))},
      {"M", "pushes of 40 N", six, on_variants(pushes), false},
  };
}

void print(const Row& row, bool first, bool promised) {
  const Measures& seen = row.seen;
  std::printf("%-40s %-14s %-7s %8.2f %8.2f %8.2f %6.0f %7d %5s  %-32.32s %s\n",
              first ? row.scenario.c_str() : "", first ? row.arm.c_str() : "", row.plugin.c_str(),
              seen.speed_share, seen.tip_speed, seen.kinetic_energy, 100 * seen.reversals,
              seen.changes, seen.last_speed < kRest ? "yes" : "no", seen.first_status.c_str(),
              row.note.c_str());
  std::string broken;
  if (seen.refused_goals > 0) broken = std::to_string(seen.refused_goals) + " goals refused";
  for (const std::string& what : row.broken) broken += (broken.empty() ? "" : "; ") + what;
  if (!broken.empty()) std::printf("%64s%c %s\n", "", promised ? '!' : '?', broken.c_str());
  std::fflush(stdout);
}

bool chosen(const Scenario& scenario, const TestArm& arm) {
  if (scenario.arms.empty()) return !arm.named_only;
  return std::find(scenario.arms.begin(), scenario.arms.end(), arm.name) != scenario.arms.end();
}

bool drive_plugins(const Request& request) {
  std::vector<PluginFile> plugins;
  for (const std::string& word : request.plugins) {
    const std::size_t equals = word.find('=');
    const bool labelled = equals != std::string::npos;
    plugins.emplace_back(labelled ? word.substr(0, equals) : "today",
                         labelled ? word.substr(equals + 1) : word);
  }
  if (plugins.empty()) plugins.emplace_back("today", DASHPOT_PLUGIN);
  std::printf("%-40s %-14s %-7s %8s %8s %8s %6s %7s %5s  %-32s\n", "", "", "", "joint", "tip",
              "kinetic", "turns", "changes", "", "");
  std::printf("%-40s %-14s %-7s %8s %8s %8s %6s %7s %5s  %-32s %s\n", "scenario", "arm", "plugin",
              "/ limit", "m/s", "J", "%", "", "rest", "first status", "");
  std::size_t broken = 0, rows = 0;
  for (const Scenario& scenario : scenarios()) {
    std::size_t arms = 0;
    for (const TestArm& arm : test_arms()) {
      const bool stop = scenario.point[0] == '0';
      if (!chosen(scenario, arm) || (request.brief && !stop && ++arms > 1)) continue;
      for (const PluginFile& plugin : plugins) {
        const Row row = run_scenario(scenario, plugin, arm);
        print(row, &plugin == &plugins.front(), scenario.promised);
        if (&plugin != &plugins.back()) continue;
        ++rows;
        broken += row.broken.empty() || !scenario.promised ? 0 : 1;
      }
    }
  }
  std::printf("\n%s: %zu of %zu rows break what is promised\n", plugins.back().label.c_str(),
              broken, rows);
  return broken == 0;
}

const AddPart part({"safety",
                    11,
                    "Drive plugins through everything that was seen to go wrong, on several "
                    "simulated arms, or with --short all but stops on one",
                    "",
                    {{0, 0}},
                    drive_plugins,
                    {"PLUGIN"}});

}  // namespace
