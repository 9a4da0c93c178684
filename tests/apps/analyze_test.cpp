// What `dashpot analyze` prints as JSON for good input.
#include <dashpot/tests/apps/json_result.hpp>
#include <dashpot/tests/support/quad_matrix.hpp>
#include <dashpot/tests/support/random.hpp>

#include <array>
#include <cmath>
#include <sstream>

namespace dashpot::tests {
namespace {

using dashpot::testing::Quad;
using dashpot::testing::Random;

TEST(Analyze, AnswersAListWithAListAndReadsJson) {
  const Json one =
      analyze_json("{\n\t\"mass\": [[2]],\n\t\"damping\": [[1.2e0]], \"stiffness\":[[18.0]]\n}\n");
  expect_near({of_modes(one, "natural_frequency")}, {{3}}, 1e-15);
  expect_near({of_modes(one, "damping_ratio")}, {{0.1}}, 1e-15);
  const Json result = analyze_json(
      "- {mass: &m [[1]], stiffness: [[4]]}\n- {mass: *m, stiffness: [[9]]}\n"
      "- {mass: [], damping: [], stiffness: [], times: [0, 1], force: []}\n- {mass: []}\n");
  ASSERT_EQ(result.size(), 4u);
  expect_near({of_modes(result[0], "natural_frequency")}, {{2}}, 1e-15);
  expect_near({of_modes(result[1], "natural_frequency")}, {{3}}, 1e-15);
  for (const std::size_t i : {2U, 3U}) {
    EXPECT_EQ(result[i]["dof"], 0);
    EXPECT_EQ(result[i]["modes"], Json::array());
    EXPECT_EQ(result[i]["zero_modes"], Json::array());
  }
  EXPECT_EQ(analyze_json("[]"), Json::array());
  EXPECT_TRUE(analyze_json("[{mass: [[1]], stiffness: [[4]]}]").is_array());
}

TEST(Analyze, AddsTheGeometricStiffnessAndTheJacobiansRate) {
  // K = J' K_C J + K_G + J' C_C dJ/dt with J = [1 1], K_C = 4, f = 2, C_C = 1:
  // [4 4; 4 4] + [6 0; 0 2] + [0 0; 0 0] first, then + [1 0; 1 0].
  const std::string text =
      "mass: [[1, 0], [0, 1]]\njacobian: [[1, 1]]\ntask_stiffness: [[4]]\ntask_damping: [[1]]\n"
      "jacobian_derivatives: [[[3, 0]], [[0, 1]]]\nwrench: [2]\n";
  const Json symmetric = analyze_json(text);
  EXPECT_EQ(symmetric["symmetric"], true);
  expect_near(symmetric["reduced"]["stiffness"], {{10, 4}, {4, 6}}, 1e-15);
  const Json general = analyze_json(text + "jacobian_rate: [[1, 0]]\n");
  EXPECT_EQ(general["symmetric"], false);
  expect_near(general["reduced"]["stiffness"], {{11, 4}, {5, 6}}, 1e-15);
  EXPECT_EQ(general["notes"],
            Json::parse(R"(["stiffness is not symmetric: solved as a general problem"])"));
}

TEST(Analyze, SumsTheResponsesToAllThatIsGiven) {
  const std::string system =
      "mass: [[2, 0.5], [0.5, 1]]\ndamping: [[1, -0.3], [-0.3, 0.4]]\n"
      "stiffness: [[9, -2], [-2, 3]]\ntimes: [2, 0, 0.7]\n";
  const std::vector<std::string> causes = {"initial_position: [0.1, -0.2]\n",
                                           "initial_velocity: [1, 0.5]\n", "impulse: [-1, 2]\n",
                                           "force: [3, 1]\n"};
  std::string everything = system;
  Rows position(3, Numbers(2, 0.0));
  Rows velocity = position;
  for (const std::string& cause : causes) {
    everything += cause;
    const Json response = analyze_json(system + cause)["response"];
    for (std::size_t i = 0; i < 3; ++i) {
      for (std::size_t j = 0; j < 2; ++j) {
        EXPECT_NE(response["velocity"][0][j], 0.0) << cause;
        position[i][j] += response["position"][i][j].get<double>();
        velocity[i][j] += response["velocity"][i][j].get<double>();
      }
    }
  }
  const Json response = analyze_json(everything)["response"];
  EXPECT_EQ(response["times"], Json::parse("[2.0, 0.0, 0.7]"));
  expect_near(response["position"], position, 1e-14);
  expect_near(response["velocity"], velocity, 1e-14);
}

TEST(Analyze, NamesTheKindsOfModesAndPutsTheSlowerOfTwoRealEigenvaluesFirst) {
  std::string list;
  const std::vector<std::array<const char*, 3>> all = {
      {"5", "4", "overdamped"}, {"1", "4", "underdamped"}, {"4", "4", "critical"},
      {"0", "4", "undamped"},   {"-1", "4", "unstable"},   {"1", "-4", "unstable"}};
  for (const auto& [damping, stiffness, kind] : all) {
    list += std::string("- {mass: [[1]], damping: [[") + damping + "]], stiffness: [[" + stiffness +
            "]]}\n";
  }
  const Json result = analyze_json(list);
  for (std::size_t i = 0; i < all.size(); ++i) {
    EXPECT_EQ(result[i]["modes"][0]["kind"], all[i][2]) << i;
  }
  expect_near(result[0]["modes"][0]["eigenvalues"], {{-1, 0}, {-4, 0}}, 1e-15);
  expect_near({of_modes(result[0], "damping_ratio")}, {{1.25}}, 1e-15);
  EXPECT_TRUE(result[5]["modes"][0]["natural_frequency"].is_null());  // not a number
}

TEST(Analyze, CallsModesBelowTheSoftFrequencySoft) {
  const std::string text =
      "{mass: [[1, 0], [0, 1]], damping: [[1, 0], [0, 0.001]], stiffness: [[4, 0], [0, 0.01]]}";
  EXPECT_EQ(analyze_json(text)["modes"][1]["kind"], "underdamped");
  const Json result = analyze_json(text, {"--soft-frequency", "0.5"});
  EXPECT_EQ(result["modes"][0]["kind"], "underdamped");
  EXPECT_EQ(result["modes"][1]["kind"], "soft");
}

TEST(Analyze, ReportsTheDampingThatCouplesZeroModesAndVibrations) {
  const Json result = analyze_json(
      "{mass: [[1, 0], [0, 1]], damping: [[1, 0], [0, 0]], stiffness: [[1, -1], [-1, 1]]}");
  EXPECT_GT(result["coupling"], 0.1);
  EXPECT_EQ(result["coupled"], true);
  EXPECT_EQ(result["zero_modes"].size(), 1u);
  // det [l^2 + l + 1, -1; -1, l^2 + 1] = l (l^3 + l^2 + 2 l + 1): the zero mode decays at the real
  // root, the vibration has the complex pair.
  const double root = -0.5698402909980532;
  expect_near({result["zero_mode_rates"]}, {{root}}, 1e-13);
  expect_near({of_modes(result, "natural_frequency")}, {{std::sqrt(-1 / root)}}, 1e-13);
  EXPECT_THAT(result["notes"][0].get<std::string>(), ::testing::HasSubstr("couples"));
}

TEST(Analyze, WritesNumbersSoThatTheyReadBackTheSame) {
  const Json free = analyze_json("{mass: [[1]], damping: [[1]], stiffness: [[0]]}");
  EXPECT_TRUE(free["rank_gap"]["smallest_kept"].is_null());
  const Json result = analyze_json("{mass: [[0.30000000000000004]], stiffness: [[1e-7]]}");
  EXPECT_EQ(result["reduced"]["mass"][0][0].get<double>(), 0.30000000000000004);
}

TEST(Analyze, NotesWhatTheReaderMayNotExpect) {
  const auto notes = [](const std::string& more) {
    return analyze_json("mass: [[1]]\nstiffness: [[4]]\n" + more)["notes"];
  };
  EXPECT_EQ(notes("damping: [[1]]\n"), Json::array());
  EXPECT_EQ(notes(""), Json::parse(R"(["no damping given: taken as zero"])"));
  EXPECT_EQ(notes("damping: [[1]]\nforce: [1]\n"),
            Json::parse(R"(["no times given: no response computed"])"));
  EXPECT_EQ(notes("damping: [[1]]\ntimes: [0]\n").size(), 1u);
}

TEST(Analyze, ProvesTighterBoundsWithExtendedResiduals) {
  const auto bound = [](const std::string& residual) {
    const Json result =
        parse(run_program({"analyze", example("baxter7.yaml"), "--json", "--residual", residual}));
    return result["modes"][4]["error_bound"].get<double>();
  };
  EXPECT_LT(bound("extended"), bound("working"));
  EXPECT_GT(bound("extended"), 0);
}

/// The chain of the paper; tests/analysis has its modes, examples/ and the table its motion.
TEST(Analyze, EliminatesTheCoordinateThatIsAskedFor) {
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

// The bounds include the rounding of `dashpot analyze` when it forms the coefficients of a file.

/// The root of the larger x with det(K - x M) = 0, for K = diag(k0, k1).
double higher_frequency(Quad m00, Quad m01, Quad m11, Quad k0, Quad k1) {
  const Quad det = m00 * m11 - m01 * m01, sum = k0 * m11 + k1 * m00;
  const Quad discriminant = sum * sum - 4 * det * k0 * k1;
  auto root = static_cast<Quad>(std::sqrt(static_cast<double>(discriminant)));
  root = (root + discriminant / root) / 2;  // Newton's method: 30 digits
  return std::sqrt(static_cast<double>((sum + root) / (2 * det)));
}

/// A file of systems, and their highest frequencies.
struct Systems {
  std::ostringstream file;
  std::vector<double> frequencies;

  Systems() { file.precision(17); }
};

/// Expects the frequencies within their bounds, and bounds not far above the errors.
void expect_counted(const Systems& systems) {
  const Json results = analyze_json(systems.file.str());
  ASSERT_EQ(results.size(), systems.frequencies.size());
  double largest = 0;
  for (std::size_t i = 0; i < results.size(); ++i) {
    const Json& mode = results[i]["modes"][0];
    const double truth = systems.frequencies[i], bound = mode["natural_frequency_bound"];
    const double error = std::abs(mode["natural_frequency"].get<double>() - truth);
    EXPECT_LE(error, bound) << "system " << i;
    EXPECT_LE(bound, 1e-4 * truth) << "system " << i;
    largest = std::max(largest, error / bound);
  }
  EXPECT_GT(largest, 0.01);
}

// In both the mass is all but singular: a rounding error of 1e-16 in it is one of 1e-7 in the
// higher frequency.

TEST(AnalyzeRounding, OfReflectedInertiaIsCounted) {
  Random random(2301);
  Systems systems;
  for (int trial = 0; trial < 40; ++trial) {
    const double first = random.log_uniform(1e-9, 4e-9), second = random.log_uniform(1e-9, 4e-9);
    systems.file << "- {mass: [[1, 1], [1, 1]], reflected_inertia: [" << first << ", " << second
                 << "], stiffness: [[3, 0], [0, 5]]}\n";
    systems.frequencies.push_back(higher_frequency(1 + Quad(first), 1, 1 + Quad(second), 3, 5));
  }
  expect_counted(systems);
}

TEST(AnalyzeRounding, OfAPayloadIsCounted) {
  Random random(2302);
  Systems systems;
  for (int trial = 0; trial < 40; ++trial) {
    const double first = random.log_uniform(1e-9, 4e-9), second = random.log_uniform(1e-9, 4e-9);
    const double payload = random.uniform(0.5, 1);
    Quad inertia = 0;
    systems.file << "- {mass: [[" << first << ", 0], [0, " << second << "]], payload: " << payload
                 << ", jacobian: [";
    for (int row = 0; row < 3; ++row) {
      const double entry = random.uniform(0.5, 1);
      systems.file << "[" << entry << ", " << entry << "], ";
      inertia += Quad(payload) * Quad(entry) * Quad(entry);
    }
    systems.file << "[0, 0], [0, 0], [0, 0]], task_damping: [";
    for (int row = 0; row < 6; ++row) {
      systems.file << (row == 0 ? "" : ", ") << "[0, 0, 0, 0, 0, 0]";
    }
    systems.file << "], stiffness: [[3, 0], [0, 5]]}\n";
    systems.frequencies.push_back(
        higher_frequency(inertia + Quad(first), inertia, inertia + Quad(second), 3, 5));
  }
  expect_counted(systems);
}

}  // namespace
}  // namespace dashpot::tests
