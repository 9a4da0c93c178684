// Messages about an arm with unknown rotors, public drives, and bodies at the tip.
#include <dashpot/controller/audit.hpp>
#include <dashpot/tests/apps/json_result.hpp>
#include <dashpot/tests/support/arms.hpp>

namespace dashpot::tests {
namespace {

using ::testing::AllOf;
using ::testing::HasSubstr;
using ::testing::Not;

const Words kCrisp = {"--q",      "0,-45 deg,0,-135 deg,0,90 deg,45 deg",
                      "--preset", "crisp",
                      "--period", "1 ms",
                      "--delay",  "1"};

TEST(RotorsOfAudit, AreSaidToBeUnknownWithWhatWouldBeEnough) {
  const std::string text = run_program(of_panda("audit", kCrisp)).out;
  EXPECT_THAT(text,
              AllOf(HasSubstr("Rotors unknown: the model has no reflected inertia of any joint"),
                    HasSubstr("Enough for a margin of 2.00 would be panda_joint"),
                    HasSubstr("--drives panda"), HasSubstr("too little for an arm without rotors"),
                    Not(HasSubstr("unstable"))));
  const Json found = parse(run_program(of_panda("audit", joined(kCrisp, {"--json"}))))["posture"];
  EXPECT_EQ(found["rotors"], "unknown");
  EXPECT_EQ(found["published_drives"], "panda");
  EXPECT_EQ(found["joints_without_rotors"].size(), 7U);
  const Numbers enough = found["reflected_inertia_for_margin"];
  std::string list;
  for (const double inertia : enough)
    list += (list.empty() ? "" : ",") + std::to_string(inertia + 1e-6);
  const Json with = parse(
      run_program(of_panda("audit", joined(kCrisp, {"--json", "--reflected-inertia", list}))));
  EXPECT_GE(with["posture"]["gain_margin"].get<double>(), 2);
  const Json drives = parse(
      run_program(of_panda("audit", joined(kCrisp, {"--json", "--drives", "panda"}))))["posture"];
  EXPECT_EQ(drives["rotors"], "known");
  EXPECT_GT(drives["gain_margin"].get<double>(), 2);
  EXPECT_FALSE(drives.contains("reflected_inertia_for_margin"));
  EXPECT_EQ(found["with_rotors"]["gain_margin"], drives["gain_margin"]);
  EXPECT_EQ(found["with_rotors"]["smallest_ratio"], drives["smallest_ratio"]);
  const Json more =
      parse(run_program(of_panda("audit", joined(kCrisp, {"--json", "--margin", "4"}))))["posture"];
  EXPECT_GT(more["reflected_inertia_for_margin"][6].get<double>(), enough[6]);
}

TEST(RotorsOfInspect, HaveSourceAndDoubt) {
  EXPECT_THAT(run_program(of_panda("inspect", {})).out, HasSubstr("Rotors unknown"));
  const std::string text = run_program(of_panda("inspect", {"--drives", "panda"})).out;
  EXPECT_THAT(text, AllOf(HasSubstr("Source: MuJoCo Menagerie"), HasSubstr("Doubt: "),
                          Not(HasSubstr("Rotors unknown"))));
  const Json found = parse(run_program(of_panda("inspect", {"--drives", "panda", "--json"})));
  EXPECT_EQ(found["rotors"], "known");
  EXPECT_EQ(found["joints"][0]["reflected_inertia"], 0.1);
  EXPECT_THAT(run_program(of_panda("audit", joined(kCrisp, {"--drives", "fr3"}))).out,
              AllOf(HasSubstr("Drives fr3, public figures: "), HasSubstr("looks like panda.")));
  for (const char* command : {"inspect", "audit"}) {
    expect_refusal(run_program(of_panda(command, {"--drives", ""})), "--drives: is empty");
  }
  expect_refusal(run_program(of_panda("inspect", {"--drives", "pandas"})),
                 "--drives: 'pandas' is not one of panda, fr3");
  expect_refusal(run_program(of_panda("audit", joined(kCrisp, {"--drives", "ur5e"}))),
                 "--drives: ur5e has 6 joints, the arm has 7");
}

TEST(RotorsOfDesign, AreNamedWhereTheLoopBearsLess) {
  const Words options = {"--q",
                         "0,-0.785,0,-2.356,0,1.571,0.785",
                         "--task-stiffness",
                         "500,500,500,30,30,30",
                         "--damping-ratio",
                         "1",
                         "--period",
                         "2.5 ms",
                         "--delay",
                         "2"};
  const Json plain = parse(run_program(of_panda("design", joined(options, {"--json"}))));
  EXPECT_EQ(plain["rotors"], "unknown");
  ASSERT_EQ(plain["notes"].size(), 2U);
  EXPECT_THAT(plain["notes"][1].get<std::string>(), HasSubstr("friction"));
  EXPECT_THAT(
      plain["notes"][0].get<std::string>(),
      AllOf(HasSubstr("no reflected inertia of any joint"),
            HasSubstr("With the published drives panda the loop allows"),
            HasSubstr("the loop would allow a ratio of 1.00"), HasSubstr("--drives panda")));
  const Json known =
      parse(run_program(of_panda("design", joined(options, {"--json", "--drives", "panda"}))));
  EXPECT_EQ(known["rotors"], "known");
  EXPECT_EQ(known["notes"].size(), 2U);
  EXPECT_THAT(known["notes"][0].get<std::string>(),
              HasSubstr("Drives panda, public figures: round numbers"));
  EXPECT_EQ(known["drives"]["name"], "panda");
  EXPECT_EQ(known["loop"]["level"], 1);
}

TEST(PayloadOfTheCommandLine, HasCenterAndInertia) {
  controller::ModelOptions model;
  model.viscous_friction = controller::JointVector::Zero(7);
  model.payload.mass = 0.73;
  model.payload.center = {-0.01, 0.02, 0.03};
  model.payload.inertia << 0.01, 0.001, 0.002, 0.001, 0.02, -0.003, 0.002, -0.003, 0.015;
  controller::AuditOptions options;
  options.gains.task_stiffness = controller::Vector6{{200, 200, 200, 20, 20, 20}}.asDiagonal();
  options.gains.task_damping = controller::Vector6{{30, 30, 30, 5, 5, 5}}.asDiagonal();
  const controller::JointVector q{{0, -0.785, 0, -2.356, 0, 1.571, 0.785}};
  const double pole = controller::Audit(testing::arm_model(testing::arms()[0], model), options)
                          .audit(q)
                          .numbers.fastest_pole;
  const auto audited = [&](const std::string& payload) {
    return run_program(of_panda(
        "audit", {"--q", "0,-0.785,0,-2.356,0,1.571,0.785", "--stiffness", "200,200,200,20,20,20",
                  "--damping", "30,30,30,5,5,5", "--payload", payload, "--json"}));
  };
  const Json found = parse(audited("0.73,-1 cm,0.02,0.03,0.01,0.02,0.015,0.001,0.002,-0.003"));
  EXPECT_NEAR(found["posture"]["fastest_pole"].get<double>(), pole, 1e-9 * std::abs(pole));
  const Json round = parse(audited("0.73,-0.01,0.02,0.03,0.01,0.02,0.015"));
  EXPECT_GT(std::abs(round["posture"]["fastest_pole"].get<double>() - pole), 1e-6);
  expect_refusal(audited("1,2"), "--payload: 2 numbers, expected 1 (mass), 4 (and center), 7");
  expect_refusal(audited("0,0,0,0,1,1,1"), "--payload: center or inertia of a body without mass");
  expect_refusal(audited("1,0,0,0,1,0.1,0.1"), "--payload: ");
}

// Output of the program for an arm with elastic gears.

const Words kBending = {"--drives", "fr3", "--gear-stiffness", "1e4", "--gear-damping", "1"};

TEST(GearsOfAudit, AddAModeForEachJoint) {
  const Words gains = {
      "--stiffness", "400,400,400,20,20,20", "--damping-factor", "1.4", "--period", "1 ms",
      "--json"};
  const auto found = [&](const Words& more) {
    return parse(run_program(of_panda("audit", joined(gains, more))))["posture"];
  };
  const Json rigid = found({"--drives", "fr3"}), motor = found(kBending);
  const Json link = found(joined(kBending, {"--position-sensor", "link"}));
  EXPECT_EQ(rigid["modes"].size(), 6U);
  ASSERT_EQ(motor["modes"].size(), 13U);
  for (std::size_t i = 3; i < 6; ++i) {  // the others are overdamped
    const double frequency = motor["modes"][i + 7]["natural_frequency"];
    EXPECT_NEAR(frequency, rigid["modes"][i]["natural_frequency"].get<double>(), 0.02 * frequency);
  }
  EXPECT_GT(motor["gain_margin"].get<double>(), 2);
  EXPECT_LT(link["gain_margin"].get<double>(), 1);
}

TEST(GearsOfDesign, LowerTheRatioToWhatTheLoopBears) {
  const Words task = {"--task-stiffness",
                      "400,400,400,20,20,20",
                      "--damping-ratio",
                      "0.7",
                      "--q",
                      "0,-45 deg,0,-135 deg,0,90 deg,45 deg",
                      "--period",
                      "1 ms",
                      "--json"};
  const Json motor = parse(run_program(of_panda("design", joined(task, kBending))));
  EXPECT_EQ(motor["loop"]["level"], 1);
  EXPECT_EQ(motor["after"]["modes"].size(), 13U);
  EXPECT_EQ(motor["loop"]["modes"].size(), 13U);
  const Json link = parse(run_program(
      of_panda("design", joined(task, joined(kBending, {"--position-sensor", "link"})))));
  EXPECT_LT(link["loop"]["level"].get<double>(), 1);
  EXPECT_GE(link["loop"]["gain_margin"].get<double>(), 2 - 1e-6);
}

TEST(GearsOfTheProgram, AreRefusedWhereTheyAreWrong) {
  expect_refusals(
      of_panda("inspect", {}),
      {{{"--gear-stiffness", "1e4"}, "needs the reflected inertia (kg m^2)"},
       {{"--gear-damping", "1"}, "--gear-damping: needs --gear-stiffness, N m/rad"},
       {{"--position-sensor", "link"}, "--position-sensor: needs --gear-stiffness, N m/rad"},
       {{"--drives", "fr3", "--gear-stiffness", "1,2"},
        "--gear-stiffness: 2 numbers, expected 1 or 7"},
       {{"--drives", "fr3", "--gear-stiffness", "0"},
        "gear stiffness is not a positive number, N m/rad"},
       {{"--position-sensor", "both"}, "--position-sensor"}});
  const Json found =
      parse(run_program(of_panda("inspect", {"--drives", "fr3", "--gear-stiffness",
                                             "1e4,1e4,1e4,none,5e3,5e3,5e3", "--json"})));
  EXPECT_EQ(found["joints"][0]["gear_stiffness"], 1e4);
  EXPECT_FALSE(found["joints"][3].contains("gear_stiffness"));
}

}  // namespace
}  // namespace dashpot::tests
