// dashpot contact as a user runs it, and the warning of an arm that cannot hold itself.
#include <dashpot/tests/apps/scene_run.hpp>

#include <cmath>

namespace dashpot::tests {
namespace {

using ::testing::AllOf;
using ::testing::HasSubstr;
using ::testing::StartsWith;

const Words kHome = {"--q", "0,-45 deg,0,-135 deg,0,90 deg,45 deg"};
const Words kCrisp = joined(kHome, {"--preset", "crisp", "--delay", "1"});

Json contact(const Words& more) {
  return parse(run_program(of_panda("contact", joined(kCrisp, joined(more, {"--json"})))));
}

TEST(ContactOfAnArm, BeginsWithTheVerdict) {
  const Words known = joined(kCrisp, {"--drives", "panda", "--touch", "1e5", "--direction", "z"});
  const std::string text = run_program(of_panda("contact", known)).out;
  EXPECT_THAT(text, AllOf(StartsWith("Stable in contact with springs up to "),
                          HasSubstr(" N/m along (0, 0, 1.0); "),
                          HasSubstr("at the 1.000e+05 N/m asked for: yes; not passive.\n"),
                          HasSubstr("proved to be between"), HasSubstr("panda_joint6")));
  const Words unknown = joined(kHome, {"--preset", "libfranka", "--touch", "1e9"});
  EXPECT_THAT(run_program(of_panda("contact", unknown)).out,
              AllOf(HasSubstr("lowest limit, as an arm without rotors; at the 1.000e+09 N/m asked "
                              "for: no; not passive.\n"),
                    HasSubstr("With the published drives panda it is")));
}

TEST(ContactOfAnArm, IsLeastInTheDirectionThatIsFound) {
  const Json least = contact({"--drives", "panda"})["posture"];
  const double limit = least["limit"];
  EXPECT_LT(least["limit_lower"], limit);
  EXPECT_GT(least["limit_upper"], limit);
  for (const char* direction : {"x", "y", "z", "1,1,1", "-1,0.4,0.2", "-1,5,-1"}) {
    const Json other = contact({"--drives", "panda", "--direction", direction})["posture"];
    EXPECT_LE(limit, 1.0001 * other["limit"].get<double>()) << direction;
  }
  const Numbers n = least["direction"];
  const std::string same = printed("%.17g,%.17g,%.17g", n[0], n[1], n[2]);
  const Json again = contact({"--drives", "panda", "--direction", same})["posture"];
  EXPECT_NEAR(again["limit"], limit, 1e-8 * limit);
  for (const Json& point : least["curve"]) {
    if (point[0] < 0.999 * limit) EXPECT_GT(point[1], 0) << point[0];
  }
}

TEST(ContactOfAnArm, ShowsWhatWouldHelpAndWhatIsTouched) {
  const auto of = [](const std::string& stiffness, const std::string& damping, const Words& more) {
    const Words gains = {"--drives",  "panda",          "--stiffness",  stiffness,
                         "--damping", damping,          "--json",       "--direction",
                         "z",         "--null-damping", "0,0,0,0,0,0,0"};
    return parse(run_program(of_panda("contact", joined(joined(kHome, gains), more))))["posture"];
  };
  const auto expect_same = [](const Json& a, const Json& b) {
    EXPECT_NEAR(a.get<double>(), b.get<double>(), 1e-5 * b.get<double>());
  };
  const std::string K = "600,600,600,30,30,30", C = "40,40,40,4,4,4";
  const Json found = of(K, C, {"--delay", "1"});
  expect_same(found["with_half_stiffness"],
              of("300,300,300,15,15,15", C, {"--delay", "1"})["limit"]);
  expect_same(found["with_more_damping"], of(K, "60,60,60,6,6,6", {"--delay", "1"})["limit"]);
  expect_same(found["with_less_delay"], of(K, C, {})["limit"]);
  const double limit = found["limit"];
  EXPECT_GT(of(K, C, {"--delay", "1", "--damper", "10"})["limit"], 1.01 * limit);
  EXPECT_GT(of(K, C, {"--delay", "1", "--mass", "1"})["limit"], 1.05 * limit);
}

/// Each joint's torque beside the effort of the arm that presses up or down.
TEST(ContactOfAnArm, HoldsWhatTheJointsGive) {
  const Json hold = contact({"--direction", "z"})["posture"]["hold"];
  const Rows jacobian =
      parse(run_program(of_panda("inspect", joined(kHome, {"--json"}))))["jacobian"];
  const Numbers torque = hold["torque"], limit = hold["limit"];
  for (const Json& one : hold["forces"]) {
    const std::size_t joint = one["joint"];
    EXPECT_GT(one["force"], 0);
    for (std::size_t i = 0; i < torque.size(); ++i) {
      double together = torque[i];
      for (std::size_t k = 0; k < 3; ++k) {
        together += jacobian[k][i] * one["direction"][k].get<double>() * one["force"].get<double>();
      }
      EXPECT_LT(std::abs(together), limit[i] + 1e-9);
      if (i == joint) EXPECT_NEAR(std::abs(together), limit[i], 1e-9);
    }
  }
  const double up = hold["forces"][0]["force"], down = hold["forces"][1]["force"];
  EXPECT_EQ(up, hold["forces"][6]["force"]);
  EXPECT_EQ(down, hold["forces"][7]["force"]);
  // 500 N/m in all directions.
  EXPECT_NEAR(hold["forces"][0]["deflection"], up / 500, 1e-3 * up / 500);
}

TEST(ContactOfAnArm, OverPosturesDoesNotDependOnJobs) {
  const Words samples = {"--drives", "panda", "--direction", "z", "--samples", "70"};
  const Json one = contact(joined(samples, {"--jobs", "1"}))["workspace"];
  EXPECT_EQ(one, contact(joined(samples, {"--jobs", "3"}))["workspace"]);
  EXPECT_LE(one["limit"]["worst"], one["limit"]["p05"]);
  EXPECT_LE(one["limit"]["p05"], one["limit"]["median"]);
  EXPECT_EQ(one["not_held"], 0);
  const Json heavy = contact(joined(samples, {"--payload", "6"}))["workspace"];
  EXPECT_GT(heavy["not_held"], 5);
}

TEST(ContactOfAnArm, JudgesWhatIsAskedForAtEveryPosture) {
  const Json asked = contact({"--drives", "panda", "--samples", "20", "--touch", "2.3e6"})["asked"];
  EXPECT_TRUE(asked["stable"].get<bool>());
  EXPECT_GT(asked["postures_unstable"].get<int>(), 0);
  EXPECT_LT(asked["postures_unstable"].get<int>(), 20);
}

TEST(ContactOfAnArm, RefusesWhatIsNoTouch) {
  const auto refusal = [](const Words& more) {
    const Outcome outcome = run_program(of_panda("contact", joined(kCrisp, more)));
    EXPECT_EQ(outcome.status, 2);
    EXPECT_EQ(outcome.out, "");
    return outcome.err;
  };
  EXPECT_THAT(refusal({"--touch=-1"}), HasSubstr("--touch: a stiffness from 0"));
  EXPECT_THAT(refusal({"--damper=-1"}), HasSubstr("--damper: a damping of at least 0"));
  EXPECT_THAT(refusal({"--mass=-1"}), HasSubstr("--mass: a mass of at least 0"));
  EXPECT_THAT(refusal({"--direction", "0,0,0"}), HasSubstr("--direction: is zero"));
  EXPECT_THAT(refusal({"--direction", "up"}), HasSubstr("--direction: "));
  EXPECT_THAT(refusal({"--payload", "40"}),
              HasSubstr("--q: the arm cannot hold itself here: joint"));
  EXPECT_THAT(refusal({"--plot", "curve.txt"}), HasSubstr("--plot: "));
}

TEST(ContactOfAnArm, TakesAConfigurationOrScene) {
  const std::string file = scene("panda_late_torque");
  const Json of_scene = parse(run_program({"contact", file, "--json"}));
  const Words options = {"--gains",
                         file,
                         "--mode",
                         "joint",
                         "--delay",
                         "3",
                         "--viscous-friction",
                         "urdf",
                         "--q",
                         "0,-0.8,0,-2.3,0,1.6,0.8",
                         "--json"};
  const Json same = parse(run_program(of_panda("contact", options)));
  EXPECT_EQ(of_scene["posture"]["q"], same["posture"]["q"]);
  EXPECT_NEAR(of_scene["posture"]["limit"], same["posture"]["limit"],
              1e-6 * same["posture"]["limit"].get<double>());
  const Json audited = parse(run_program({"modes", file, "--json"}));
  EXPECT_EQ(audited["intended_ratio"], 2);
  EXPECT_EQ(audited["posture"]["q"], of_scene["posture"]["q"]);
  EXPECT_GT(audited["posture"]["gain_margin"], 1.9);
  expect_refusals({"contact", file}, {{{"--preset", "crisp"}, "config excludes --preset"},
                                      {{"--delay", "2"}, "config excludes --delay"},
                                      {{"--period", "2 ms"}, "config excludes --period"},
                                      {{"--payload", "1"}, "config excludes --payload"}});
  expect_refusals({"contact"}, {{{"--preset", "crisp"}, "--urdf: give a CONFIG, or --urdf with"}});
}

TEST(ContactOfAnArm, NamesTheUnitsOfEachJointAndWhatIsUnknown) {
  const Scratch scratch;
  const std::string link =
      "><inertial><mass value='5'/><inertia ixx='1' iyy='1' izz='1' ixy='0' "
      "ixz='0' iyz='0'/></inertial></link>";
  const std::string urdf = scratch.write(
      "lift.urdf",
      "<robot name='r'><link name='base'/><link name='lift'" + link + "<link name='arm'" + link +
          "<link name='tip'/><joint name='up' type='prismatic'><parent link='base'/><child "
          "link='lift'/><axis xyz='0 0 1'/><limit lower='-1' upper='1' effort='0' velocity='1'/>"
          "</joint><joint name='turn' type='continuous'><parent link='lift'/><child link='arm'/>"
          "<axis xyz='0 0 1'/><limit effort='50' velocity='1'/></joint><joint name='end' "
          "type='fixed'><parent link='arm'/><child link='tip'/><origin xyz='1 0 0'/></joint>"
          "</robot>");
  const Words words = {"contact",
                       "--urdf",
                       urdf,
                       "--base",
                       "base",
                       "--tip",
                       "tip",
                       "--direction",
                       "z",
                       "--joint-stiffness",
                       "500 N/m,50 N m/rad",
                       "--joint-damping",
                       "100 N s/m,10 N m s/rad"};
  EXPECT_THAT(run_program(words).out, AllOf(HasSubstr("up      98.10  unknown     N        -\n"),
                                            HasSubstr("turn     0          50.00  N m      0\n"),
                                            HasSubstr("N m s/rad (N s/m) more of friction"),
                                            HasSubstr("(0, 0, 1.0)   unknown      unknown  -\n")));
  const Json hold = parse(run_program(joined(words, {"--json"})))["posture"]["hold"];
  EXPECT_EQ(hold["limit"], Json({nullptr, 50}));
  EXPECT_TRUE(hold["forces"][0]["force"].is_null());
  EXPECT_EQ(hold["forces"][4]["force"], 50);
}

TEST(TooHeavy, IsWarnedOfInOneLine) {
  const std::string line = "warning: --q: the arm cannot hold itself here: joint 'panda_joint";
  const Words heavy = joined(kHome, {"--payload", "40"});
  EXPECT_THAT(run_program(of_panda("audit", joined(heavy, {"--preset", "crisp"}))).err,
              StartsWith(line));
  const Words wanted = {"--task-stiffness", "500,500,500,30,30,30", "--damping-ratio", "0.7"};
  EXPECT_THAT(run_program(of_panda("design", joined(heavy, wanted))).err, StartsWith(line));
}

}  // namespace
}  // namespace dashpot::tests
