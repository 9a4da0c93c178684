// `dashpot design` as a user runs it, judged by `dashpot analyze`.
#include <dashpot/tests/apps/json_result.hpp>

#include <Eigen/Core>
#include <Eigen/Eigenvalues>
#include <sstream>

namespace dashpot::tests {
namespace {

using ::testing::AllOf;
using ::testing::EndsWith;
using ::testing::HasSubstr;
using ::testing::IsEmpty;
using ::testing::StartsWith;

/// `dashpot design - --damping-ratio RATIO OPTIONS...` with `text` on standard input.
Outcome design_text(const std::string& text, const std::string& ratio, const Words& options = {}) {
  return run_program(joined({"design", "-", "--damping-ratio", ratio}, options), text);
}

Json design_json(const std::string& text, const std::string& ratio, const Words& options = {}) {
  return parse(design_text(text, ratio, joined(options, {"--json"})));
}

std::string baxter() {
  std::ifstream stream(example("baxter7.yaml"), std::ios::binary);
  return {std::istreambuf_iterator<char>(stream), {}};
}

Eigen::VectorXd eigenvalues_of(const Rows& rows) {
  const auto n = static_cast<Eigen::Index>(rows.size());
  Eigen::MatrixXd A(n, n);
  for (Eigen::Index i = 0; i < n; ++i) {
    for (Eigen::Index j = 0; j < n; ++j) {
      A(i, j) = rows[static_cast<std::size_t>(i)][static_cast<std::size_t>(j)];
      EXPECT_EQ(A(i, j), rows[static_cast<std::size_t>(j)][static_cast<std::size_t>(i)]);
    }
  }
  return Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd>(A).eigenvalues();
}

TEST(Design, GivesEveryModeItsRatioAsAnalyzeSees) {
  const Json result = design_json(baxter(), "0.7");
  EXPECT_GT(eigenvalues_of(result["task_damping"])[0], 0);
  EXPECT_EQ(result["reached"], true);
  EXPECT_THAT(result["misses"], IsEmpty());
  ASSERT_EQ(result["modes"].size(), 5U);
  for (const double ratio : of_modes(result, "damping_ratio")) EXPECT_NEAR(ratio, 0.7, 1e-9);
  const Json before = analyze_json(baxter());
  EXPECT_EQ(of_modes(result["before"], "damping_ratio"), of_modes(before, "damping_ratio"));

  // The matrix in the file, in place of the last of its keys that matter.
  std::string text = baxter();
  text.replace(text.find("task_damping:"), std::string::npos,
               "task_damping: " + result["task_damping"].dump() + "\n");
  const Json after = analyze_json(text);
  for (const double ratio : of_modes(after, "damping_ratio")) EXPECT_NEAR(ratio, 0.7, 1e-9);
  EXPECT_EQ(of_modes(after, "damping_ratio"), of_modes(result, "damping_ratio"));
  EXPECT_EQ(of_modes(after, "damping_ratio"), of_modes(result["after"], "damping_ratio"));
}

TEST(Design, KeepsAStructureAndNamesWhatItMisses) {
  for (const std::string structure : {"diagonal", "block"}) {
    const Json result = design_json(baxter(), "0.7", {"--keep-structure", structure});
    const Rows C = result["task_damping"];
    EXPECT_GE(eigenvalues_of(C)[0], 0);
    for (std::size_t i = 0; i < C.size(); ++i) {
      for (std::size_t j = 0; j < C.size(); ++j) {
        const bool free = i == j || (structure == "block" && (i < 3) == (j < 3));
        if (!free) {
          EXPECT_EQ(C[i][j], 0);
        }
      }
    }
    EXPECT_EQ(result["reached"], false);
    ASSERT_FALSE(result["misses"].empty());
    for (const Json& miss : result["misses"]) {
      const Json& mode = result["modes"].at(miss["mode"].get<std::size_t>());
      EXPECT_EQ(miss["obtained"], mode["damping_ratio"]);
      EXPECT_EQ(miss["wanted"], 0.7);
      EXPECT_EQ(miss["reason"], "structure");
    }
  }
}

TEST(Design, NamesModesThatFrictionOverdoes) {
  const std::string text =
      "mass: [[1, 0], [0, 1]]\njacobian: [[1, 0], [0, 1]]\n"
      "task_stiffness: [[100, 0], [0, 4]]\ndamping: [[3, 0], [0, 3]]\n";
  const Json result = design_json(text, "0.5");  // 2 zeta omega is 10 and 2
  expect_near(result["task_damping"], {{7, 0}, {0, 0}}, 1e-12);
  EXPECT_NEAR(result["indefinite_by"], -1, 1e-12);
  ASSERT_EQ(result["misses"].size(), 1U);
  EXPECT_EQ(result["misses"][0]["mode"], 1);
  EXPECT_EQ(result["misses"][0]["reason"], "overdone");
  EXPECT_NEAR(result["misses"][0]["obtained"], 0.75, 1e-12);
  EXPECT_NEAR(result["misses"][0]["missed_by"], 0.25, 1e-12);
}

TEST(Design, FlagsATaskDampingThatFeedsEnergyIn) {
  const std::string text =
      "mass: [[1, 0], [0, 1]]\njacobian: [[1, 0], [0, 1]]\n"
      "task_stiffness: [[100, 0], [0, 4]]\ntask_damping: [[0.1, 10], [10, 10]]\n";
  const Json result = design_json(text, "0.7");
  ASSERT_EQ(result["notes"].size(), 1U);
  EXPECT_THAT(result["notes"][0].get<std::string>(), HasSubstr("-6.1"));
  expect_refusal(design_text(text, "0.7", {"--near"}),
                 "task_damping: is not positive semidefinite");
}

TEST(Design, StaysNearTheTaskDampingOfTheFile) {
  const Json exact = design_json(baxter(), "0.7"), near = design_json(baxter(), "0.7", {"--near"});
  for (const double ratio : of_modes(near, "damping_ratio")) EXPECT_NEAR(ratio, 0.7, 1e-9);
  // The file says 3.5 for the first direction.
  EXPECT_LT(near["task_damping"][0][0], 0.5 * exact["task_damping"][0][0].get<double>());
}

TEST(Design, OfARegionMapsTheWorstMode) {
  const std::string one =
      "- {mass: [[2, 0.3], [0.3, 1]], jacobian: [[1, 0.5], [0, 1]], task_stiffness: [[200, 0], [0, "
      "30]]}\n";
  const std::string other =
      "- {mass: [[3, 0.1], [0.1, 1]], jacobian: [[1, 0.2], [0.3, 1]], task_stiffness: [[200, 0], "
      "[0, 30]]}\n";
  const Json result = design_json(one + other, "0.7", {"--region"});
  EXPECT_GT(eigenvalues_of(result["task_damping"])[0], 0);
  ASSERT_EQ(result["samples"].size(), 2U);
  double least = 10;
  for (const Json& sample : result["samples"]) {
    EXPECT_LE(sample["largest_ratio"], 1.05 + 1e-6);
    least = std::min(least, sample["damping_ratio"].get<double>());
  }
  EXPECT_NEAR(result["level"], std::min(1.0, least / 0.7), 1e-12);
  EXPECT_GT(result["level"], 0.9);
  EXPECT_THAT(design_json(one + other, "0.7"), ::testing::SizeIs(2));
  const Outcome table = design_text(one + other, "0.7", {"--region"});
  EXPECT_THAT(table.out, AllOf(StartsWith("task_damping\n"), HasSubstr("configuration")));
  EXPECT_THAT(table.err, IsEmpty());
}

/// And names the worst configuration if all reach their ratio.
TEST(Design, WritesTheMapOfARegion) {
  const std::string list = "[{mass: [[1]], stiffness: [[4]]}, {mass: [[2]], stiffness: [[4]]}]";
  const Scratch scratch;
  const std::string path = scratch.path("map.csv");
  const Json result = design_json(list, "0.7", {"--region", "--csv", path});
  ASSERT_EQ(result["samples"].size(), 2U);
  const double first = result["samples"][0]["damping_ratio"];
  const double second = result["samples"][1]["damping_ratio"];
  ASSERT_GT(first, second);
  ASSERT_GT(second, 0.7);
  EXPECT_EQ(result["worst_sample"], 1);
  EXPECT_EQ(result["level"], 1);
  std::ifstream file(path);
  std::string heading, line;
  std::getline(file, heading);
  EXPECT_THAT(heading,
              StartsWith("configuration,worst_mode,natural_frequency [rad/s],damping_ratio"));
  for (const Json& sample : result["samples"]) {
    std::getline(file, line);
    std::istringstream fields(line);
    for (int i = 0; i < 4; ++i) std::getline(fields, line, ',');
    EXPECT_EQ(std::stod(line), sample["damping_ratio"]);
  }
  EXPECT_FALSE(std::getline(file, line));
  expect_refusal(  // as `dashpot run` says it
      design_text(list, "0.5", {"--region", "--csv", "/nowhere/map.csv"}),
      "dashpot design: --csv: /nowhere/map.csv: cannot write: No such file or directory\n");
  EXPECT_EQ(design_text(list, "0.5", {"--region", "--csv", "/dev/full"}).status, 1);
  EXPECT_THAT(design_text(list, "0.5", {"--csv", path}).err, HasSubstr("--csv: needs --region"));
}

TEST(Design, PrintsATableForPeople) {
  const Outcome outcome = design_text(baxter(), "0.7");
  EXPECT_EQ(outcome.status, 0) << outcome.err;
  EXPECT_THAT(outcome.out,
              AllOf(StartsWith("task_damping\n"), HasSubstr("before"),
                    HasSubstr("Every mode has a damping ratio of 0.700.\n"), EndsWith("\n")));
}

TEST(Design, RefusesInOneLine) {
  const std::string kArm = "mass: [[2, 0], [0, 1]]\njacobian: [[1, 1]]\ntask_stiffness: [[9]]\n";
  struct Bad {
    Words options;
    std::string text, reason;
  };
  const std::vector<Bad> all = {

      {{}, kArm, "--damping-ratio is required"},
      {{"--damping-ratio", "-1"}, kArm, "a positive ratio up to 1e9 is wanted"},
      {{"--damping-ratio", "0.7x"}, kArm, "a positive ratio up to 1e9 is wanted"},
      {{"--damping-ratio", "inf"}, kArm, "a positive ratio up to 1e9 is wanted"},
      {{"--damping-ratio", "1", "--keep-structure", "odd"}, kArm, "odd not in"},
      {{"--damping-ratio", "1", "--largest-ratio", "2"}, kArm, "--largest-ratio: needs --region"},
      {{"--damping-ratio", "1", "--region", "--largest-ratio", "0.5"},
       kArm,
       "is below --damping-ratio"},
      {{"--damping-ratio", "1", "--near"}, kArm, "task_damping: missing"},
      {{"--damping-ratio", "1", "--near", "--region"}, kArm, "--near"},
      {{"--damping-ratio", "1"},
       "mass: [[1]]\njacobian: [[1]]\ntask_damping: [[1]]\nstiffness: [[1]]\n",
       "-: task_stiffness: missing"},
      {{"--damping-ratio", "0.7"},
       "mass: [[1e300, 0], [0, 1e300]]\nstiffness: [[1e300, 1e300], [1e300, 1e300]]\n"
       "damping: [[1e308, 1e308], [1e308, 1e308]]\n",
       "-: system: the entries are too large or too small to compute with"},
      {{"--damping-ratio", "1"},
       "mass: [[1]]\njacobian: [[1]]\ntask_stiffness: [[-1]]\n",
       "-: task_stiffness: is not positive semidefinite"},
      {{"--damping-ratio", "1", "--region"},
       "- {mass: [[1]], jacobian: [[1]], task_stiffness: [[1]]}\n"
       "- {mass: [[1]], jacobian: [[1]], task_stiffness: [[-1]]}\n",
       "-: [1].task_stiffness: is not positive semidefinite"},
      {{"--damping-ratio", "1", "--region"},
       "- {mass: [[1]], jacobian: [[1]], task_stiffness: [[1]]}\n"
       "- {mass: [[1]], jacobian: [[1], [1]], task_stiffness: [[1, 0], [0, 1]]}\n",
       "-: [1].jacobian: has other directions"},
      {{"--damping-ratio", "1", "--region"}, "[]\n", "lists no configurations"},
      {{"--damping-ratio", "1"},
       kArm + "task_damping: [[1]]\njacobian_rate: [[1, 1]]\n",
       "jacobian_rate: depends on the damping"},
      {{"--damping-ratio", "1"},
       "mass: [[1, 0], [1, 1]]\nstiffness: [[1, 0], [0, 1]]\n",
       "mass: is not symmetric"},
      {{"--damping-ratio", "1e308"}, kArm, "--damping-ratio: a positive ratio up to 1e9 is"},
      {{"--damping-ratio", "1", "--delay", "1"}, kArm, "--period: missing"},
      {{"--damping-ratio", "1", "--margin", "3"}, kArm, "--period: missing"},
      {{"--damping-ratio", "1", "--integral-time", "1"}, kArm, "--period: missing"},
      {{"--damping-ratio", "1", "--period", "0.001", "--integral-time", "-1 s"},
       kArm,
       "a time in s is wanted"},
      {{"--damping-ratio", "1", "--period", "0"}, kArm, "a period up to 0.1 s is wanted"},
      {{"--damping-ratio", "1", "--period", "0.001", "--margin", "0.99"},
       kArm,
       "a factor of at least 1"},
      {{"--damping-ratio", "1", "--period", "0.001", "--delay", "-1"}, kArm, "--delay"},
      {{"--damping-ratio", "1", "--period", "0.001", "--cutoff", "nan"}, kArm, "a frequency in Hz"},
      {{"--damping-ratio", "1", "--payload", "1"}, kArm, "--urdf: missing"},
      {{"--damping-ratio", "1", "--q", "1"}, kArm, "--urdf: missing"}};
  for (const Bad& bad : all) {
    const Outcome outcome = run_program(joined({"design", "-"}, bad.options), bad.text);
    expect_refusal(outcome, bad.reason);
    EXPECT_THAT(outcome.err, StartsWith("dashpot design: "));
  }
  const Words arm = {"--damping-ratio", "1", "--task-stiffness", "1,1,1,1,1,1"};
  expect_refusals(
      of_panda("design", {}),
      {{{"--damping-ratio", "1"}, "--task-stiffness: or --joint-stiffness is needed"},
       {{"--damping-ratio", "1", "--task-stiffness", "1,2"}, "2 numbers, expected 6"},
       {joined(arm, {"--q", "1"}), "1 number, expected 7"},
       {joined(arm, {"--period", "1 kg"}), "--period: a period up to 0.1 s is wanted, not"},
       {joined(arm, {"x.yaml"}), "FILE: does not go with --urdf"},
       {joined(arm, {"--viscous-friction", "1,2"}),
        "--viscous-friction: 2 numbers, expected 1 or 7"},
       {joined(arm, {"--reflected-inertia", "-1"}), "--reflected-inertia: a number is negative"},
       {joined(arm, {"--payload", "1,2"}), "--payload: 2 numbers, expected 1 (mass), 4"},
       {joined(arm, {"--payload", "-1"}), "--payload: the mass is negative"}});
}

}  // namespace
}  // namespace dashpot::tests
