// `dashpot analyze` on the two examples that the paper prints in full (Kao and Saldarriaga 2021).
// The numbers are recomputed from its printed inputs with 50 digits.
#include <dashpot/tests/apps/json_result.hpp>

#include <cmath>

namespace dashpot::tests {
namespace {

const Rows kChainMass = {{8, 0, 0}, {0, 2, 0}, {0, 0, 5}};

/// And eliminates the heaviest coordinate by default.
TEST(Chain3, HasTheModesAndTheFreeMotionOfThePaper) {
  const Json result = parse(run_program({"analyze", example("chain3.yaml"), "--json"}));
  EXPECT_EQ(result["dof"], 3);
  expect_near({of_modes(result, "natural_frequency")}, {{40.22144794936655, 30.97833725444821}},
              1e-12);
  expect_near({of_modes(result, "damping_ratio")}, {{0.25579375102608415, 0.09761998949433272}},
              1e-12);
  expect_near(eigenvalues(result),
              {{-10.28839504266887, 38.88333579555115}, {-3.0241049573311303, 30.830377361579263}},
              1e-12);
  for (const Json& mode : result["modes"]) {
    EXPECT_EQ(mode["kind"], "underdamped");
    EXPECT_EQ(mode["shape"].size(), 3u);
    EXPECT_EQ(mode["shape"][0].size(), 2u);
    EXPECT_EQ(mode["eigenvalues"][1][0], mode["eigenvalues"][0][0]);
    EXPECT_EQ(mode["eigenvalues"][1][1], -mode["eigenvalues"][0][1].get<double>());
    EXPECT_LT(mode["backward_error"], 1e-15);
    EXPECT_LT(mode["error_bound"], 1e-11);
  }
  EXPECT_EQ(result["eliminated"], Json::parse("[0]"));
  const Rows S = result["constraint_matrix"];
  expect_near(S, {{-0.25, -0.625}, {1, 0}, {0, 1}}, 1e-14);
  expect_near(result["reduced"]["mass"], product(transposed(S), product(kChainMass, S)), 1e-14);
  const Json& response = result["response"];
  EXPECT_EQ(response["times"], Json::parse("[0.0, 0.01, 0.05, 0.1, 0.3, 1.0]"));
  expect_near(response["position"],
              {{0, 0.03, 0},
               {0.00021042283824776405, 0.028131342258251358, 0.0004107865555030348},
               {0.0034388598332664375, 0.0029390398453169246, 0.00532220832864693},
               {0.005996410360812483, -0.004845761798341286, 0.004344048142036541},
               {0.004761329037015458, 0.00396832124950647, 0.0027945450409726787},
               {0.003940840449435092, 0.004027697411483805, 0.0040835763163103314}},
              1e-12);
  // u0 u0' M q(0): the centre of mass, which stays where it is.
  expect_near(response["zero_mode_position"], Rows(6, Numbers(3, 0.004)), 1e-14);
  for (const double velocity : response["velocity"][0].get<Numbers>())
    EXPECT_NEAR(velocity, 0, 1e-14);
}

TEST(Chain3, HasTheZeroModeAndTheReducedSystemOfThePaper) {
  const Json result =
      parse(run_program({"analyze", example("chain3.yaml"), "--json", "--pivot", "last"}));
  const double entry = std::copysign(0.25819888974716115, result["zero_modes"][0][0].get<double>());
  expect_near(result["zero_modes"], {{entry, entry, entry}}, 1e-14);
  EXPECT_LT(result["coupling"], 1e-14);
  EXPECT_EQ(result["coupled"], false);
  EXPECT_EQ(result["eliminated"], Json::parse("[2]"));
  expect_near(result["constraint_matrix"], {{1, 0}, {0, 1}, {-1.6, -0.4}}, 1e-14);
  expect_near(result["reduced"]["mass"], {{20.8, 3.2}, {3.2, 2.8}}, 1e-14);
  expect_near(result["reduced"]["damping"], {{133.8, 40.2}, {40.2, 55.8}}, 1e-14);
  expect_near(result["reduced"]["stiffness"], {{21264, 4656}, {4656, 4524}}, 1e-14);
}

TEST(Chain3, MovesAfterAnImpulseAsInThePaper) {
  const Json result = parse(run_program({"analyze", example("chain3_impulse.yaml"), "--json"}));
  expect_near(result["response"]["position"],
              {{0, 0, 0},
               {0.0012219871832892235, 5.567209455416833e-05, 2.255166891557514e-05},
               {0.00494129374597433, 0.0018280957492960495, 0.0013626917067226525},
               {0.006758773578554127, 0.006601466686883646, 0.006545375599559938},
               {0.020147338557531497, 0.019779262116202734, 0.01985255346146851},
               {0.06661501697708988, 0.06671864352212639, 0.06672851542780564}},
              1e-12);
  expect_near({result["response"]["velocity"][0]}, {{0.125, 0, 0}}, 1e-13);
}

/// Its modes and matrices are in tests/analysis.
TEST(Baxter7, MovesAsInThePaper) {
  const Json result = parse(run_program({"analyze", example("baxter7.yaml"), "--json"}));
  EXPECT_EQ(result["zero_modes"].size(), 2u);
  const Numbers zero_mode_part = {-0.002931906358405408, 0, 0.005280322786914121, 0,
                                  -0.002127379648486052, 0, -0.02185603069264515};
  expect_near(result["response"]["zero_mode_position"], Rows(6, zero_mode_part), 1e-10);
  expect_near(
      {result["response"]["position"][1], result["response"]["position"][5]},
      {{-0.004768692315432357, 0.009517162914781947, 0.006140005849494584, -0.0006438484865847135,
        0.005423813744422209, 0.0005844532224619424, 0.001317462296525746},
       {-0.002988620418762981, -0.0051318874402175065, 0.005765006902990869, 0.0035685537038419707,
        -0.0022989923396911213, -0.002739219299879347, -0.028944872766900036}},
      1e-10);
}

}  // namespace
}  // namespace dashpot::tests
