// `dashpot audit`: what a user sees, and what is refused.
#include <dashpot/tests/apps/json_result.hpp>
#include <dashpot/tests/support/arms.hpp>
#include <dashpot/tests/support/places.hpp>
#include <dashpot/tests/support/sanitized.hpp>

#include <cmath>
#include <cstdlib>
#include <filesystem>

namespace dashpot::tests {
namespace {

using ::testing::HasSubstr;

const std::string kAuditHome = "0,-45 deg,0,-135 deg,0,90 deg,45 deg";

Json audit_json(const Words& options) {
  return parse(run_program(of_panda("audit", joined(options, {"--q", kAuditHome, "--json"}))));
}

/// Ratios of the oscillating modes at the home posture of the Panda with the defaults of public
/// controllers, to two digits, and the fastest pole, computed by a general eigensolver in Python.
struct Published {
  const char* preset;
  Numbers ratios;
  double fastest;  // 1/s; 0: not known
};

TEST(Audit, ReproducesWhatIsKnownOfPublicControllers) {
  const std::vector<Published> all = {{"libfranka", {0.39, 0.45, 0.51}, -956},
                                      {"cartesian_impedance_controller", {0.34, 0.45, 0.50}, -1351},
                                      {"panda_py", {0.41, 0.45, 0.53}, -1689},
                                      {"crisp", {0.37, 0.45, 0.52}, -1702},
                                      {"franky", {0.37, 0.45, 0.51}, -2853},
                                      {"deoxys", {0.25, 0.42, 1.0}, 0}};
  for (const Published& one : all) {
    const Json found = audit_json({"--preset", one.preset});
    EXPECT_EQ(found["intended_ratio"], 1);
    Numbers ratios = of_modes(found["posture"], "damping_ratio");
    std::sort(ratios.begin(), ratios.end());
    for (std::size_t i = 0; i < 3; ++i) {
      EXPECT_NEAR(ratios[i], one.ratios[i], 0.0051) << one.preset;
    }
    EXPECT_NEAR(found["posture"]["smallest_ratio"].get<double>(), ratios[0], 1e-12);
    if (one.fastest != 0) {
      EXPECT_NEAR(found["posture"]["fastest_pole"].get<double>(), one.fastest, 0.5) << one.preset;
    }
  }
}

/// Polymetis has springs and dampers in the joints as well: K = J' K_C J + K_J.
TEST(Audit, HasTheSpringsOfTipAndJointsOfPolymetis) {
  const Json found = audit_json({"--preset", "polymetis"});
  EXPECT_TRUE(found["intended_ratio"].is_null());
  const Words joints = {"--null-stiffness", "40,30,50,25,35,25,10", "--null-damping",
                        "4,6,5,5,3,2,1",    "--null-projector",     "none"};
  const Words tip = {"--stiffness", "750,750,750,15,15,15", "--damping", "37,37,37,2,2,2"};
  const Json stated = audit_json(joined(tip, joints));
  EXPECT_EQ(found["posture"]["modes"], stated["posture"]["modes"]);
  EXPECT_EQ(found["posture"]["modes"].size(), 7U);
  EXPECT_THAT(run_program({"audit", "--preset", "polymetis", "--urdf", testing::arm_path("ur5"),
                           "--base", "base_link", "--tip", "ee_link"})
                  .err,
              HasSubstr("polymetis has gains for seven joints, the arm has 6"));
}

/// The margin counts how late gravity is compensated, and modes do not.
TEST(Audit, TakesTheGravityOfAnyMount) {
  const auto posture = [](const Words& more) {
    return audit_json(joined({"--preset", "libfranka", "--period", "1ms"}, more))["posture"];
  };
  const Json upright = posture({}), wall = posture({"--gravity", "9.81,0,0"});
  EXPECT_EQ(posture({"--gravity", "0,0,-9.81"}), upright);
  EXPECT_EQ(wall["modes"], upright["modes"]);
  EXPECT_NE(wall["gain_margin"], upright["gain_margin"]);
}

/// Its slowest mode, 2.386 rad/s with a ratio of 0.25, is unstable with an integral below 0.84 s.
TEST(Audit, CountsAnIntegralAndTellsHowItsSlowModesDecay) {
  const std::vector<std::string> options = {"--preset", "deoxys",    "--period",
                                            "1ms",      "--samples", "20"};
  const auto with = [&](const Words& more) { return audit_json(joined(options, more)); };
  const Json plain = with({}), slow = with({"--integral-time", "3 s"});
  EXPECT_EQ(plain["posture"]["integral_decays"], Json::array());
  const Numbers decays = slow["posture"]["integral_decays"];
  ASSERT_EQ(decays.size(), 6U);
  for (const double decay : decays) EXPECT_NEAR(decay, 1. / 3, 0.05);
  EXPECT_EQ(slow["posture"]["smallest_ratio"], plain["posture"]["smallest_ratio"]);
  EXPECT_GT(slow["posture"]["gain_margin"], 10);
  const Json quick = with({"--integral-time", "0.8 s"});
  EXPECT_LT(quick["posture"]["gain_margin"], 0.01);  // with which motions are too slow to count
  EXPECT_GT(plain["workspace"]["gain_margin"]["worst"], 1);
  EXPECT_LT(quick["workspace"]["gain_margin"]["worst"], 1);
  EXPECT_EQ(with({"--integral-time", "3 s", "--no-margin"})["posture"]["integral_decays"],
            Json::array());
}

TEST(Audit, HasTheModesOfDesign) {
  const Json found = audit_json(
      {"--stiffness", "200,200,200,20,20,20", "--damping", "30,30,30,9,9,9", "--period", "1ms"});
  const Json known = parse(
      run_program(of_panda("design", {"--q", kAuditHome, "--task-stiffness", "200,200,200,20,20,20",
                                      "--task-damping", "30,30,30,9,9,9", "--damping-ratio", "0.7",
                                      "--viscous-friction", "0", "--json"})));
  EXPECT_EQ(found["posture"]["modes"], known["before"]["modes"]);
  expect_near(found["suggestion"]["task_damping"].get<Rows>(), known["task_damping"].get<Rows>(),
              1e-9);
  EXPECT_TRUE(found["intended_ratio"].is_null());
  EXPECT_GT(found["posture"]["gain_margin"].get<double>(), 1);
}

TEST(Audit, DependsNotOnTheNumberOfThreads) {
  std::vector<std::string> options = {"--preset", "crisp",  "--samples", "500",    "--period",
                                      "1 ms",     "--seed", "3",         "--jobs", "1"};
  const Json one = audit_json(options);
  options.back() = "2";
  const Json two = audit_json(options);
  EXPECT_EQ(one, two);
  EXPECT_EQ(one["workspace"]["samples"], 500);
  EXPECT_FALSE(one["workspace"]["interrupted"].get<bool>());
  const Json& ratio = one["workspace"]["smallest_ratio"];
  EXPECT_LE(ratio["worst"].get<double>(), ratio["p05"].get<double>());
  EXPECT_LT(ratio["p05"].get<double>(), ratio["median"].get<double>());
  EXPECT_LT(ratio["median"].get<double>(), ratio["p95"].get<double>());
  options[5] = "2 ms";
  EXPECT_NE(audit_json(options)["workspace"], two["workspace"]);
}

TEST(Audit, WritesALineForEachListedPosture) {
  const Scratch scratch;
  const std::string list =
      scratch.write("list.yaml", "- [0, -0.7, 0, -2.3, 0, 1.5, 0.7]\n- [0, 0, 0, -2, 0, 2, 0]\n");
  const std::string csv = scratch.path("out.csv");
  const Json found = audit_json({"--preset", "franky", "--postures", list, "--csv", csv});
  EXPECT_EQ(found["workspace"]["samples"], 2);
  const std::string text = scratch.read("out.csv");
  EXPECT_EQ(count_lines(text), 3);
  EXPECT_THAT(text, HasSubstr("posture,q1 [rad],q2 [rad],q3 [rad],q4 [rad],q5 [rad],q6 [rad],"
                              "q7 [rad],smallest_ratio,fastest_pole [1/s],"));
  EXPECT_THAT(text, HasSubstr("\n1,0,0,0,-2,0,2,0,0."));
}

TEST(Audit, TakesThePosturesOfALog) {
  const Scratch scratch;
  const std::string log = scratch.path("run.lcm"), csv = scratch.path("out.csv");
  const Outcome run =
      run_program({"run", std::string(DASHPOT_SOURCE_DIR) + "/sim/scenes/panda_release_c2.yaml",
                   "--fast", "--duration", "0.3", "--log", log});
  ASSERT_EQ(run.status, 0) << run.err;
  const auto samples = [&](const std::string& step) {
    const Json found =
        audit_json({"--preset", "crisp", "--log", log, "--log-step", step, "--csv", csv});
    return found["workspace"]["samples"].get<int>();
  };
  EXPECT_EQ(samples("1"), 1);  // the first one alone
  const int many = samples("0.001");
  EXPECT_GT(many, 4);
  EXPECT_LT(samples("0.004"), many);
  EXPECT_THAT(scratch.read("out.csv"), HasSubstr("\n0,"));
  EXPECT_THAT(run_program({"audit", "--urdf", testing::arm_path("ur5"), "--base", "base_link",
                           "--tip", "ee_link", "--preset", "crisp", "--log", log})
                  .err,
              HasSubstr("its states have 7 joints, expected 6"));
}

TEST(Audit, TakesGainsFromAConfigurationAndHalvesThoseOfAHalfQuaternion) {
  const Scratch scratch;
  const std::string gains = scratch.write("gains.yaml",
                                          "gains: {task: {stiffness: [200, 200, 200, 20, 20, 20], "
                                          "damping: [30, 30, 30, 9, 9, 9]}}\n");
  const Json given = audit_json({"--gains", gains});
  const Json stated =
      audit_json({"--stiffness", "200,200,200,20,20,20", "--damping", "30,30,30,9,9,9"});
  EXPECT_EQ(given, stated);
  const Json half = audit_json({"--gains", gains, "--rotation", "half-quaternion"});
  const Json halved =
      audit_json({"--stiffness", "200,200,200,10,10,10", "--damping", "30,30,30,9,9,9"});
  EXPECT_NEAR(half["posture"]["smallest_ratio"].get<double>(),
              halved["posture"]["smallest_ratio"].get<double>(), 1e-12);
}

TEST(Audit, TakesGainsOfTheJoints) {
  const Json found = audit_json({"--joint-stiffness", "600", "--damping-factor", "2"});
  ASSERT_EQ(found["posture"]["modes"].size(), 7U);
  for (const Json& mode : found["posture"]["modes"]) {  // K = k I and C = c I: ratio = omega c / 2k
    EXPECT_NEAR(mode["damping_ratio"].get<double>(),
                mode["natural_frequency"].get<double>() / std::sqrt(600), 1e-9);
  }
  EXPECT_EQ(found["suggestion"]["diagonal"].size(), 7U);
}

TEST(Audit, DrawsTheRatios) {
  if (std::system("command -v gnuplot >/dev/null") != 0) GTEST_SKIP() << "there is no gnuplot";
  const Scratch scratch;
  const std::string file = scratch.path("it's.svg");
  audit_json({"--preset", "crisp", "--samples", "200", "--period", "1ms", "--plot", file});
  const std::string drawn = scratch.read("it's.svg");
  EXPECT_THAT(drawn, HasSubstr("<svg"));
  EXPECT_THAT(drawn, HasSubstr("meant: 1.00"));
  EXPECT_THAT(drawn, HasSubstr("gain margin"));
  EXPECT_THAT(drawn, HasSubstr("panda, K_C = diag(500, 500, 500, 30.0, 30.0, 30.0)"));
  EXPECT_THAT(drawn, HasSubstr("C_C = diag("));
}

TEST(Audit, PrintsTables) {
  const Outcome outcome = run_program(
      of_panda("audit", {"--q", kAuditHome, "--preset", "libfranka", "--samples", "100"}));
  EXPECT_EQ(outcome.status, 0);
  for (const char* words :
       {"Smallest ratio 0.394072 where 1.00 was meant; fastest pole -955.854 1/s",
        "Over 100 postures", "Nearest diagonal", "Zero modes: 1."}) {
    EXPECT_THAT(outcome.out, HasSubstr(words));
  }
  EXPECT_THAT(outcome.err, ::testing::IsEmpty());
}

TEST(Audit, RefusesInOneLineThatNamesTheOption) {
  const Scratch scratch;
  const std::string short_list = scratch.write("list.yaml", "- [0, 0]\n");
  expect_refusals(
      of_panda("audit", {}),
      {
          {{}, "--stiffness: give one of"},
          {{"--preset", "unknown"}, "--preset: unknown not in"},
          {{"--preset", "crisp", "--stiffness", "1,1,1,1,1,1"}, "--stiffness: give one of"},
          {{"--stiffness", "1,1,1", "--damping-factor", "2"}, "--stiffness: 3 numbers, expected 6"},
          {{"--stiffness", "1,1,1,1,1,-1", "--damping", "1,1,1,1,1,1"},
           "--stiffness: a number is negative"},
          {{"--preset", "crisp", "--delay", "1"}, "--period: missing"},
          {{"--preset", "crisp", "--integral-time", "1"}, "--period: missing"},
          {{"--preset", "crisp", "--q", "1,2"}, "--q: 2 numbers, expected 7"},
          {{"--preset", "crisp", "--postures", short_list}, "[0].posture: 2 numbers, expected 7"},
          {{"--preset", "crisp", "--spread", "1"}, "--spread: needs --samples"},
          {{"--preset", "crisp", "--csv", scratch.path("x.csv")},
           "--csv: needs --samples, --postures or --log"},
          {{"--preset", "crisp", "--samples", "2", "--plot", "x.pdf"}, "--plot: x.pdf: has to end"},
          {{"--preset", "crisp", "--samples", "0"}, "--samples"},
          {{"--gains", scratch.path("none.yaml")}, "none.yaml"},
      });
  EXPECT_FALSE(std::filesystem::exists(scratch.path("x.csv")));
}

TEST(AuditTable, IsPrintedForEachPreset) {
  DASHPOT_SKIP_IF_QUICK();
  const Scratch scratch;
  const std::string line = "cd " + DASHPOT_SOURCE_DIR " && python3 apps/plots/audit.py " +
                           DASHPOT_PROGRAM + " 20 >" + scratch.path("out") + " 2>&1";
  ASSERT_EQ(std::system(line.c_str()), 0) << scratch.read("out");
  const std::string text = scratch.read("out");
  EXPECT_EQ(count_lines(text), 2 * 13 + 10 + 1 + 13);
  EXPECT_THAT(text, HasSubstr("| `libfranka` | 1 | 0.394, 0.455, 0.512 |"));
  EXPECT_THAT(text, HasSubstr("| `fr3` | 0.195, 0.195, 0.195, 0.195, 0.074, 0.074, 0.074 |"));
}

}  // namespace
}  // namespace dashpot::tests
