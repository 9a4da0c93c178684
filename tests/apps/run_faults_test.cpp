// Scenes with faults, and their summary.
#include <dashpot/tests/apps/scene_run.hpp>
#include <dashpot/tests/support/places.hpp>

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <numbers>

namespace dashpot::tests {
namespace {

/// The table of a second of the UR5's scene with `faults` in it.
std::map<std::string, Numbers> with_faults(const std::string& faults) {
  const Scratch scratch;
  const std::string csv = scratch.path("a.csv");
  const std::string file =
      changed(scratch, "ur5", "  steps:", "  faults:\n    - {" + faults + "}\n  steps:");
  run_json(file, {"--duration", "1", "--csv", csv});
  return table(csv);
}

/// tests/sim tests the effect of each fault; this tests its keys and when it acts.
TEST(Faults, ActWhileTheyLast) {
  const auto plain = with_faults("begin: 0.9 s, frozen: true");
  const Numbers &q = plain.at("q2"), &qd = plain.at("qd2");
  const auto shifted =
      with_faults("begin: 0.1 s, end: 0.102 s, position_offset: [0, 0.01, 0, 0, 0, 0]");
  for (std::size_t i = 90; i < 110; ++i) {
    const bool lasts = i == 100 || i == 101;
    EXPECT_NEAR(shifted.at("q2")[i], q[i] + (lasts ? 0.01 : 0), 1e-3) << i;
    EXPECT_NEAR(shifted.at("q3")[i], plain.at("q3")[i], 1e-3) << i;
  }
  const auto turned = with_faults("begin: 0.1 s, end: 0.101 s, velocity_factor: -1");
  EXPECT_EQ(turned.at("qd2")[99], qd[99]);
  EXPECT_EQ(turned.at("qd2")[100], -qd[100]);
  EXPECT_NE(qd[100], 0);
  const auto frozen = with_faults("begin: 0.1 s, end: 0.105 s, frozen: true");
  for (const char* name : {"q2", "qd2"}) {
    const Numbers& shown = frozen.at(name);
    EXPECT_NE(shown[98], shown[99]);
    for (std::size_t i = 100; i < 105; ++i) EXPECT_EQ(shown[i], shown[99]) << name;
    EXPECT_NE(shown[105], shown[99]);
  }
  for (const char* fault : {"not_a_number: true", "clock_offset: -0.5 s"}) {
    const auto spoilt = with_faults(std::string("begin: 0.1 s, end: 0.101 s, ") + fault);
    EXPECT_EQ(spoilt.at("status")[99], 0) << fault;
    EXPECT_NE(spoilt.at("status")[100], 0) << fault;
  }
  const Numbers rare = with_faults("begin: 0 s, end: 0.5 s, call_every: 5").at("torque2");
  for (std::size_t i = 1; i < 500; ++i) EXPECT_EQ(rare[i] == rare[i - 1], i % 5 != 0) << i;
  for (std::size_t i = 501; i < 600; ++i) EXPECT_NE(rare[i], rare[i - 1]) << i;
  const Numbers led =
      with_faults("begin: 0.2 s, end: 0.7 s, pause: true, moved_by: 0.3 rad").at("q2");
  for (std::size_t i = 200; i < 700; ++i) EXPECT_EQ(led[i], led[199]) << i;
  EXPECT_NEAR(led[700], led[199] + 0.3, 1e-3);
  // Without a hand the last torque goes on.
  const Numbers left = with_faults("begin: 0.2 s, end: 0.21 s, pause: true").at("q2");
  EXPECT_EQ(left[209], left[199]);
  EXPECT_NE(left[210], left[199]);
  EXPECT_NEAR(left[210], left[199], 0.01);
}

TEST(Faults, StartOutsideTheLimitsOnlyWhereTheSceneSaysSo) {
  const Scratch scratch;
  const std::string path =
      std::string(DASHPOT_SOURCE_DIR) + "/sim/scenes/safety/outside_limit.yaml";
  std::string text = text_of(path);
  text.replace(text.find("../../models"), 12, std::string(DASHPOT_SOURCE_DIR) + "/sim/models");
  const std::string csv = scratch.path("a.csv");
  const std::string said = "    outside_limits: true\n";
  run_json(scratch.write("scene.yaml", text), {"--csv", csv, "--duration", "1"});
  EXPECT_NEAR(table(csv).at("q1")[0], std::numbers::pi / 2, 1e-9);
  text.replace(text.find(said), said.size(), "");
  expect_refusal(run_scene(scratch.write("scene.yaml", text)),
                 "joint 1 would be at 1.570796 rad, outside its");
}

TEST(Summary, SaysHowFarTheRobotWent) {
  // A push of 200 N for 10 ms.
  const Scratch scratch;
  const std::string file =
      changed(scratch, "ur5", "  steps:",
              "  pushes: [{begin: 0.2 s, end: 0.21 s, wrench: [0, 200 N, 0, 0, 0, 0]}]\n  faults:\n"
              "    - {begin: 0.5 s, end: 0.6 s, pause: true}\n  steps:");
  const Json result = run_json(file, {"--duration", "1", "--csv", scratch.path("a.csv")});
  const auto columns = table(scratch.path("a.csv"));
  double fastest = 0;
  for (int i = 1; i <= 6; ++i) {
    const double limit = i <= 3 ? 3.15 : 3.2;  // of the URDF, rad/s
    for (const double speed : columns.at("qd" + std::to_string(i))) {
      fastest = std::max(fastest, std::abs(speed) / limit);
    }
  }
  EXPECT_NEAR(result["greatest"]["joint_speed_share"].get<double>(), fastest, 1e-3 * fastest);
  double tip = 0;
  for (std::size_t k = 1; k < 500; ++k) {
    double square = 0;
    for (const char* axis : {"x", "y", "z"}) {
      const Numbers& at = columns.at(axis);
      square += std::pow((at[k] - at[k - 1]) / 0.001, 2);
    }
    tip = std::max(tip, std::sqrt(square));
  }
  EXPECT_NEAR(result["greatest"]["tip_speed"].get<double>(), tip, 0.1 * tip);
  EXPECT_GT(result["greatest"]["kinetic_energy"].get<double>(), 0.1);
  EXPECT_GE(result["status_changes"].get<int>(), 1);
  const Json calm = run_json(scene("ur5"), {"--duration", "0.1"});
  EXPECT_EQ(calm["restarts"], 0);
  const std::string text = run_scene(file, {"--duration", "1"}).out;
  EXPECT_THAT(text, ::testing::AllOf(::testing::HasSubstr("\n  Greatest speed of a joint "),
                                     ::testing::HasSubstr(" changes of status, ")));
}

std::vector<std::string> safety_scenes() {
  std::vector<std::string> names;
  for (const auto& entry : std::filesystem::directory_iterator(std::string(DASHPOT_SOURCE_DIR) +
                                                               "/sim/scenes/safety")) {
    names.push_back(entry.path().stem());
  }
  std::sort(names.begin(), names.end());
  return names;
}

class SafetyScene : public ::testing::TestWithParam<std::string> {};

TEST_P(SafetyScene, RunsToItsEndAndAccountsForItsEnergy) {
  // Long scenes show their progress on standard error.
  const Outcome outcome = run_scene(scene("safety/" + GetParam()), {"--json"});
  const Json result = Json::parse(outcome.out);
  ASSERT_EQ(outcome.status, result["fault"].is_null() ? 0 : 1) << outcome.err;
  EXPECT_GE(result["ticks"].get<int>(), 3000);
  const Json& energy = result["energy"];
  const double moved = 1 + std::abs(energy["by_actuators"].get<double>()) +
                       std::abs(energy["by_world"].get<double>());
  EXPECT_LT(std::abs(energy["imbalance"].get<double>()), 1e-2 * moved);
  EXPECT_GT(result["greatest"]["joint_speed_share"].get<double>(), 0);
}

/// Feedback that freezes at rest shows when the torque changes, and in motion at once.
TEST(Faults, FrozenFeedbackIsSeen) {
  const Json rest = run_json(scene("safety/frozen_at_rest"), {})["status"];
  EXPECT_GE(rest.value("state frozen, holding the weight", 0), 1) << rest;
  const Json motion = run_json(scene("safety/frozen_feedback"), {})["status"];
  EXPECT_GE(motion.value("position and velocity contradict each other, damping", 0), 1) << motion;
}

INSTANTIATE_TEST_SUITE_P(Scenes, SafetyScene, ::testing::ValuesIn(safety_scenes()));

}  // namespace
}  // namespace dashpot::tests
