// dashpot contact as a user runs it, and the warning of an arm that cannot hold itself.
#include <dashpot/tests/apps/json_result.hpp>

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
  for (const char* direction : {"x", "y", "z", "1,1,1", "-1,0.4,0.2"}) {
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

TEST(ContactOfAnArm, HoldsWhatTheJointsGive) {
  const Json hold = contact({"--direction", "z"})["posture"]["hold"];
  const Numbers torque = hold["torque"], limit = hold["limit"];
  for (const Json& one : hold["forces"]) {
    const std::size_t joint = one["joint"];
    EXPECT_GT(one["force"], 0);
    EXPECT_LT(std::abs(torque[joint]), limit[joint]);
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
