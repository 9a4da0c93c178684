// Output of the program for an arm with elastic gears.
#include <dashpot/tests/apps/json_result.hpp>

namespace dashpot::tests {
namespace {

using ::testing::HasSubstr;

const Words kBending = {"--drives", "fr3", "--gear-stiffness", "1e4", "--gear-damping", "1"};

TEST(GearsOfAudit, AddAModeForEachJoint) {
  const Words gains = {
      "--stiffness", "400,400,400,20,20,20", "--damping-factor", "1.4", "--period", "1 ms",
      "--json"};
  const auto found = [&](const Words& more) {
    return parse(run_program(of_panda("audit", joined(gains, more))))["posture"];
  };
  const Json rigid = found({"--drives", "fr3"}), motor = found(kBending);
  const Json link = found(joined(kBending, {"--position-sensor", "link"}));
  EXPECT_EQ(rigid["modes"].size(), 6U);
  ASSERT_EQ(motor["modes"].size(), 13U);
  for (std::size_t i = 3; i < 6; ++i) {  // the others are overdamped
    const double frequency = motor["modes"][i + 7]["natural_frequency"];
    EXPECT_NEAR(frequency, rigid["modes"][i]["natural_frequency"].get<double>(), 0.02 * frequency);
  }
  EXPECT_GT(motor["gain_margin"].get<double>(), 2);
  EXPECT_LT(link["gain_margin"].get<double>(), 1);
}

TEST(GearsOfDesign, LowerTheRatioToWhatTheLoopBears) {
  const Words task = {"--task-stiffness",
                      "400,400,400,20,20,20",
                      "--damping-ratio",
                      "0.7",
                      "--q",
                      "0,-45 deg,0,-135 deg,0,90 deg,45 deg",
                      "--period",
                      "1 ms",
                      "--json"};
  const Json motor = parse(run_program(of_panda("design", joined(task, kBending))));
  EXPECT_EQ(motor["loop"]["level"], 1);
  EXPECT_EQ(motor["after"]["modes"].size(), 13U);
  EXPECT_EQ(motor["loop"]["modes"].size(), 13U);
  const Json link = parse(run_program(
      of_panda("design", joined(task, joined(kBending, {"--position-sensor", "link"})))));
  EXPECT_LT(link["loop"]["level"].get<double>(), 1);
  EXPECT_GE(link["loop"]["gain_margin"].get<double>(), 2 - 1e-6);
}

TEST(GearsOfTheProgram, AreRefusedWhereTheyAreWrong) {
  expect_refusals(
      of_panda("inspect", {}),
      {{{"--gear-stiffness", "1e4"}, "needs the reflected inertia (kg m^2)"},
       {{"--gear-damping", "1"}, "--gear-damping: needs --gear-stiffness, N m/rad"},
       {{"--position-sensor", "link"}, "--position-sensor: needs --gear-stiffness, N m/rad"},
       {{"--drives", "fr3", "--gear-stiffness", "1,2"},
        "--gear-stiffness: 2 numbers, expected 1 or 7"},
       {{"--drives", "fr3", "--gear-stiffness", "0"},
        "gear stiffness is not a positive number, N m/rad"},
       {{"--position-sensor", "both"}, "--position-sensor"}});
  const Json found =
      parse(run_program(of_panda("inspect", {"--drives", "fr3", "--gear-stiffness",
                                             "1e4,1e4,1e4,none,5e3,5e3,5e3", "--json"})));
  EXPECT_EQ(found["joints"][0]["gear_stiffness"], 1e4);
  EXPECT_FALSE(found["joints"][3].contains("gear_stiffness"));
}

}  // namespace
}  // namespace dashpot::tests
