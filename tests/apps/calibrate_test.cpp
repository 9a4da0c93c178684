// `dashpot calibrate`: the arm that comes back, as a table, JSON, a configuration and drives.
#include <dashpot/tests/apps/scene_run.hpp>
#include <dashpot/tests/support/arms.hpp>
#include <dashpot/tests/support/torque_record.hpp>

namespace dashpot::tests {
namespace {

using ::testing::HasSubstr;

/// A Panda with rotors and friction, in a file beside its configuration.
class CalibrateProgram : public ::testing::Test {
 protected:
  CalibrateProgram() {
    testing::RecordedArm arm({testing::arm_path("panda"), "panda_link0", "panda_hand_tcp", {}});
    arm.center.resize(7);
    arm.center << 0.2, -0.4, 0.3, -1.9, 0.1, 1.7, 0.6;
    arm.coulomb << 0.8, 1.0, 0.6, 0.9, 0.4, 0.3, 0.2;
    arm.viscous << 0.5, 0.8, 0.3, 0.6, 0.2, 0.1, 0.05;
    arm.description.options.reflected_inertia = Eigen::VectorXd::Constant(7, 0.3);
    arm.description.options.reflected_inertia[6] = 0;
    arm.duration = 12;
    arm.rate = 100;
    arm.slowest = 0.25;
    const identification::TorqueRecord record = arm.record(31);
    std::string text = "time [s]";
    for (int j = 1; j <= 7; ++j) text += ",q" + std::to_string(j);
    for (int j = 1; j <= 7; ++j) text += ",tau" + std::to_string(j);
    for (Eigen::Index i = 0; i < record.time.size(); ++i) {
      text += "\n" + printed("%g", record.time[i]);
      for (const double value : record.position.col(i)) text += printed(",%.7f", value);
      for (const double value : record.torque.col(i)) text += printed(",%.7f", value);
    }
    file_ = scratch_.write("a.csv", text + "\n");
    config_ = scratch_.write("arm.yaml", "# mine\nrobot:\n  urdf: " + testing::arm_path("panda") +
                                             "\n  base: panda_link0\n  tip: panda_hand_tcp\n");
  }

  Scratch scratch_;
  std::string file_, config_;
};

TEST_F(CalibrateProgram, GivesTheArmBack) {
  const std::string written = scratch_.path("new.yaml"), drives = scratch_.path("drives.yaml");
  const Json found =
      parse(run_program({"calibrate", file_, "--config", config_, "--payload", "known", "--write",
                         written, "--write-drives", drives, "--json"}));
  for (std::size_t j = 0; j < 6; ++j) {
    const Json& joint = found["joints"][j];
    EXPECT_TRUE(joint["determined"]["reflected_inertia"].get<bool>()) << j;
    EXPECT_NEAR(joint["reflected_inertia"].get<double>(), 0.3, 0.03);
    EXPECT_GT(joint["explained"]["after"].get<double>(),
              joint["explained"]["before"].get<double>());
    EXPECT_TRUE(joint["wanted"].is_null()) << joint["wanted"];
  }
  EXPECT_FALSE(found["joints"][6]["determined"]["reflected_inertia"].get<bool>());
  EXPECT_THAT(found["joints"][6]["wanted"].dump(), HasSubstr("reflected inertia, below 0.0"));
  EXPECT_NEAR(found["delay"].get<double>(), 0, 1e-3);
  EXPECT_NEAR(found["validation"].get<double>(), 0.2 * found["seconds"].get<double>(), 1e-9);
  EXPECT_EQ(found["information"]["rank"], found["information"]["parameters"]);
  ASSERT_EQ(found["modes"].size(), 7U);
  const Json& fastest = found["modes"][0];
  EXPECT_LT(fastest["natural_frequency_std"].get<double>(),
            0.05 * fastest["natural_frequency"].get<double>());

  const std::string text = scratch_.read("new.yaml");
  EXPECT_THAT(text, HasSubstr("# dashpot calibrate, 20"));
  EXPECT_THAT(text, HasSubstr("from a.csv\n"));
  EXPECT_THAT(text, HasSubstr("# mine\n"));
  EXPECT_THAT(text, HasSubstr("reflected_inertia: [0."));
  EXPECT_EQ(run_program({"check-model", file_, "--config", written}).status, 0);

  const Json inspected =
      parse(run_program({"inspect", "--urdf", testing::arm_path("panda"), "--base", "panda_link0",
                         "--tip", "panda_hand_tcp", "--drives", drives, "--json"}));
  EXPECT_NEAR(inspected["drives"]["reflected_inertia"][0].get<double>(), 0.3, 0.03);
  EXPECT_EQ(inspected["drives"]["reflected_inertia"][6], 0);
  EXPECT_NEAR(inspected["drives"]["coulomb_friction"][1].get<double>(), 1, 0.1);
  EXPECT_THAT(inspected["drives"]["doubt"].dump(), HasSubstr("joints 7 are not determined"));
}

TEST_F(CalibrateProgram, PrintsWhatIsDeterminedAndModes) {
  const Outcome table = run_program({"calibrate", file_, "--config", config_, "--validate", "0.3"});
  EXPECT_EQ(table.status, 0) << table.err;
  EXPECT_THAT(table.out, HasSubstr("of them kept for validation"));
  EXPECT_THAT(table.out, HasSubstr("The records determine"));
  EXPECT_THAT(table.out, HasSubstr("joint 7: reflected inertia"));
  EXPECT_THAT(table.out, HasSubstr("Delay: the torques act"));
  EXPECT_THAT(table.out, HasSubstr("Modes of the calibrated loop, at q = "));
  expect_refusal(run_program({"calibrate", file_, "--config", config_, "--write-drives",
                              scratch_.path("drives.txt")}),
                 "--write-drives: the name has to end with .yaml");
}

TEST_F(CalibrateProgram, SaysThatTheLoopIsUnstableWithTheGainsAtHand) {
  const std::string robot = "robot:\n  urdf: " + testing::arm_path("panda") +
                            "\n  base: panda_link0\n  tip: panda_hand_tcp\n"
                            "  reflected_inertia: 30 kg m^2\n  torque_loop_inertia_ratio: 0.9\n";
  const auto loop_with = [&](const std::string& damping) {
    const std::string config =
        scratch_.write("gains.yaml", robot +
                                         "control: {mode: joint}\n"
                                         "gains: {joint: {stiffness: 100, damping: " +
                                         damping + "}}\n");
    return run_program({"calibrate", file_, "--config", config, "--payload", "known"});
  };
  const Outcome calm = loop_with("10"), fierce = loop_with("1000");
  EXPECT_EQ(calm.status, 0) << calm.err;
  EXPECT_THAT(calm.out, HasSubstr("with a delay of 0 ticks"));
  EXPECT_THAT(calm.out, ::testing::Not(HasSubstr("UNSTABLE")));
  EXPECT_THAT(fierce.out, HasSubstr("These gains make this loop UNSTABLE")) << fierce.err;
}

}  // namespace
}  // namespace dashpot::tests
