// The Panda of the paper (Fig. 1).
#include <dashpot/tests/apps/json_result.hpp>

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
