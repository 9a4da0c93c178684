// Missing rotors of a model, the inertia that would be enough, and the published drives.
#include <dashpot/controller/audit.hpp>
#include <dashpot/controller/config.hpp>
#include <dashpot/controller/default_settings.hpp>
#include <dashpot/controller/gain_judge.hpp>
#include <dashpot/controller/rotors.hpp>
#include <dashpot/tests/support/arms.hpp>
#include <dashpot/tests/support/matrices.hpp>
#include <dashpot/tests/support/random.hpp>
#include <dashpot/tests/support/scratch.hpp>

#include <gmock/gmock.h>

#include <set>
#include <string>

namespace dashpot::controller {
namespace {

using ::testing::AllOf;
using ::testing::HasSubstr;
using ::testing::Not;

RobotModel fr3(const std::string& drives = "", JointVector inertia = {}) {
  ModelOptions options;
  options.drives = drives;
  options.reflected_inertia = std::move(inertia);
  return testing::arm_model(testing::all_arms()[5], options);
}

JointVector franka_home() {
  return JointVector{{0, -0.785, 0, -2.356, 0, 1.571, 0.785}};
}

AuditOptions crisp() {
  AuditOptions options;
  const Vector6 stiffness{{500, 500, 500, 30, 30, 30}};
  options.gains.task_stiffness = stiffness.asDiagonal();
  options.gains.task_damping = Vector6(2 * stiffness.cwiseSqrt()).asDiagonal();
  options.period = 1e-3;
  options.delay = 1;
  return options;
}

TEST(Drives, HaveFiguresWithSourceAndDoubt) {
  std::set<std::string_view> names;
  for (const Drives& drives : published_drives()) {
    SCOPED_TRACE(drives.name);
    EXPECT_TRUE(names.insert(drives.name).second);
    EXPECT_GT(drives.values(drives.reflected_inertia).minCoeff(), 0);
    EXPECT_GE(drives.values(drives.viscous_friction).minCoeff(), 0);
    EXPECT_GE(drives.values(drives.coulomb_friction).minCoeff(), 0);
    EXPECT_GT(drives.source.size(), 20U);
    EXPECT_GT(drives.doubt.size(), 20U);
    EXPECT_EQ(&find_drives(drives.name, drives.joints), &drives);
    EXPECT_THROW(find_drives(drives.name, drives.joints + 1), InvalidModel);
  }
  for (const char* arm :
       {"ur3e", "ur5e", "ur10e", "fr3", "panda", "iiwa7", "iiwa14", "gen3", "xarm7"}) {
    EXPECT_EQ(names.count(arm), 1U) << arm;
  }
  EXPECT_THROW(find_drives("none"), InvalidModel);
}

TEST(Drives, FillInWhatIsNotGivenAndSuitArmsOfTheirName) {
  const Drives& drives = find_drives("fr3");
  const JointVector inertia = drives.values(drives.reflected_inertia);
  EXPECT_EQ(fr3("fr3").joint_values(&Joint::reflected_inertia), inertia);
  EXPECT_EQ(fr3("fr3").joint_values(&Joint::viscous_friction),
            fr3().joint_values(&Joint::viscous_friction));
  const JointVector given = JointVector::Constant(7, 0.03);
  EXPECT_EQ(fr3("fr3", given).joint_values(&Joint::reflected_inertia), given);
  EXPECT_EQ(drives_like(fr3()), &drives);
  EXPECT_EQ(drives_like(testing::arm_model(testing::arms()[3])), nullptr);  // Baxter
  EXPECT_THROW(fr3("ur5e"), InvalidModel);
}

TEST(Drives, AreNamedInAConfiguration) {
  const std::string robot = "robot: {urdf: " + testing::arm_path("fr3") +
                            ", base: fr3_link0, tip: fr3_hand_tcp, drives: ";
  const Drives& drives = find_drives("fr3");
  const RobotModel plain = read_config(text::parse_yaml(robot + "fr3}"), "").model;
  EXPECT_EQ(plain.joint_values(&Joint::reflected_inertia), drives.values(drives.reflected_inertia));
  EXPECT_EQ(plain.joint_values(&Joint::coulomb_friction),
            fr3().joint_values(&Joint::coulomb_friction));
  const RobotModel rubs =
      read_config(text::parse_yaml(robot + "fr3, drives_friction: true}"), "").model;
  EXPECT_EQ(rubs.joint_values(&Joint::coulomb_friction), drives.values(drives.coulomb_friction));
  EXPECT_EQ(rubs.joint_values(&Joint::viscous_friction), drives.values(drives.viscous_friction));
}

TEST(Drives, AreReadFromAFile) {
  const tests::Scratch scratch;
  const std::string file =
      scratch.write("mine.yaml",
                    "# measured\nreflected_inertia: [0.3, 0.3, 0.2, 0.2, 0.1, 0.1, 0]\n"
                    "coulomb_friction: [1, 1, 1, 1, 1, 1, 0.5]\nsource: my arm\n");
  EXPECT_EQ(fr3(file).joint_values(&Joint::reflected_inertia)[2], 0.2);
  EXPECT_EQ(find_drives(file).source, "my arm");
  EXPECT_EQ(find_drives(file, 7).coulomb_friction[6], 0.5);
  const std::string robot = "robot: {urdf: " + testing::arm_path("fr3") +
                            ", base: fr3_link0, tip: fr3_hand_tcp, drives: mine.yaml, "
                            "drives_friction: true}";
  const RobotModel model =
      read_config(text::parse_yaml(robot), std::filesystem::path(file).parent_path()).model;
  EXPECT_EQ(model.joint_values(&Joint::coulomb_friction)[0], 1);
  scratch.write("mine.yaml", "reflected_inertia: [0.4, 0.3, 0.2, 0.2, 0.1, 0.1, 0]\n");
  EXPECT_EQ(find_drives(file).reflected_inertia[0], 0.4);  // read again
  const auto refusal = [&](const std::string& text) {
    try {
      find_drives(scratch.write("bad.yaml", text), 7);
    } catch (const InvalidModel& error) {
      return std::string(error.what());
    }
    return std::string();
  };
  EXPECT_THAT(refusal("reflected_inertia: [1, 2]\n"), HasSubstr("has 2 joints, the arm has 7"));
  EXPECT_THAT(refusal("reflected_inertia: [1, -2]\n"), HasSubstr("bad.yaml: reflected_inertia"));
  EXPECT_THAT(refusal("coulomb_friction: [1]\n"), HasSubstr("reflected_inertia: missing"));
  EXPECT_THAT(refusal("rotors: [1]\n"), HasSubstr("rotors"));
  EXPECT_THROW(find_drives(scratch.path("none.yaml")), InvalidModel);
}

TEST(Rotors, OfAModelWithoutAreNamed) {
  EXPECT_EQ(missing_rotors_text(fr3("fr3")), "");
  EXPECT_EQ(missing_rotors_text(fr3()), "the model has no reflected inertia of any joint");
  JointVector some = JointVector::Constant(7, 0.1);
  some[4] = some[6] = 0;
  EXPECT_EQ(missing_rotors_text(fr3("", some)),
            "the model has no reflected inertia of fr3_joint5, fr3_joint7");
  EXPECT_EQ(unknown_rotors(fr3("", some)).joints, (std::vector<int>{4, 6}));
  EXPECT_THAT(rotors_hint(fr3(), "--reflected-inertia", "--drives"), HasSubstr("--drives fr3."));
}

TEST(Rotors, ReplacedInAModelAreThoseThatItIsReadWith) {
  testing::Random random(431);
  const JointVector inertia = random.vector(7).cwiseAbs(), q = random.vector(7),
                    qd = random.vector(7);
  const DynamicsResult replaced = evaluate(fr3().with_reflected_inertia(inertia), q, qd);
  const DynamicsResult read = evaluate(fr3("", inertia), q, qd);
  EXPECT_EQ(replaced.M, read.M);
  EXPECT_EQ(replaced.coriolis, read.coriolis);
  EXPECT_EQ(replaced.J, read.J);
}

/// The margin of an FR3 under the defaults of crisp is far below 1 without rotors.
TEST(Rotors, WithWhatIsEnoughTheMarginIsThereAndNotWithLess) {
  const Audit audit(fr3(), crisp());
  const JointVector q = franka_home();
  const PostureAudit found = audit.audit(q);
  ASSERT_LT(found.numbers.gain_margin, 1);
  const MissingRotors missing = audit.missing_rotors(found);
  ASSERT_TRUE(missing.inertia);
  EXPECT_EQ(missing.inertia->head(3), JointVector::Zero(3)) << "these need none";
  EXPECT_GT((*missing.inertia)[6], 0);
  EXPECT_EQ(missing.compared, find_drives("fr3").values(find_drives("fr3").reflected_inertia));
  EXPECT_NEAR(missing.numbers.gain_margin, Audit(fr3("fr3"), crisp()).numbers(q).gain_margin, 1e-5);
  const auto margin = [&](double share) {
    return Audit(fr3("", share * *missing.inertia), crisp()).numbers(q).gain_margin;
  };
  EXPECT_GE(margin(1), 2);
  EXPECT_LT(margin(0.9), 2);
  // Slow modes change less than fast ones.
  const auto& modes = found.spectrum.modes;
  ASSERT_EQ(missing.damping_ratios.size(), modes.size());
  for (int i = 3; i < modes.size(); ++i) {
    EXPECT_NEAR(missing.damping_ratios[i] / modes[i].damping_ratio, 1, 0.3);
  }
  // The two slow ranks cross: the shapes tell which mode is which.
  EXPECT_NEAR(missing.damping_ratios[3] / modes[3].damping_ratio, 0.87, 0.02);
  EXPECT_NEAR(missing.damping_ratios[4] / modes[4].damping_ratio, 0.93, 0.02);
  EXPECT_LT(missing.damping_ratios[0], 0.5 * modes[0].damping_ratio);
  EXPECT_FALSE(Audit(fr3("fr3"), crisp()).missing_rotors(found).inertia) << "nothing is missing";
  AuditOptions soft = crisp();
  soft.gains.task_stiffness *= 1e-4;
  soft.gains.task_damping *= 1e-3;
  const Audit slow(fr3(), soft);
  EXPECT_EQ(*slow.missing_rotors(slow.audit(q)).inertia, JointVector::Zero(7));
}

TEST(Rotors, MissingAreWhatTheJudgeSaysOfGainsThatItRefuses) {
  Settings settings = default_settings(fr3());
  settings.analysis.sampled.delay = 1;
  Gains gains = settings.initial.gains;
  gains.task_damping_ratio = gains.null_damping_ratio = 0;
  gains.task_stiffness = crisp().gains.task_stiffness;
  gains.task_damping = crisp().gains.task_damping;
  const JointVector q = franka_home();
  GainJudge judge(fr3(), settings);
  const GainJudge::Verdict verdict = judge.judge(q, gains);
  ASSERT_LT(verdict.margin, 1);
  const std::string said = judge.missing(verdict, gains);
  EXPECT_THAT(said,
              AllOf(HasSubstr("the model has no reflected inertia of any joint"),
                    HasSubstr("with the published drives fr3 the margin is enough"),
                    HasSubstr("with fr3_joint"), HasSubstr("kg m^2 the margin would be enough"),
                    HasSubstr("robot.reflected_inertia"), HasSubstr("robot.drives: fr3"),
                    Not(HasSubstr("\n"))));
  GainJudge known(fr3("fr3"), settings);
  EXPECT_GE(known.judge(q, gains).margin, 2);
  EXPECT_EQ(known.missing(known.judge(q, gains), gains), "");
}

}  // namespace
}  // namespace dashpot::controller
