// Postures of the command line: one default, refused where the arm cannot be.
#include <dashpot/controller/posture.hpp>
#include <dashpot/tests/apps/json_result.hpp>
#include <dashpot/tests/support/arms.hpp>
#include <dashpot/tests/support/sanitized.hpp>
#include <dashpot/tests/support/scratch.hpp>

#include <gmock/gmock.h>

#include <string>

namespace dashpot::tests {
namespace {

using ::testing::HasSubstr;

const Words kSprings = {"--task-stiffness", "400,400,400,20,20,20", "--damping-ratio", "0.7"};
const Words kGains = {"--stiffness", "400,400,400,20,20,20", "--damping-factor", "1.4"};
const Json kMiddle = {0.0, 0.0, 0.0, -1.5708, 0.0, 1.8675, 0.0};

Outcome ask_panda(const std::string& command, const Words& gains, const Words& more = {}) {
  const auto& arm = dashpot::testing::arms()[0];
  const Words words = {command, "--urdf", dashpot::testing::arm_path(arm.file), "--base", arm.base,
                       "--tip", arm.tip};
  return run_program(joined(joined(words, gains), more));
}

TEST(Postures, AreTheMiddleOfTheLimitsUnlessToldOtherwise) {
  EXPECT_EQ(parse(ask_panda("audit", kGains, {"--json"}))["posture"]["q"], kMiddle);
  EXPECT_EQ(parse(ask_panda("design", kSprings, {"--json"}))["q"], kMiddle);
  EXPECT_THAT(ask_panda("design", kSprings).out,
              HasSubstr("at q = 0, 0, 0, -1.5708, 0, 1.8675, 0\n"));
}

TEST(Postures, OutsideTheLimitsAreRefusedUnlessAskedFor) {
  for (const auto& [command, gains] : {std::pair("audit", kGains), {"design", kSprings}}) {
    expect_refusal(ask_panda(command, gains, {"--q", "0,-45,0,-135,0,90,45"}),
                   "--q: joint 'panda_joint2' at -45 rad is outside its limits -1.7628 to 1.7628 "
                   "rad; if these are degrees");
    expect_refusal(ask_panda(command, gains, {"--q", "0,1.9,0,-1.5,0,1.5,0"}),
                   "joint 'panda_joint2' at 1.9 rad is outside its limits -1.7628 to 1.7628 rad; "
                   "--outside-limits");
    expect_refusal(ask_panda(command, gains, {"--q", "0,-45,0,-135 deg,0,90,45"}),
                   "--q: '-45' has no unit beside '-135 deg'");
    const Outcome taken =
        ask_panda(command, gains, {"--q", "0,1.9,0,-1.5,0,1.5,0", "--outside-limits"});
    EXPECT_EQ(taken.status, 0);
    EXPECT_EQ(count_lines(taken.err), 1);
    EXPECT_THAT(taken.err, HasSubstr("warning: --q: joint 'panda_joint2'"));
  }
}

/// Damping cannot be designed if a direction has no spring.
TEST(Postures, ThatAreSingularAreRefusedOrAvoided) {
  const std::string straight = "0,0,0,-0.0698,0,1.5,0";
  const Outcome refused = ask_panda("design", kSprings, {"--q", straight});
  expect_refusal(refused, "--q: the posture is singular: no spring acts in direction y - 0.24 rz");
  EXPECT_EQ(
      ask_panda("design", {"--joint-stiffness", "9", "--damping-ratio", "0.7"}, {"--q", straight})
          .status,
      0);
  for (const testing::Arm& arm : testing::all_arms()) {
    const controller::RobotModel model = testing::arm_model(arm);
    const controller::JointVector q = controller::default_posture(model);
    EXPECT_EQ(controller::lost_directions(model, q), "") << arm.file;
    EXPECT_EQ(controller::outside_limits(model, q), "") << arm.file;
  }
}

TEST(Postures, AtWhichTheArmCannotHoldItselfAreNamed) {
  const Outcome heavy = ask_panda("audit", kGains, {"--payload", "40"});
  EXPECT_EQ(heavy.status, 0);
  EXPECT_THAT(heavy.err, HasSubstr("warning: --q: the arm cannot hold itself here: joint "
                                   "'panda_joint6' needs "));
  EXPECT_THAT(heavy.err, HasSubstr(" N m, its effort limit is "));
}

/// As `dashpot tune` exports them.
TEST(Postures, OfGainsWithARatioHaveThatRatio) {
  const Scratch scratch;
  const std::string file = scratch.write("gains.yaml",
                                         "gains: {task: {stiffness: [400, 400, 400, 30, 30, 30], "
                                         "damping_ratio: 0.6}}\n");
  const Outcome outcome =
      ask_panda("audit", {"--gains", file}, {"--json", "--samples", "40", "--drives", "panda"});
  EXPECT_EQ(outcome.status, 0) << outcome.err;
  const Json result = parse(outcome);
  EXPECT_NEAR(result["posture"]["smallest_ratio"].get<double>(), 0.6, 1e-6);
  EXPECT_NEAR(result["workspace"]["smallest_ratio"]["median"].get<double>(), 0.6, 1e-3);
  EXPECT_GT(result["workspace"]["smallest_ratio"]["p05"].get<double>(), 0.5);
}

TEST(Postures, OfAFileAreCheckedOneByOne) {
  const Scratch scratch;
  const std::string file =
      scratch.write("postures.yaml", "- [0, 0, 0, -1, 0, 1, 0]\n- [0, 0, 0, -1, 0, 9, 0]\n");
  expect_refusal(ask_panda("audit", kGains, {"--postures", file}),
                 "[1]: joint 'panda_joint6' at 9 rad is outside its limits");
}

TEST(RegionOfAnArm, IsOfThePosturesThatAreAskedFor) {
  expect_refusal(ask_panda("design", kSprings, {"--region"}),
                 "--region: an arm needs --samples, --postures or --log");
  expect_refusal(ask_panda("design", kSprings, {"--samples", "4"}), "--region");
  const Words small = {"--region", "--samples", "6", "--spread", "0.2", "--json"};
  const Json near = parse(ask_panda("design", kSprings, small));
  ASSERT_EQ(near["samples"].size(), 6U);
  for (const Json& sample : near["samples"]) {
    for (std::size_t i = 0; i < 7; ++i) {
      EXPECT_NEAR(sample["q"][i].get<double>(), kMiddle[i].get<double>(), 0.2);
    }
    EXPECT_GT(sample["damping_ratio"].get<double>(), 0.07);
  }
  EXPECT_NE(near["samples"][0]["q"], near["samples"][1]["q"]);
  const Words springs = {"--joint-stiffness", "100", "--damping-ratio", "0.7"};
  const Json joints = parse(ask_panda("design", springs, small));
  EXPECT_EQ(joints["damping"].size(), 7U);
}

TEST(RegionOfAnArm, SaysWhatBindsWhereTheAnswerMissesWhatWasAsked) {
  DASHPOT_SKIP_IF_QUICK();
  const Words wide = {"--region", "--samples", "8", "--keep-structure", "diagonal"};
  const Outcome little = ask_panda("design", kSprings, wide);
  EXPECT_EQ(little.status, 1);
  EXPECT_THAT(little.out, HasSubstr("Smallest ratio"));
  EXPECT_THAT(little.err, HasSubstr("is less than a tenth of the 0.700 wanted; what binds"));
  const Outcome too_much =
      ask_panda("design", kSprings, joined(wide, {"--viscous-friction", "300"}));
  EXPECT_EQ(too_much.status, 1);
  EXPECT_THAT(too_much.err, HasSubstr("the existing damping exceeds --largest-ratio"));
}

TEST(SingularPosture, NamesTheDirectionsAndSuggestsNothing) {
  // A UR5 with its elbow stretched: the wrist cannot come nearer to the base.
  const auto& arm = dashpot::testing::arms()[2];
  const auto at = [&](const std::string& elbow, const Words& more) {
    return run_program(joined({"audit", "--urdf", dashpot::testing::arm_path(arm.file), "--base",
                               arm.base, "--tip", arm.tip, "--q", "0,-1," + elbow + ",0,1,0"},
                              joined(kGains, more)));
  };
  const Json stretched = parse(at("0.001", {"--json"}));
  EXPECT_EQ(stretched["posture"]["singular"], true);
  EXPECT_THAT(stretched["posture"]["lost_directions"].get<std::string>(), HasSubstr("z"));
  EXPECT_TRUE(stretched["suggestion"].is_null());
  const std::string text = at("0.001", {}).out;
  EXPECT_THAT(text, HasSubstr("Zero modes: 0. Soft modes, which hardly any spring resists: 1."));
  EXPECT_THAT(text, HasSubstr("no spring acts in direction z + "));
  const Json bent = parse(at("1", {"--json"}));
  EXPECT_EQ(bent["posture"]["lost_directions"], "");
  EXPECT_FALSE(bent["suggestion"].is_null());
}

TEST(Options, OfOneMeaningTakeEitherName) {
  const Outcome audit = ask_panda("audit", kGains);
  EXPECT_EQ(ask_panda("modes", {"--task-stiffness", "400,400,400,20,20,20", "--damping-factor",
                                "1.4", "--threads", "1"})
                .out,
            audit.out);
  EXPECT_EQ(audit.status, 0);
  EXPECT_EQ(
      ask_panda("design", {"--stiffness", "400,400,400,20,20,20", "--damping-ratio", "0.7"}).out,
      ask_panda("design", kSprings).out);
}

TEST(MistypedWords, AreNamedWithWhatMayBeMeant) {
  expect_refusal(ask_panda("audit", kGains, {"--q", "0,-45 degrees,0,-2,0,2,0"}),
                 "unknown unit 'degrees'; write deg");
  const Scratch scratch;
  expect_refusal(run_program({"analyze", scratch.write("tab.yaml", "mass:\n\t- 1\n")}),
                 "a tab indents the line; YAML takes spaces (line 2)");
  expect_refusal(ask_panda("audit", {"--stiffness", "1,1,1,1,1,1", "--damping", "1,1,-1,1,1,1"}),
                 "--damping: a number is negative");
}

TEST(LogOfOthers, IsNamedAsOne) {
  const Scratch scratch;
  const std::string event(
      "\xed\xa1\xda\x01\0\0\0\0\0\0\0\0\0\0\0\0\0\0\0\0\0\0\0\4\0\0\0\4POSEabcd", 36);
  const std::string log = scratch.write("other.log", event);
  expect_refusal(run_program({"monitor", "--log", log}),
                 "has no messages of Dashpot; its channels are POSE");
  expect_refusal(run_program({"export", log, "--csv", scratch.path("modes.csv")}),
                 "has no messages of Dashpot; its channels are POSE");
}

TEST(Friction, OfTheDescriptionIsNamedWhereItIsLeftOut) {
  EXPECT_THAT(ask_panda("audit", kGains).out,
              HasSubstr("Viscous friction in the joints, 0.003 N m s/rad, as the URDF has it, is "
                        "left out; --viscous-friction urdf counts it."));
  EXPECT_THAT(
      ask_panda("audit", kGains, {"--viscous-friction", "urdf"}).out,
      HasSubstr("Viscous friction in the joints, 0.003 N m s/rad, damps beside the gains."));
  EXPECT_EQ(ask_panda("audit", kGains, {"--viscous-friction", "0"}).out.find("iscous"),
            std::string::npos);
}

}  // namespace
}  // namespace dashpot::tests
