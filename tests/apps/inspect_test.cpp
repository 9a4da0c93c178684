// Output of `dashpot inspect`, and its errors for bad input.
#include <dashpot/controller/posture.hpp>
#include <dashpot/controller/robot_model.hpp>
#include <dashpot/tests/apps/json_result.hpp>
#include <dashpot/tests/support/arms.hpp>
#include <dashpot/tests/support/kdl_dynamics.hpp>

#include <gmock/gmock.h>

#include <Eigen/LU>
#include <array>
#include <cmath>
#include <cstdio>
#include <string>
#include <vector>

namespace dashpot::tests {
namespace {

using ::testing::HasSubstr;
using ::testing::IsEmpty;
using ::testing::StartsWith;

Outcome inspect(const dashpot::testing::Arm& arm, const Words& more) {
  return run_program(joined({"inspect", "--urdf", dashpot::testing::arm_path(arm.file), "--base",
                             arm.base, "--tip", arm.tip},
                            more));
}

Outcome inspect_panda(const Words& more) {
  return inspect(dashpot::testing::arms()[0], more);
}

constexpr const char* kUnitInertia = "ixx='1' iyy='1' izz='1'";

/// Inspects one joint about z, `pivot`, of this kind, that moves a link of this inertia.
Outcome inspect_text(const Scratch& scratch, const std::string& kind, const std::string& inertia,
                     const Words& more = {}) {
  const std::string urdf = scratch.write(
      "arm.urdf",
      "<robot name='r'><link name='wall'/><link name='arm'><inertial><mass value='1'/>"
      "<inertia " +
          inertia +
          " ixy='0' ixz='0' iyz='0'/></inertial></link>"
          "<joint name='pivot' " +
          kind +
          "><parent link='wall'/><child link='arm'/>"
          "<axis xyz='0 0 1'/></joint></robot>");
  return run_program(
      joined({"inspect", "--json", "--urdf", urdf, "--base", "wall", "--tip", "arm"}, more));
}

Rows rows_of(const Eigen::MatrixXd& matrix) {
  Rows rows;
  for (Eigen::Index i = 0; i < matrix.rows(); ++i) {
    rows.emplace_back();
    for (Eigen::Index j = 0; j < matrix.cols(); ++j) rows.back().push_back(matrix(i, j));
  }
  return rows;
}

/// Compares the object with KDL's numbers.
void expect_matches(const Json& result, const controller::DynamicsResult& expected) {
  const auto vector = [](const Eigen::MatrixXd& v) { return rows_of(v.transpose()); };
  EXPECT_EQ(result.size(), 11u);
  expect_near(result["mass_matrix"], rows_of(expected.M), 1e-12);
  expect_near({result["coriolis"]}, vector(expected.coriolis), 1e-12);
  expect_near({result["gravity"]}, vector(expected.gravity), 1e-12);
  expect_near(result["jacobian"], rows_of(expected.J), 1e-12);
  expect_near({result["jacobian_dot_qd"]}, vector(expected.Jdot_qd), 1e-12);
  expect_near({result["tip_position"]}, vector(expected.p_BT_B), 1e-12);
  expect_near(result["tip_rotation"], rows_of(expected.R_BT), 1e-12);
}

TEST(Inspect, PrintsWhatKdlComputesForEachArm) {
  for (const auto& arm : dashpot::testing::all_arms()) {
    SCOPED_TRACE(arm.file);
    const controller::RobotModel model = dashpot::testing::arm_model(arm);
    const bool six = model.dof() == 6;
    const std::string qd = six ? "1,0,-1,0.5,1,-1" : "1,0,-1,0.5,1,-1,1e-1";
    controller::JointVector position = controller::default_posture(model), velocity(model.dof());
    std::string q;
    for (int i = 0; i < model.dof(); ++i) {
      position[i] += (i % 2 == 0 ? 0.1 : -0.1) * (i + 1);
      q += printed("%s%.17g", i > 0 ? "," : "", position[i]);
    }
    velocity.head(6) << 1, 0, -1, 0.5, 1, -1;
    if (!six) velocity[6] = 0.1;
    expect_matches(parse(inspect(arm, {"--q", q, "--qd", qd, "--json"})),
                   dashpot::testing::by_kdl(model, position, velocity));
  }
}

TEST(Inspect, TakesTheMiddleOfTheLimitsAndEarthsGravityUnlessToldOtherwise) {
  const Json plain = parse(inspect_panda({"--json"}));
  const Json told = parse(inspect_panda({"--json", "--q", "0,0,0,-1.5708,0,1.8675,0", "--qd",
                                         "0,0,0,0,0,0,0", "--gravity", "0,0,-9.81"}));
  EXPECT_EQ(plain, told);
  EXPECT_EQ(plain["coriolis"], Json(Numbers(7, 0.0)));
  EXPECT_NEAR(plain["stop"]["time"][6].get<double>(), 0.05 * std::log(10), 0.002);  // no limit acts
  const Json upside_down = parse(inspect_panda({"--json", "--gravity", "0,0,9.81"}));
  for (std::size_t i = 0; i < 7; ++i) {
    EXPECT_EQ(upside_down["gravity"][i].get<double>(), -plain["gravity"][i].get<double>());
  }
}

TEST(Inspect, PrintsTheProjectorOfTheNullSpaceThatIsNamed) {
  using Eigen::MatrixXd;
  const auto matrix = [](const Json& rows) {
    MatrixXd A(rows.size(), rows[0].size());
    for (Eigen::Index i = 0; i < A.size(); ++i) {
      A(i / A.cols(), i % A.cols()) =
          rows[static_cast<std::size_t>(i / A.cols())][static_cast<std::size_t>(i % A.cols())];
    }
    return A;
  };
  for (const std::string name : {"dynamic", "kinematic", "weighted", "none"}) {
    SCOPED_TRACE(name);
    Words words = {"--json", "--q", "0.1,-0.8,0.2,-2.1,0.3,1.6,0.4", "--null-projector", name};
    if (name == "weighted") words = joined(words, {"--null-weights", "1,2,3,4,5,6,7"});
    const Json found = parse(inspect_panda(words));
    const MatrixXd N = matrix(found["null_projector"]), J = matrix(found["jacobian"]);
    MatrixXd W = MatrixXd::Identity(7, 7);
    if (name == "dynamic") W = matrix(found["mass_matrix"]);
    if (name == "weighted") W.diagonal() = Eigen::VectorXd::LinSpaced(7, 1, 7);
    const MatrixXd V = W.inverse() * J.transpose();
    const MatrixXd wanted = MatrixXd::Identity(7, 7) - V * (J * V).inverse() * J;
    EXPECT_LT((N - (name == "none" ? MatrixXd::Identity(7, 7) : wanted)).norm(), 1e-9);
    words.front() = "--outside-limits";
    EXPECT_THAT(inspect_panda(words).out, HasSubstr("Null-space projector\n"));
  }
  EXPECT_THAT(inspect_panda({"--null-weights", "1"}).err,
              HasSubstr("goes with --null-projector weighted"));
  EXPECT_FALSE(parse(inspect_panda({"--json"})).contains("null_projector"));
}

TEST(Inspect, ListsTheJointsWithTheirLimits) {
  const Json panda = parse(inspect_panda({"--json"}))["joints"];
  ASSERT_EQ(panda.size(), 7u);
  EXPECT_EQ(panda[3], Json({{"name", "panda_joint4"},
                            {"type", "revolute"},
                            {"lower", -3.0718},
                            {"upper", -0.0698},
                            {"velocity", 2.175},
                            {"effort", 87},
                            {"reflected_inertia", 0.0}}));
  const Json lift = parse(inspect({"lift_gripper", "base", "fingertip"}, {"--json"}))["joints"];
  EXPECT_EQ(lift[0]["type"], "prismatic");
  EXPECT_EQ(lift[0]["upper"], 0.8);
  const Scratch scratch;
  const Json free = parse(inspect_text(scratch, "type='continuous'", kUnitInertia))["joints"];
  EXPECT_EQ(free, Json({{{"name", "pivot"},
                         {"type", "continuous"},
                         {"lower", nullptr},
                         {"upper", nullptr},
                         {"velocity", nullptr},
                         {"effort", nullptr},
                         {"reflected_inertia", 0.0}}}));
}

TEST(Inspect, RefusesDegreesWithoutTheirUnit) {
  expect_refusal(
      inspect_panda({"--q", "0,-45,0,-135,0,90,45"}),
      "--q: joint 'panda_joint2' at -45 rad is outside its limits -1.7628 to 1.7628 rad; "
      "if these are degrees, give each number its unit: 'deg'; --outside-limits takes");
  expect_refusal(inspect_panda({"--q", "0,-45,0,-135,0,90,45 deg"}),
                 "--q: '-45' has no unit beside '45 deg'");
  EXPECT_EQ(inspect_panda({"--q", "0,-45,0,-135,0,90,45", "--outside-limits"}).status, 0);
  // The results are valid outside the limits as well: a warning is enough.
  const Outcome outside = inspect_panda({"--q", "0,0,0,0,0,0,0"});
  EXPECT_EQ(outside.status, 0);
  EXPECT_EQ(outside.err,
            "warning: --q: joint 'panda_joint4' at 0 rad is outside its limits -3.0718 to -0.0698 "
            "rad\n");
}

TEST(Inspect, TakesUnits) {
  EXPECT_EQ(
      parse(inspect_panda(
          {"--json", "--q", "90 deg,0,-150deg,-1 rad,0,1 rad,0", "--qd", "6 rpm,0,0,0,0,0,0"})),
      parse(inspect_panda({"--json", "--q", "1.5707963267948966,0,-2.6179938779914944,-1,0,1,0",
                           "--qd", "0.6283185307179586,0,0,0,0,0,0"})));
  const dashpot::testing::Arm lift = {"lift_gripper", "base", "fingertip"};
  EXPECT_EQ(parse(inspect(lift, {"--json", "--q", "25 cm,90 deg,0,0,1 cm"})),
            parse(inspect(lift, {"--json", "--q", "0.25,1.5707963267948966,0,0,0.01"})));
  EXPECT_EQ(parse(inspect_panda({"--json", "--reflected-inertia", "500 g m^2"})),
            parse(inspect_panda({"--json", "--reflected-inertia", "0.5"})));
}

TEST(Inspect, GoesOnPastAnInertiaThatNoBodyHasIfToldTo) {
  const Scratch scratch;
  const std::string broken = "ixx='1' iyy='1' izz='3'";
  const Outcome refused = inspect_text(scratch, "type='continuous'", broken);
  EXPECT_EQ(refused.status, 2);
  EXPECT_THAT(refused.err, HasSubstr("--accept-inertias, takes it as it is"));
  const Json taken =
      parse(inspect_text(scratch, "type='continuous'", broken, {"--accept-inertias"}));
  EXPECT_EQ(taken["mass_matrix"], Json({{3.0}}));
  EXPECT_EQ(parse(inspect_text(scratch, "type='continuous'", broken, {"--accept-inertias=arm"})),
            taken);
  const Outcome other =
      inspect_text(scratch, "type='continuous'", broken, {"--accept-inertias=wall"});
  EXPECT_THAT(other.err,
              HasSubstr("link 'arm': its inertia breaks the triangle inequality by 50 %"));
  const Outcome nobody =
      inspect_text(scratch, "type='continuous'", broken, {"--accept-inertias=arm,hand"});
  EXPECT_THAT(nobody.err, HasSubstr("link 'hand': there is none whose inertia to accept"));
}

TEST(Inspect, WarnsOfWhatIsDoubtful) {
  const Scratch scratch;
  const Outcome outcome = inspect_text(scratch, "type='continuous'", "ixx='90' iyy='90' izz='90'");
  const std::string doubt =
      "link 'arm': its inertia, 90 kg m^2, with its mass, 1 kg, fits a body larger than the "
      "arm, whose links add up to 0 m: is it in kg m^2?";
  EXPECT_EQ(outcome.status, 0);
  EXPECT_EQ(outcome.err, "warning: " + doubt + "\n");
  EXPECT_EQ(Json::parse(outcome.out)["warnings"], Json({doubt}));
}

TEST(Inspect, ShowsLimitsOfVersion12WhereTheyAreStated) {
  const Scratch scratch;
  std::string text = dashpot::controller::read_urdf_file(dashpot::testing::arm_path("panda"));
  text.replace(text.find("<robot name=\"panda\">"), 20, "<robot name=\"panda\" version=\"1.2\">");
  text.replace(text.find("effort=\"12\""), 11, "effort=\"12\" acceleration=\"20\" jerk=\"5e3\"");
  const Words words = {"inspect",       "--urdf",      scratch.write("arm.urdf", text),
                       "--base",        "panda_link0", "--tip",
                       "panda_hand_tcp"};
  const Json joints = parse(run_program(joined(words, {"--json"})))["joints"];
  EXPECT_EQ(joints[4]["acceleration"], 20);
  EXPECT_EQ(joints[4]["jerk"], 5000);
  EXPECT_FALSE(joints[4].contains("deceleration"));
  EXPECT_FALSE(joints[3].contains("acceleration"));
  EXPECT_THAT(run_program(words).out, HasSubstr("acceler."));
  EXPECT_THAT(inspect_panda({}).out, ::testing::Not(HasSubstr("acceler.")));
}

TEST(Inspect, AddsReflectedInertia) {
  const Json bare = parse(inspect_panda({"--json"}));
  const Json geared =
      parse(inspect_panda({"--json", "--reflected-inertia", "0.1,0.2,0.3,0.4,0.5,0.6,0.7"}));
  for (std::size_t i = 0; i < 7; ++i) {
    EXPECT_NEAR(geared["mass_matrix"][i][i].get<double>(),
                bare["mass_matrix"][i][i].get<double>() + 0.1 * static_cast<double>(i + 1), 1e-14);
  }
  EXPECT_EQ(parse(inspect_panda({"--json", "--reflected-inertia", "0.5"})),
            parse(inspect_panda({"--json", "--reflected-inertia", "0.5,0.5,0.5,0.5,0.5,0.5,0.5"})));
}

TEST(Inspect, WeighsOrLeavesOutLinksOffTheChain) {
  // The hand hangs off the chain that ends in link 7.
  const dashpot::testing::Arm wrist = {"panda", "panda_link0", "panda_link7"};
  const Json with_hand = parse(inspect(wrist, {"--json"}));
  const Json without = parse(inspect(wrist, {"--json", "--exclude-off-chain"}));
  expect_near(with_hand["mass_matrix"], parse(inspect_panda({"--json"}))["mass_matrix"], 1e-14);
  EXPECT_GT(with_hand["mass_matrix"][0][0].get<double>(),
            without["mass_matrix"][0][0].get<double>());
  EXPECT_EQ(with_hand["jacobian"], without["jacobian"]);
}

TEST(Inspect, ShowsTablesToPeople) {
  const Outcome outcome = inspect_panda({"--q", "0,-0.785,0,-2.356,0,1.571,0.785"});
  EXPECT_EQ(outcome.status, 0) << outcome.err;
  EXPECT_THAT(outcome.err, IsEmpty());
  EXPECT_THAT(outcome.out, StartsWith("panda: 7 joints from panda_link0 to panda_hand_tcp."));
  EXPECT_THAT(outcome.out, HasSubstr("panda_joint4  revolute  -3.07180  -0.06980"));
  EXPECT_THAT(outcome.out, HasSubstr("\nMass matrix\n"));
  EXPECT_THAT(outcome.out, HasSubstr("\nJacobian at the tip\n"));
  EXPECT_THAT(outcome.out, HasSubstr("  x  0.307020"));
}

TEST(Inspect, RefusesNumbersThatDoNotFit) {
  expect_refusals(
      of_panda("inspect", {}),
      {
          {{"--q", "1,2"}, "--q: 2 numbers, expected 7"},
          {{"--qd", "1,2,3,4,5,6,7,8"}, "--qd: 8 numbers, expected 7"},
          {{"--q", "0,0,0,0,0,0,nan"}, "--q: is not finite: 'nan'"},
          {{"--q", "0,0,0,0,0,0,1e999"}, "--q: is not finite: '1e999'"},
          {{"--q", "0,0,0,,0,0,0"}, "--q: is not a number but ''"},
          {{"--q", "0,0,0,0,0,0,1x"}, "--q: is not a number but '1x': unknown unit 'x'"},
          {{"--q", "0,0,0,0,0,0,1 m"}, "--q: has a wrong unit: '1 m'; rad is wanted"},
          {{"--gravity", "9.81"}, "--gravity: 1 number, expected 3"},
          {{"--reflected-inertia", "1,2"}, "--reflected-inertia: 2 numbers, expected 1 or 7"},
          {{"--reflected-inertia", "1,1,1,1,1,1,1,1,1,1,1,1,1,1,1,1,1"},
           "--reflected-inertia: 17 numbers, expected 1 or 7"},
          {{"--reflected-inertia", "-1"}, "--reflected-inertia: a number is negative"},
      });
}

TEST(Inspect, RefusesFilesAndLinksThatDoNotFit) {
  const auto refuses = [](const Outcome& outcome, const std::string& text) {
    expect_refusal(outcome, "dashpot inspect: " + text);
  };
  const auto panda = dashpot::testing::arm_path("panda");
  refuses(inspect({"panda", "panda_link0", "hand"}, {}),
          panda + ": link 'hand': there is none; the nearest of its 11 links are panda_hand, ");
  refuses(inspect({"panda", "base", "panda_link7"}, {}), panda + ": link 'base': there is none");
  refuses(inspect({"panda", "panda_link7", "panda_link0"}, {"--json"}),
          panda + ": link 'panda_link0': not beyond the base, 'panda_link7'");
  const auto missing = dashpot::testing::arm_path("no_such_arm");
  refuses(inspect({"no_such_arm", "a", "b"}, {}), missing + ": cannot be read: No such file");
  const Scratch scratch;
  const std::string broken = scratch.write("broken.urdf", "<robot name='r'><link");
  refuses(run_program({"inspect", "--urdf", broken, "--base", "a", "--tip", "b"}), broken + ": ");
  refuses(run_program({"inspect", "--base", "a", "--tip", "b"}), "--urdf is required");
}

}  // namespace
}  // namespace dashpot::tests
