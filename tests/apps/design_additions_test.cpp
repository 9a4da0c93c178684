// `dashpot design` with existing friction, null-space damping, inertia of the drives and a payload,
// from a file and from a robot description.
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
