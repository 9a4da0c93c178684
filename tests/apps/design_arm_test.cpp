// The arms of the paper: its Panda (Fig. 1) and the task of its Discussion.
#include <dashpot/analysis/damping_design.hpp>
#include <dashpot/analysis/spectrum.hpp>
#include <dashpot/controller/dynamics.hpp>
#include <dashpot/tests/apps/json_result.hpp>
#include <dashpot/tests/support/arms.hpp>

#include <Eigen/Core>

namespace dashpot::tests {
namespace {

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

/// Smallest damping ratio of the arm with C_C.
double smallest_ratio(const analysis::TaskImpedance& arm, const Eigen::MatrixXd& C_C) {
  double least = 1e9;
  for (const auto& mode :
       analysis::analyze(analysis::to_joint_space(analysis::with_damping(arm, C_C))).modes) {
    least = std::min(least, mode.damping_ratio);
  }
  return least;
}

TEST(DesignOfThePaper, OutdoesItsDiscussionWithADampingThatIsOne) {
  Eigen::MatrixXd C_C1 = Eigen::MatrixXd::Zero(6, 6);
  C_C1.diagonal() << 0.1, 0.1, 0.1, 10, 10, 1;
  C_C1(2, 4) = C_C1(4, 2) = 10;
  const Eigen::VectorXd negative = analysis::negative_eigenvalues(C_C1);
  ASSERT_EQ(negative.size(), 1);
  EXPECT_NEAR(negative[0], -6.108, 1e-3);
  for (const testing::Arm& one : testing::arms()) {
    const controller::RobotModel model = testing::arm_model(one);
    if (model.dof() != 7) continue;
    controller::JointVector q(7);
    q << 0.1, -0.7, 0.2, -1.9, 0.1, 1.4, 0.6;
    if (std::string(one.file) == "baxter_left") q << 0.1, -0.6, 0.2, 1.4, 0.1, 0.9, 0.3;
    const auto dynamics = controller::evaluate(model, q, controller::JointVector::Zero(7));
    analysis::TaskImpedance arm;
    arm.mass = dynamics.M;
    arm.jacobian = dynamics.J;
    arm.task_stiffness =
        Eigen::MatrixXd(Eigen::VectorXd{{3000, 3000, 3000, 100, 100, 100}}.asDiagonal());
    const double with_identity = smallest_ratio(arm, Eigen::MatrixXd::Identity(6, 6));
    const double with_paper = smallest_ratio(arm, C_C1);
    const auto design = analysis::design_damping(arm, analysis::DampingTarget::constant(0.7));
    EXPECT_TRUE(design.misses.empty());
    EXPECT_EQ(analysis::negative_eigenvalues(design.damping).size(), 0);
    EXPECT_LT(with_identity, 0.05);
    EXPECT_LT(with_paper, 0.3);
  }
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

}  // namespace
}  // namespace dashpot::tests
