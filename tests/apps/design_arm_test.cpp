// The Panda of the paper (Fig. 1).
#include <dashpot/controller/dynamics.hpp>
#include <dashpot/tests/apps/json_result.hpp>
#include <dashpot/tests/support/arms.hpp>

#include <Eigen/Eigenvalues>
#include <Eigen/LU>
#include <algorithm>
#include <cmath>
#include <complex>

namespace dashpot::tests {
namespace {

using Eigen::MatrixXd;
using Eigen::VectorXd;

const std::string kPandaPose =
    "0,-0.785398163397448,0,-2.356194490192345,0,1.570796326794897,"
    "0.785398163397448";

// K_C and C1 of Fig. 1; the paper's Table 1 has 0.0294, 0.0316, 0.0255 at 9.755, 10.98, 20.25 rad/s
// for the three slow modes.
TEST(DesignOfThePaper, LiftsThePandaFromThreeHundredthsToWhatIsWanted) {
  const Json result = parse(run_program(
      of_panda("design", {"--q", kPandaPose, "--task-stiffness", "2000,600,2000,100,100,100",
                          "--task-damping", "5,3,5,1,1,1", "--damping-ratio", "0.7", "--json"})));
  const Numbers before = of_modes(result["before"], "damping_ratio");
  const Numbers frequencies = of_modes(result["before"], "natural_frequency");
  ASSERT_EQ(before.size(), 6U);
  EXPECT_NEAR(before[3], 0.0255, 1e-4);
  EXPECT_NEAR(before[4], 0.0316, 1e-4);
  EXPECT_NEAR(before[5], 0.0295, 1e-4);
  EXPECT_NEAR(frequencies[3], 20.25, 0.006 * 20.25);  // the paper's hand has fingers, ours has none
  EXPECT_NEAR(frequencies[4], 10.98, 0.006 * 10.98);
  EXPECT_NEAR(frequencies[5], 9.755, 0.006 * 9.755);
  EXPECT_EQ(result["reached"], true);
  for (const double ratio : of_modes(result, "damping_ratio")) EXPECT_NEAR(ratio, 0.7, 1e-9);
}

TEST(DesignOfAnArm, TakesUnits) {
  const auto result = [&](const Words& more) {
    return parse(
        run_program(of_panda("design", joined({"--json", "--damping-ratio", "0.7"}, more))));
  };
  const std::string posture = "0,-45 deg,0,-135 deg,0,90 deg,45 deg";
  EXPECT_EQ(result({"--q", posture, "--task-stiffness", "2 kN/m,600,2000 N/m,100 Nm/rad,100,100",
                    "--payload", "500 g,0,0,5 cm", "--period", "1ms", "--cutoff", "0.2 kHz",
                    "--viscous-friction", "1Nms/rad"}),
            result({"--q",
                    "0,-0.7853981633974483,0,-2.356194490192345,0,1.5707963267948966,"
                    "0.7853981633974483",
                    "--task-stiffness", "2000,600,2000,100,100,100", "--payload", "0.5,0,0,0.05",
                    "--period", "0.001", "--cutoff", "200", "--viscous-friction", "1"}));
}

const Words kTouching = {"--task-stiffness",
                         "600,600,600,40,40,40",
                         "--drives",
                         "panda",
                         "--q",
                         kPandaPose,
                         "--damping-ratio",
                         "0.7",
                         "--direction",
                         "0,0.6,0.8",
                         "--json"};

/// Against the modes of the matrices, at stiffnesses between those that were looked at.
TEST(DesignForContact, HoldsTheRatioInTheAirAndAgainstEveryStiffness) {
  const Json found =
      parse(run_program(of_panda("design", joined(kTouching, {"--contact", "1e4"}))));
  EXPECT_EQ(found["contact"], Json({{"asked", 1e4}, {"holds_to", 1e4}}));
  EXPECT_EQ(found["samples"][0]["touch"], 0);
  const Json arm =
      parse(run_program(of_panda("inspect", {"--drives", "panda", "--q", kPandaPose, "--json"})));
  const Rows J = arm["jacobian"];
  Json system = {
      {"mass", arm["mass_matrix"]}, {"jacobian", J}, {"task_damping", found["task_damping"]}};
  for (const double k : {600., 600., 600., 40., 40., 40.}) {
    Numbers row(6, 0);
    row[system["task_stiffness"].size()] = k;
    system["task_stiffness"].push_back(row);
  }
  for (const double k : {0., 7., 130., 900., 2345., 6e3, 9999.}) {
    Rows spring(7, Numbers(7));
    for (std::size_t i = 0; i < 7; ++i) {
      for (std::size_t j = 0; j < 7; ++j) {
        spring[i][j] = k * (0.6 * J[1][i] + 0.8 * J[2][i]) * (0.6 * J[1][j] + 0.8 * J[2][j]);
      }
    }
    system["stiffness"] = spring;
    for (const double ratio : of_modes(analyze_json(system.dump()), "damping_ratio")) {
      EXPECT_GT(ratio, 0.999 * 0.7) << k;
    }
  }
}

TEST(DesignForContact, SaysUpToWhichStiffnessALoopBearsSuchDamping) {
  const Words loop = {"--period", "1 ms", "--delay", "4", "--contact", "1e5"};
  const Json found = parse(run_program(of_panda("design", joined(kTouching, loop))));
  const double up_to = found["contact"]["holds_to"];
  EXPECT_GT(up_to, 1e3);
  EXPECT_LT(up_to, 1e5);
  double most = 0;
  for (const Json& sample : found["samples"]) {
    EXPECT_GE(sample["gain_margin"], 2) << sample["touch"];
    EXPECT_GE(sample["damping_ratio"], 0.999 * 0.7) << sample["touch"];
    most = std::max(most, sample["touch"].get<double>());
  }
  EXPECT_EQ(most, up_to);
  const Scratch scratch;
  const Json task = {{"stiffness", {600, 600, 600, 40, 40, 40}},
                     {"damping", found["task_damping"]}};
  const std::string gains = scratch.write("gains.yaml", Json{{"gains", {{"task", task}}}}.dump());
  const Json touching = parse(
      run_program(of_panda("contact", {"--gains", gains, "--drives", "panda", "--q", kPandaPose,
                                       "--delay", "4", "--direction", "0,0.6,0.8", "--json"})));
  EXPECT_GT(touching["posture"]["limit_lower"], up_to);
  Words table = joined(kTouching, loop);
  std::erase(table, "--json");
  EXPECT_THAT(run_program(of_panda("design", table)).out,
              ::testing::HasSubstr(
                  "The ratio of 0.700 holds in the air and against every stiffness up to "));
}

TEST(DesignForContact, RefusesWhatDoesNotGoTogether) {
  expect_refusals({"design"}, {{{example("baxter7.yaml"), "--damping-ratio", "1", "--contact", "1"},
                                "--contact: needs --urdf"}});
  const Words arm =
      of_panda("design", {"--task-stiffness", "600,600,600,40,40,40", "--damping-ratio", "0.7"});
  expect_refusals(arm, {{{"--direction", "z"}, "--direction: needs --contact"},
                        {{"--contact", "-1"}, "--contact: a stiffness up to 1e12"},
                        {{"--contact", "1", "--direction", "0,0,0"}, "--direction: is zero"},
                        {{"--contact", "1", "--near"}, "does not go with --contact"}});
}

// `dashpot design` with existing friction, null-space damping, inertia of the drives and a payload,
// from a file and from a robot description.

const std::string kQ = "0,-0.785,0,-2.356,0,1.571,0.785";
Json panda(const Words& options) {
  return parse(run_program(
      of_panda("design", joined({"--q", kQ, "--task-stiffness", "2000,600,2000,100,100,100",
                                 "--damping-ratio", "0.7", "--json"},
                                options))));
}

MatrixXd matrix(const Json& rows) {
  MatrixXd A(rows.size(), rows[0].size());
  for (Eigen::Index i = 0; i < A.rows(); ++i) {
    for (Eigen::Index j = 0; j < A.cols(); ++j) {
      A(i, j) = rows[static_cast<std::size_t>(i)][static_cast<std::size_t>(j)];
    }
  }
  return A;
}

/// Ratios of the oscillating modes of an arm of the controller's model, with the designed damping
/// C_C and the additional damping D, from eigenvalues of the first-order system.
std::vector<double> ratios(const controller::ModelOptions& options, const MatrixXd& C_C,
                           const MatrixXd& D) {
  const auto model = testing::arm_model(testing::arms()[0], options);
  controller::JointVector q(7);
  q << 0, -0.785, 0, -2.356, 0, 1.571, 0.785;
  const auto robot = evaluate(model, q, controller::JointVector::Zero(7));
  const MatrixXd M = robot.M, J = robot.J, inverse = M.inverse();
  const MatrixXd K_C = VectorXd{{2000, 600, 2000, 100, 100, 100}}.asDiagonal();
  MatrixXd A = MatrixXd::Zero(14, 14);
  A.topRightCorner(7, 7).setIdentity();
  A.bottomLeftCorner(7, 7) = -inverse * J.transpose() * K_C * J;
  A.bottomRightCorner(7, 7) = -inverse * (J.transpose() * C_C * J + D);
  std::vector<double> result;
  const Eigen::VectorXcd values = Eigen::EigenSolver<MatrixXd>(A, false).eigenvalues();
  for (const std::complex<double>& value : values) {
    if (value.imag() > 1) result.push_back(-value.real() / std::abs(value));
  }
  return result;
}

TEST(DesignBesideWhatIsThere, CountsWhatTheOptionsAdd) {
  const Json result = panda({"--viscous-friction", "0.2", "--reflected-inertia",
                             "0.1,0.2,0.1,0.1,0.05,0.05,0.05", "--payload", "1.5,0,0,0.05"});
  EXPECT_EQ(result["reached"], true);
  controller::ModelOptions options;
  options.reflected_inertia = VectorXd{{0.1, 0.2, 0.1, 0.1, 0.05, 0.05, 0.05}};
  options.payload.mass = 1.5;
  options.payload.center.z() = 0.05;
  const MatrixXd friction = 0.2 * MatrixXd::Identity(7, 7);
  const auto found = ratios(options, matrix(result["task_damping"]), friction);
  ASSERT_EQ(found.size(), 6U);
  for (const double ratio : found) EXPECT_NEAR(ratio, 0.7, 1e-7);
  const auto without = ratios({}, matrix(result["task_damping"]), friction);
  EXPECT_GT(std::abs(*std::max_element(without.begin(), without.end()) - 0.7), 0.05);
}

TEST(DesignBesideWhatIsThere, TakesTheFrictionOfTheDescriptionOnlyIfAsked) {
  const double plain = panda({})["task_damping"][0][0];
  const double with = panda({"--viscous-friction", "urdf"})["task_damping"][0][0];
  EXPECT_LT(with, plain);
  EXPECT_NEAR(with, panda({"--viscous-friction", "0.003"})["task_damping"][0][0], 1e-12);
}

// N' D N damps the self-motion alone.
TEST(DesignBesideWhatIsThere, NullSpaceDampingLeavesTheDesignAlone) {
  const Json plain = panda({}), with = panda({"--null-damping", "5"});
  const MatrixXd C = matrix(plain["task_damping"]);
  EXPECT_LT((matrix(with["task_damping"]) - C).norm(), 1e-9 * C.norm());
  EXPECT_EQ(with["reached"], true);
  EXPECT_NEAR(plain["after"]["zero_mode_rates"][0], 0, 1e-9);
  EXPECT_LT(with["after"]["zero_mode_rates"][0], -1);
}

// Without a projector springs of the joints stiffen the modes of the tip, which damping at the tip
// alone then does not reach.
TEST(DesignBesideWhatIsThere, CountsSpringsThroughTheProjectorThatActs) {
  const Json none = panda({"--null-stiffness", "20", "--null-projector", "none"});
  const Json dynamic = panda({"--null-stiffness", "20"}), of_tip = panda({});
  const auto fastest = [](const Json& found) {
    return found["before"]["modes"][0]["natural_frequency"].get<double>();
  };
  EXPECT_EQ(none["modes"].size(), 7U);
  EXPECT_EQ(dynamic["modes"].size(), 7U);
  EXPECT_EQ(none["misses"].size(), 7U);
  EXPECT_EQ(dynamic["misses"].size(), 1U);  // the elbow, which C_C does not move
  EXPECT_NEAR(fastest(dynamic), fastest(of_tip), 1e-9);
  EXPECT_GT(fastest(none), 1.05 * fastest(of_tip));
  const MatrixXd C = matrix(of_tip["task_damping"]);
  const Json few = panda({"--null-damping", "1", "--null-projector", "kinematic"});
  EXPECT_LT((matrix(dynamic["task_damping"]) - C).norm(), 1e-6 * C.norm());
  EXPECT_GT((matrix(few["task_damping"]) - C).norm(), 1e-3 * C.norm());
}

const std::string kSix =
    "mass: [[2,0,0,0,0,0],[0,2,0,0,0,0],[0,0,2,0,0,0],[0,0,0,1,0,0],[0,0,0,0,1,0],[0,0,0,0,0,1]]\n"
    "jacobian: [[1,0,0,0,0,0],[0,1,0,0,0,0],[0,0,1,0,0,0],[0,0,0,1,0,0],[0,0,0,0,1,0],"
    "[0,0,0,0,0,0]]\n"
    "task_stiffness: [[100,0,0,0,0,0],[0,100,0,0,0,0],[0,0,100,0,0,0],[0,0,0,9,0,0],[0,0,0,0,9,0],"
    "[0,0,0,0,0,9]]\n";

TEST(DesignBesideWhatIsThere, ReadsTheSameFromAFile) {
  const auto design = [](const std::string& text) {
    return parse(run_program({"design", "-", "--damping-ratio", "0.5", "--json"}, kSix + text));
  };
  // sqrt(k m): 10 sqrt(2 + 2), sqrt(9 (1 + 3)), less friction
  const Json result = design(
      "payload: 2\nreflected_inertia: [0, 0, 0, 3, 0, 0]\n"
      "null_damping: [0, 0, 0, 0, 0, 4]\n");
  EXPECT_NEAR(result["task_damping"][0][0], 20, 1e-10);
  EXPECT_NEAR(result["task_damping"][3][3], 6, 1e-10);
  EXPECT_NEAR(result["task_damping"][4][4], 3, 1e-10);
  EXPECT_NEAR(result["after"]["zero_mode_rates"][0], -4, 1e-10);
  for (const std::string wrong :
       {"payload: -1\n", "payload: [1]\n", "reflected_inertia: [1]\n", "null_damping: [1, 2]\n",
        "reflected_inertia: [0, 0, 0, -3, 0, 0]\n"}) {
    expect_refusal(run_program({"design", "-", "--damping-ratio", "0.5"}, kSix + wrong),
                   wrong.substr(0, wrong.find(':')));
  }
}

}  // namespace
}  // namespace dashpot::tests
