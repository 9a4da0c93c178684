// `dashpot run` in fast motion: a whole robot, its controller as a plugin, and the output.
#include <dashpot/controller/dynamics.hpp>
#include <dashpot/tests/apps/scene_run.hpp>
#include <dashpot/tests/support/arms.hpp>
#include <dashpot/tests/support/places.hpp>
#include <dashpot/tests/support/sanitized.hpp>

#include <gtest/gtest.h>

#include <Eigen/LU>
#include <cmath>
#include <filesystem>
#include <numbers>
#include <sstream>

namespace dashpot::tests {
namespace {

using ::testing::AllOf;
using ::testing::HasSubstr;
using ::testing::StartsWith;

class EveryScene : public ::testing::TestWithParam<std::string> {};

TEST_P(EveryScene, RunsWithoutAnOverrunAndAccountsForItsEnergy) {
  const Json result = run_json(scene(GetParam()), {"--duration", "1"});
  EXPECT_EQ(result["ticks"], 1000);
  EXPECT_EQ(result["messages"]["states"], 1000);
  EXPECT_EQ(result["messages"]["states_dropped"], 0);
  EXPECT_GT(result["messages"]["modes"].get<int>(), 10);
  EXPECT_FALSE(result["modes"]["start"].empty());
  for (const Json& mode : result["modes"]["end"]) {
    EXPECT_LT(mode["error_bound"].get<double>(), 1e-6);
    EXPECT_NE(mode["kind"], "unstable");
  }
  for (const auto& [status, ticks] : result["status"].items()) {
    EXPECT_THAT(
        (std::vector<std::string>{"ok", "torque, torque rate, power, speed or energy limited"}),
        ::testing::Contains(status));
    EXPECT_GT(ticks.get<int>(), 0);
  }
  EXPECT_LT(std::abs(result["energy"]["imbalance"].get<double>()), 1e-6);
}

INSTANTIATE_TEST_SUITE_P(Scenes, EveryScene,
                         ::testing::Values("panda", "panda_release_c1", "panda_release_c2",
                                           "panda_release_ratio_damping", "panda_push_free",
                                           "panda_push_held", "panda_pick_up", "panda_late_torque",
                                           "panda_projector", "panda_projector_switch", "iiwa14",
                                           "iiwa14_knocks", "ur5", "baxter_left", "touch"));

TEST(Release, IsToldWithTheSharesOfItsModes) {
  const Json release = run_json(scene("panda_release_c1"), {"--duration", "0.01"})["release"];
  double sum = 0;
  for (const Json& share : release["shares"]["energy"]) sum += share.get<double>();
  EXPECT_NEAR(sum, 1, 1e-12);
  // The tip was displaced by 2 cm along y, and a slow mode has most of that.
  EXPECT_NEAR(release["modes"][4]["natural_frequency"].get<double>(), 10.92, 0.01);
  EXPECT_GT(release["shares"]["energy"][4].get<double>(), 0.8);
  EXPECT_NEAR(release["shares"]["amplitude"][4][1].get<double>(), 0.0165, 1e-4);
  EXPECT_FALSE(run_json(scene("panda_pick_up"), {"--duration", "0.01"}).contains("release"));
}

TEST(Scenes, AreAllTested) {
  std::size_t files = 0;
  for (const auto& entry :
       std::filesystem::directory_iterator(std::string(DASHPOT_SOURCE_DIR) + "/sim/scenes")) {
    files += entry.path().extension() == ".yaml" ? 1 : 0;
  }
  EXPECT_EQ(files, 15U);  // as in EveryScene
}

/// The ratio of the scene shakes the arm where it is stretched out, unless it is lowered there.
TEST(Run, LowersARatioBeforeTheArmShakes) {
  const Scratch scratch;
  const std::string csv = scratch.path("lowered.csv");
  const Json lowered = run_json(scene("panda_late_torque"), {"--csv", csv});
  EXPECT_EQ(lowered["faults"], 0);
  EXPECT_EQ(lowered["status"]["ok"], lowered["ticks"]);
  EXPECT_GT(lowered["least_damping_level"].get<double>(), 0.1);
  EXPECT_LT(lowered["least_damping_level"].get<double>(), 0.5);
  EXPECT_LT(lowered["largest_tracking_error"]["joint"].get<double>(), 0.1);
  for (const char* end : {"start", "end"}) {  // drawn in, with friction of 0.01 N m s/rad
    EXPECT_NEAR(lowered["modes"][end][0]["damping_ratio"], 2, 0.01);
  }
  // The same scene gives the same bits, whether or not states and modes are published.
  run_scene(scene("panda_late_torque"),
            {"--csv", scratch.path("again.csv"), "--log", scratch.path("a.lcm")});
  EXPECT_EQ(text_of(csv), scratch.read("again.csv"));
  const Json asked = run_json(
      changed(scratch, "panda_late_torque", "scenario:", "limits: {gain_margin: 1}\nscenario:"));
  EXPECT_EQ(asked["least_damping_level"], 1);
  EXPECT_GT(asked["faults"], 0);
}

// Modes 2 and 3 are closer to each other than the held torque moves them.
TEST(Run, FindsCloseModesWhereTheSampledLoopHasThem) {
  DASHPOT_SKIP_IF_QUICK();
  const Json result = run_json(scene("panda_pick_up"), {"--ring-down"});
  const Json& modes = result["ring_down"]["modes"];
  for (const std::size_t i : {1U, 2U}) {
    const double sampled = modes[i]["sampled_frequency"];
    ASSERT_TRUE(modes[i]["measured_frequency"].is_number());
    EXPECT_NEAR(modes[i]["measured_frequency"].get<double>(), sampled, 1e-3 * sampled);
  }
}

// Table 1 of the paper: 20.25, 10.98, 9.755 rad/s with 0.0255, 0.0316, 0.0294 (C1), 20.23, 10.95,
// 11.17 with 0.2235, 0.2032, 0.2288 (C2). Its hand is a little heavier than the model's.
TEST(Run, ShowsTheReleasesOfThePaper) {
  DASHPOT_SKIP_IF_QUICK();
  const std::pair<const char*, Rows> paper[] = {
      {"panda_release_c1", {{20.25, 0.0255}, {10.98, 0.0316}, {9.755, 0.0294}}},
      {"panda_release_c2", {{20.23, 0.2235}, {11.17, 0.2288}, {10.95, 0.2032}}}};
  for (const auto& [name, slow] : paper) {
    const Json modes = run_json(scene(name), {"--ring-down"})["ring_down"]["modes"];
    for (std::size_t i = 0; i < 3; ++i) {
      const Json& mode = modes.at(3 + i);
      const double frequency = mode["sampled_frequency"], ratio = mode["sampled_ratio"];
      EXPECT_NEAR(mode["measured_frequency"], frequency, 1e-4 * frequency);
      EXPECT_NEAR(mode["measured_ratio"], ratio, 5e-5);
      EXPECT_NEAR(mode["predicted_frequency"], slow[i][0], 0.009 * slow[i][0]);
      EXPECT_NEAR(mode["predicted_ratio"], slow[i][1], 0.0027);
    }
  }
}

// A struck arm drifts along its zero mode u by (u' M v) / (u' C u), unless springs hold its
// posture.
TEST(Run, LeavesAStruckArmWhereItsZeroModePredicts) {
  const auto rest_of = [](const std::string& name) {
    const Scratch scratch;
    run_json(scene(name), {"--csv", scratch.path("csv")});
    const std::string text = scratch.read("csv");
    std::istringstream last(text.substr(text.rfind('\n', text.size() - 2) + 1));
    Eigen::VectorXd q(7);
    char comma = 0;
    double time = 0;
    last >> time;
    for (double& angle : q) last >> comma >> angle;
    return q;
  };
  const controller::RobotModel model = testing::panda_model();
  constexpr double kTurn = std::numbers::pi;
  const controller::JointVector start{{0, -kTurn / 4, 0, -3 * kTurn / 4, 0, kTurn / 2, kTurn / 4}};
  const Eigen::VectorXd velocity{
      {-0.455365, -0.00391, 0.258639, -0.00732, 0.281305, 0.013353, -0.274535}};
  const auto robot = evaluate(model, start, controller::JointVector::Zero(7));
  const Eigen::MatrixXd J = robot.J, M = robot.M;
  const Eigen::VectorXd u = J.fullPivLu().kernel().col(0);
  const Eigen::VectorXd predicted = u * (u.dot(M * velocity) / (0.5 * u.squaredNorm()));
  const Eigen::VectorXd free = rest_of("panda_push_free") - start;
  EXPECT_GT(predicted.norm(), 0.15);
  EXPECT_LT((free - predicted).norm(), 0.03 * predicted.norm()) << free.transpose();
  EXPECT_LT((rest_of("panda_push_held") - start).norm(), 1e-6);
}

// The arm stays where it is if the controller carries just the weight that is simulated.
TEST(Run, SimulatesTheRobotThatTheControllerIsTold) {
  const Scratch scratch;
  const std::string file = changed(
      scratch, "panda_release_c2",
      {{"tip: panda_hand_tcp",
        "tip: panda_hand_tcp\n"
        "  payload: {mass: 2 kg, center: [0, 3 cm, 5 cm], inertia: [0.01, 0.02, 0.03]}\n"
        "  gravity: [3, 1, -9]"},
       {"tip_displacement: [0, 2 cm, 0, 0, 0, 0]", "tip_displacement: [0, 0, 0, 0, 0, 0]"}});
  const Json result = run_json(file, {"--duration", "1"});
  EXPECT_LT(result["largest_tracking_error"]["tip"].get<double>(), 1e-9);
}

/// The start is the position of the links if the sensors are there, and otherwise of the motors.
TEST(Run, SimulatesGearsThatBend) {
  DASHPOT_SKIP_IF_QUICK();
  const Scratch scratch;
  const auto energy_of = [&](const std::string& robot) {
    const std::string file = changed(
        scratch, "iiwa14",
        {{"simulation:\n", "simulation:\n  robot: {reflected_inertia: 0.4, " + robot + "}\n"},
         {"sensors: {position_resolution: 5e-6 rad, difference_velocity: true}", "seed: 2"}});
    return run_json(file, {"--duration", "1"})["energy"];
  };
  const std::string gears =
      "gear_stiffness: [none, 2e4, 2e4, 1e4, 1e4, 1e4, 1e4], gear_damping: 40";
  const Json rigid = energy_of("gear_stiffness: none");
  const Json link = energy_of(gears + ", position_sensor: link"), motor = energy_of(gears);
  for (const Json& energy : {link, motor}) {
    EXPECT_LT(std::abs(energy["imbalance"].get<double>()), 1e-9);
    EXPECT_GT(energy["gear_heat"].get<double>(), 1e-3);
    EXPECT_GT(energy["initial"]["springs"].get<double>(), 0.05);
  }
  EXPECT_EQ(rigid["gear_heat"], 0);
  // The simulation has the controller's values unless it has its own.
  const auto told = [&](const std::string& gears, const std::string& simulated) {
    const std::string file = changed(
        scratch, "iiwa14",
        {{"tip: iiwa_link_ee_kuka", "tip: iiwa_link_ee_kuka\n  reflected_inertia: 0.4\n  " + gears},
         {"simulation:\n", "simulation:\n  robot: {" + simulated + "}\n"},
         {"sensors: {position_resolution: 5e-6 rad, difference_velocity: true}", "seed: 2"}});
    return run_json(file, {"--duration", "0.1"})["energy"]["initial"];
  };
  const std::string keys =
      "gear_stiffness: [none, 2e4, 2e4, 1e4, 1e4, 1e4, 1e4]\n  "
      "gear_damping: 40\n  position_sensor: ";
  EXPECT_EQ(told(keys + "link", "")["springs"], link["initial"]["springs"]);
  EXPECT_EQ(told(keys + "motor", "")["springs"], motor["initial"]["springs"]);
  EXPECT_EQ(told(keys + "link", "position_sensor: motor")["springs"], motor["initial"]["springs"]);
  EXPECT_EQ(told(keys + "link", "gear_stiffness: none")["springs"], 0);
  const auto height = [](const Json& energy) { return energy["initial"]["gravity"].get<double>(); };
  EXPECT_NEAR(height(link), height(rigid), 1e-12);
  EXPECT_LT(height(motor), height(rigid) - 0.1);
}

TEST(Run, WritesALogThatTheMonitorReads) {
  const Scratch scratch;
  const std::string log = scratch.path("a.lcm");
  EXPECT_EQ(run_scene(scene("ur5"), {"--duration", "1.5", "--log", log}).status, 0);
  const Outcome outcome = run_program({"monitor", "--log", log});
  EXPECT_EQ(outcome.status, 0) << outcome.err;
  EXPECT_THAT(outcome.out, HasSubstr("\n1500 states and "));
  EXPECT_THAT(outcome.out, HasSubstr("0 modes messages lost, 0 messages malformed\n"));
}

TEST(Run, PrintsTablesForPeople) {
  const Outcome outcome = run_scene(scene("baxter_left"), {"--duration", "0.5"});
  EXPECT_EQ(outcome.status, 0);
  EXPECT_EQ(outcome.err, "");
  EXPECT_THAT(outcome.out,
              AllOf(HasSubstr("7 joints, 500 ticks of 1.00 ms, as fast as possible"),
                    HasSubstr("Tick of the controller: median "), HasSubstr("\n  Status: ok 500\n"),
                    HasSubstr("\nModes at the start, 2 zero modes\n"),
                    HasSubstr("\nModes at the end, 2 zero modes\n")));
}

TEST(Run, SaysThatItCouldNotWrite) {
  for (const char* option : {"--csv", "--log"}) {
    const Outcome outcome = run_scene(scene("ur5"), {"--duration", "0.5", option, "/dev/full"});
    EXPECT_EQ(outcome.status, 1) << option;
    EXPECT_THAT(outcome.err, HasSubstr(std::string(option) + ": /dev/full: "));
    EXPECT_THAT(outcome.err, HasSubstr(" messages could not be written"));
  }
  EXPECT_EQ(run_scene(scene("ur5"), {"--csv", "/dev/null", "--log", "/dev/null"}).status, 2);
}

TEST(Run, SaysWhenTheSimulationFails) {
  const Scratch scratch;
  // A damper that no step of a millisecond can follow.
  const Outcome outcome = run_scene(
      changed(scratch, "ur5", "viscous_friction: 0.5", "viscous_friction: 1e6"), {"--json"});
  EXPECT_EQ(outcome.status, 1);
  EXPECT_THAT(outcome.err,
              AllOf(StartsWith("dashpot run: the simulation ended at "), HasSubstr("s: ")));
  EXPECT_EQ(count_lines(outcome.err), 1);
}

}  // namespace
}  // namespace dashpot::tests
