// `dashpot design --period`: the damping that a sampled loop allows, for a mass under a held force.
#include <dashpot/tests/apps/json_result.hpp>
#include <dashpot/tests/support/scratch.hpp>

#include <cmath>
#include <fstream>
#include <string>
#include <vector>

namespace dashpot::tests {
namespace {

using ::testing::HasSubstr;
using ::testing::IsEmpty;

/// 2 kg on 800 N/m: 20 rad/s. Sampled every 20 ms it is stable for 8 N s/m < c < 200 N s/m.
const std::string kMass = "mass: [[2]]\nstiffness: [[800]]\n";

Outcome design(const std::string& text, const Words& options) {
  return run_program(joined({"design", "-"}, options), text);
}

Json design_json(const std::string& text, const Words& options) {
  return parse(design(text, joined(options, {"--json"})));
}

TEST(DesignForALoop, KeepsTheRatioWhereTheLoopBearsIt) {
  const Json result = design_json(kMass, {"--damping-ratio", "1", "--period", "0.02"});
  EXPECT_EQ(result["reached"], true);
  EXPECT_EQ(result["loop"]["level"], 1);
  EXPECT_EQ(result["loop"]["margin"], 2);
  EXPECT_NEAR(result["loop"]["gain_margin"], 2.5, 1e-5);  // 80 of 200 N s/m
  ASSERT_EQ(result["loop"]["modes"].size(), 1U);
  // s^2 + 40 s + 400 seen every 20 ms through a hold: z^2 - 1.12 z + 0.28 = 0
  const double rate = -std::log(0.28) / 2 / 0.02;  // of both roots together, halved
  const Json& mode = result["loop"]["modes"][0];
  EXPECT_NEAR(mode["damping_ratio"].get<double>() * mode["natural_frequency"].get<double>(), rate,
              1e-6);
}

TEST(DesignForALoop, LowersTheRatioToWhatKeepsTheMarginAndSaysSo) {
  const std::vector<std::string> options = {"--damping-ratio", "2",  "--period", "0.02",
                                            "--margin",        "1.6"};
  const Json result = design_json(kMass, options);
  const double borne = 200 / 1.6 / 80;  // 1.5625
  EXPECT_EQ(result["reached"], false);
  EXPECT_NEAR(result["loop"]["level"], borne / 2, 2e-6);
  EXPECT_NEAR(result["modes"][0]["damping_ratio"], borne, 4e-6);
  ASSERT_EQ(result["misses"].size(), 1U);
  EXPECT_EQ(result["misses"][0]["reason"], "loop");
  EXPECT_EQ(result["misses"][0]["wanted"], 2);
  const Outcome table = design(kMass, options);
  EXPECT_EQ(table.status, 0);
  EXPECT_THAT(table.out, HasSubstr("The loop allows 1.56250 instead of 2.00"));
  EXPECT_THAT(table.out, HasSubstr("Every mode has a damping ratio of 1.56250"));
}

/// controller_memory_test.cpp tests the eigenvalues and the margin.
TEST(DesignForALoop, CountsTheIntegralOfTheSprings) {
  const std::vector<std::string> options = {"--damping-ratio", "0.4", "--period", "0.02",
                                            "--delay",         "1",   "--margin", "1.1"};
  const double without = design_json(kMass, options)["loop"]["gain_margin"];
  Words with = joined(options, {"--integral-time", "500 ms"});
  const Json result = design_json(kMass, with);
  EXPECT_EQ(result["loop"]["level"], 1);
  EXPECT_LT(result["loop"]["gain_margin"].get<double>(), 0.98 * without);
  ASSERT_EQ(result["loop"]["integral_decays"].size(), 1U);
  EXPECT_NEAR(result["loop"]["integral_decays"][0].get<double>(), 2, 0.3);
  EXPECT_THAT(design(kMass, with).out, HasSubstr("The integral of the springs makes 1 slow mode, "
                                                 "which decays at "));
  // The integral is quicker than the mass: nothing is proposed.
  with.back() = "20 ms";
  EXPECT_EQ(design(kMass, with).status, 1);
}

TEST(DesignForALoop, IntegratesTheSpringsOfTheTaskAlone) {
  const std::string task = "mass: [[2, 0], [0, 3]]\njacobian: [[1, 0]]\ntask_stiffness: [[800]]\n";
  const std::vector<std::string> options = {"--damping-ratio", "0.7", "--period", "0.002",
                                            "--integral-time", "0.5"};
  const Json found = design_json(task +
                                     "stiffness: [[0, 0], [0, 900]]\n"
                                     "damping: [[0, 0], [0, 50]]\n",
                                 options);
  EXPECT_EQ(found["loop"]["integral_decays"].size(), 1U);
  const Outcome wrong = design(
      "mass: [[2, 0], [0, 3]]\njacobian: [[1]]\n"
      "task_stiffness: [[800]]\n",
      options);
  expect_refusal(wrong, "jacobian");
}

TEST(DesignForALoop, ProposesNothingWhereNoRatioWillDo) {
  const Outcome outcome = design("- " + std::string("{mass: [[2]], stiffness: [[800]]}\n"),
                                 {"--damping-ratio", "0.09", "--period", "0.02"});
  EXPECT_EQ(outcome.status, 1);
  EXPECT_THAT(outcome.out, IsEmpty());
  EXPECT_EQ(count_lines(outcome.err), 1);
  EXPECT_THAT(outcome.err,
              HasSubstr("[0]: no damping ratio up to 0.0900 keeps a gain margin of 2"));
  // Stable if c / k > period / 2, at any share of both.
  EXPECT_THAT(
      design("{mass: [[0.2]], stiffness: [[800]]}\n", {"--damping-ratio", "1", "--period", "0.1"})
          .err,
      HasSubstr("the loop is unstable however little of the gains is left"));
}

TEST(DesignForALoop, LowersTheDampingOfARegionToWhatEveryLoopBears) {
  const std::string list = "[{mass: [[4]], stiffness: [[800]]}, {mass: [[2]], stiffness: [[800]]}]";
  const std::vector<std::string> options = {"--region", "--damping-ratio", "2",  "--period",
                                            "0.02",     "--margin",        "1.6"};
  const Json result = design_json(list, options);
  EXPECT_NEAR(result["damping"][0][0], 200 / 1.6, 1e-3);  // of the lighter
  const Json& loop = result["loop"];
  EXPECT_EQ(loop["margin"], 1.6);
  EXPECT_NEAR(loop["gain_margin"], 1.6, 1e-5);
  EXPECT_EQ(loop["margin_sample"], 1);
  const double free = design_json(list, {"--region", "--damping-ratio", "2"})["damping"][0][0];
  EXPECT_NEAR(loop["share"], 200 / 1.6 / free, 1e-5);
  EXPECT_NEAR(result["samples"][0]["gain_margin"], 3.2, 1e-3);
  const Outcome table = design(list, options);
  EXPECT_THAT(table.out, HasSubstr("The loops allow 0."));
  EXPECT_THAT(table.out, HasSubstr("first at configuration [1]"));
  EXPECT_THAT(table.out, HasSubstr("margin"));
  const Scratch scratch;
  EXPECT_EQ(design(list, joined(options, {"--csv", scratch.path("map.csv")})).status, 0);
  std::ifstream file(scratch.path("map.csv"));
  std::string line;
  std::getline(file, line);
  EXPECT_THAT(line, ::testing::EndsWith("soft_modes,gain_margin"));
  std::getline(file, line);
  EXPECT_NEAR(std::stod(line.substr(line.rfind(',') + 1)), 3.2, 1e-3);
}

TEST(DesignForALoop, CountsFrictionAndIntegralOfEachConfigurationOfARegion) {
  const std::vector<std::string> options = {"--region", "--damping-ratio", "2.5", "--period",
                                            "0.02"};
  const auto with = [&](const std::string& light, const Words& more) {
    return design_json(
        "[{mass: [[9]], stiffness: [[800]]}, {mass: [[2]], stiffness: [[800]]" + light + "}]",
        joined(options, more));
  };
  const double plain = with("", {})["damping"][0][0];
  EXPECT_NEAR(plain, 100, 1e-3);
  EXPECT_GT(with(", damping: [[40]]", {})["damping"][0][0], plain + 0.5);  // brakes within a tick
  EXPECT_NEAR(with("", {"--integral-time", "2"})["damping"][0][0], plain, 1e-3);
  const Outcome quick =
      design("[{mass: [[2]], stiffness: [[800]]}]",
             {"--region", "--damping-ratio", "2.5", "--period", "0.02", "--integral-time", "0.02"});
  EXPECT_EQ(quick.status, 1);  // quicker than the mass follows
}

TEST(DesignForALoop, ProposesNothingForARegionThatBearsNone) {
  const Outcome outcome =
      design("[{mass: [[2]], stiffness: [[800]]}, {mass: [[0.1]], stiffness: [[800]]}]",
             {"--region", "--damping-ratio", "0.7", "--period", "0.02"});
  EXPECT_EQ(outcome.status, 1);
  EXPECT_THAT(outcome.out, IsEmpty());
  EXPECT_EQ(count_lines(outcome.err), 1);
  EXPECT_THAT(outcome.err, HasSubstr("no share of the damping found for the region keeps a gain "
                                     "margin of 2"));
  EXPECT_THAT(outcome.err, HasSubstr("configuration [1]"));
}

}  // namespace
}  // namespace dashpot::tests
