// `dashpot identify --calibrate`: what differs between an arm and its configuration.
#include <dashpot/tests/apps/identify_run.hpp>
#include <dashpot/tests/support/arms.hpp>
#include <dashpot/tests/support/sanitized.hpp>

#include <filesystem>

namespace dashpot::tests {
namespace {

using ::testing::HasSubstr;

/// Releases of an iiwa with a payload and drives that are unknown to its controller.
class HiddenArm {
 public:
  /// Its configuration, with some or all of its properties.
  static std::string config(const std::string& mass, const std::string& inertia) {
    return "{robot: {urdf: " + testing::arm_path("iiwa14") +
           ", base: iiwa_link_0, tip: iiwa_link_ee_kuka, reflected_inertia: " + inertia +
           ", payload: {mass: " + mass +
           "}}, control: {mode: joint}, gains: {joint: {stiffness: [800, 800, 500, 500, "
           "200, 100, 50], damping: [20, 25, 10, 12, 3, 2, 0.5]}}";
  }

  /// Logs of a release each, two at each posture: a wrench that holds the tip ends at 1.5 s.
  HiddenArm(const Scratch& scratch, std::size_t count, const std::string& payload = "mass: 1.5") {
    std::vector<std::string> postures = {
        "[0, 0.5, 0, -1.4, 0, 1, 0]", "[-0.5, 0.3, -0.4, -1.6, 1, 1.2, 0.5]",
        "[0.4, 0.9, 0.6, -0.9, -0.8, 0.5, 1]", "[1, -0.4, 0.3, -1.9, 0.5, -0.9, -0.6]",
        "[-0.8, 1.1, -1, -0.6, 1.4, 1.5, 0.2]"};
    postures.resize(count);
    int n = 0;
    for (const std::string& posture : postures) {
      for (const char* wrench : {"[25, -20, 15, 3, 2, -2]", "[-15, 25, 20, -2, 3, 3]"}) {
        const std::string name = std::to_string(n++);
        const std::string scene = scratch.write(
            "scene" + name + ".yaml",
            config("0", "[0.1, 0.1, 0.1, 0.1, 0.1, 0.1, 0.1]") +
                ", simulation: {robot: {payload: {" + payload +
                "}, reflected_inertia: [0.13, 0.12, "
                "0.11, 0.1, 0.09, 0.08, 0.05]}, sensors: {position_noise: 1e-5 rad}}, scenario: "
                "{duration: 3.5, start: {position: " +
                posture + "}, pushes: [{begin: 0.55, end: 1.5, wrench: " + wrench + "}]}}");
        logs.push_back(scratch.path(name + ".lcm"));
        const Outcome outcome = run_program({"run", scene, "--fast", "--log", logs.back()});
        EXPECT_EQ(outcome.status, 0) << outcome.err;
      }
    }
  }

  std::vector<std::string> logs;
};

/// Four releases give the payload and the reflected inertias, which the file that is written has
/// as well; a single release cannot tell them apart.
TEST(Calibrate, ShowsMeasuredBesidePredictedModesAndCalibrates) {
  DASHPOT_SKIP_IF_QUICK();
  const Scratch scratch;
  const HiddenArm arm(scratch, 2);
  const std::string truth = scratch.write(
      "truth.yaml", HiddenArm::config("1.5", "[0.13, 0.12, 0.11, 0.1, 0.09, 0.08, 0.05]") + "}");
  const std::string guess = scratch.write(
      "guess.yaml", HiddenArm::config("0", "[0.1, 0.1, 0.1, 0.1, 0.1, 0.1, 0.1]") + "}");
  const Json known = identify({arm.logs[0], arm.logs[1], "--from", "1.51", "--against", truth});
  EXPECT_EQ(known["postures"].size(), 1U);
  int near = 0;
  for (const Json& posture : known["postures"]) {
    for (const Json& difference : posture["difference"]) {
      const std::size_t i = difference["predicted"];
      const double w = posture["predicted"][i]["natural_frequency"];
      near += std::abs(difference["natural_frequency"].get<double>()) < 0.01 * w;
    }
  }
  EXPECT_GE(near, 4) << "of 7 modes";

  std::vector<std::string> arguments = arm.logs;
  arguments.insert(arguments.end(),
                   {"--from", "1.51", "--against", guess, "--calibrate",
                    "payload,reflected_inertia", "--output", scratch.path("found.yaml")});
  const Json calibration = identify(arguments)["calibration"];
  const Json& parameters = calibration["parameters"];
  const std::array<double, 8> values{1.5, 0.13, 0.12, 0.11, 0.1, 0.09, 0.08, 0.05};
  ASSERT_EQ(parameters.size(), values.size());
  EXPECT_EQ(parameters[0]["name"], "payload");
  // Deviations are right, because the model includes what is not linear.
  EXPECT_LT(calibration["misfit"].get<double>(), 3);
  EXPECT_LT(calibration["misfit"].get<double>(), 0.2 * calibration["misfit_before"].get<double>());
  for (std::size_t i = 0; i < values.size(); ++i) {
    const double value = parameters[i]["value"], deviation = parameters[i]["std"];
    EXPECT_TRUE(parameters[i]["determined"].get<bool>());
    EXPECT_LT(deviation, (i == 0 ? 0.015 : 0.15) * values[i]) << parameters[i]["name"];
    EXPECT_NEAR(value, values[i], (i == 0 ? 0.02 : 0.15) * values[i]) << parameters[i]["name"];
    EXPECT_NEAR(value, values[i], 5 * deviation) << parameters[i]["name"];
  }
  const std::string text = scratch.read("found.yaml");
  const auto mass = text.find("mass: ");
  ASSERT_NE(mass, std::string::npos) << text;
  EXPECT_NEAR(std::stod(text.substr(mass + 6)), parameters[0]["value"].get<double>(), 1e-6);

  const Json one = identify({arm.logs[0], "--from", "1.51", "--against", guess, "--calibrate",
                             "payload,reflected_inertia,friction,delay"});
  EXPECT_FALSE(one["calibration"]["warnings"].empty());
  EXPECT_THAT(run_program({"identify", arm.logs[0], "--from", "1.51", "--to", "1.9", "--against",
                           guess, "--calibrate", "payload,colour"})
                  .err,
              HasSubstr("'colour' is unknown; there are payload"));
}

/// A mass at the centre that the configuration has explains no payload 5 cm beside it.
TEST(Calibrate, DeterminesNothingOfAPayloadThatIsElsewhere) {
  DASHPOT_SKIP_IF_QUICK();
  const Scratch scratch;
  const HiddenArm arm(scratch, 2, "mass: 1.5, center: [0.05, 0, 0]");
  const std::string guess = scratch.write(
      "guess.yaml", HiddenArm::config("0", "[0.13, 0.12, 0.11, 0.1, 0.09, 0.08, 0.05]") + "}");
  std::vector<std::string> arguments = arm.logs;
  arguments.insert(arguments.end(),
                   {"--from", "1.51", "--against", guess, "--calibrate", "payload"});
  const Json calibration = identify(arguments)["calibration"];
  EXPECT_GT(calibration["misfit"].get<double>(), 3);
  EXPECT_FALSE(calibration["consistent"].get<bool>());
  EXPECT_FALSE(calibration["parameters"][0]["determined"].get<bool>());
  EXPECT_FALSE(calibration["warnings"].empty());
}

/// Its mass, where it is and its inertia, which is one of a body, each within three deviations.
TEST(Calibrate, CalibratesAPayloadWithItsCenterAndInertia) {
  DASHPOT_SKIP_IF_QUICK();
  const Scratch scratch;
  const HiddenArm arm(scratch, 2,
                      "mass: 1.5, center: [0.05, -0.02, 0.08], inertia: [0.01, 0.012, 0.006]");
  const std::string guess = scratch.write(
      "guess.yaml", HiddenArm::config("0", "[0.13, 0.12, 0.11, 0.1, 0.09, 0.08, 0.05]") + "}");
  std::vector<std::string> arguments = arm.logs;
  arguments.insert(arguments.end(), {"--from", "1.51", "--against", guess, "--calibrate",
                                     "payload,payload_center,payload_inertia"});
  const Json calibration = identify(arguments)["calibration"];
  const std::array<double, 7> truth{1.5, 0.05, -0.02, 0.08, 0.01, 0.012, 0.006};
  const std::array<double, 7> most{0.05, 0.005, 0.005, 0.01, 0.005, 0.005, 0.002};
  EXPECT_TRUE(calibration["consistent"].get<bool>()) << calibration["misfit"];
  ASSERT_EQ(calibration["parameters"].size(), truth.size());
  for (std::size_t i = 0; i < truth.size(); ++i) {
    const Json& one = calibration["parameters"][i];
    const double value = one["value"], deviation = one["std"];
    EXPECT_TRUE(one["determined"].get<bool>()) << one["name"];
    EXPECT_LT(deviation, most[i]) << one["name"];
    EXPECT_NEAR(value, truth[i], 3 * deviation) << one["name"];
  }
}

/// An arm of two elastic joints, by four releases at two postures.
TEST(Calibrate, FindsTheStiffnessOfGears) {
  DASHPOT_SKIP_IF_QUICK();
  const Scratch scratch;
  const auto link = [](const std::string& name, const std::string& center,
                       const std::string& mass) {
    return "<link name='" + name + "'><inertial><origin xyz='" + center + " 0 0'/><mass value='" +
           mass +
           "'/><inertia ixx='0.01' ixy='0' ixz='0' iyy='0.04' iyz='0' "
           "izz='0.04'/></inertial></link>";
  };
  const auto joint = [](const std::string& type, const std::string& parent,
                        const std::string& child, const std::string& x) {
    return "<joint name='j_" + child + "' type='" + type + "'><parent link='" + parent +
           "'/><child link='" + child + "'/><origin xyz='" + x +
           " 0 0'/><axis xyz='0 0 1'/><limit lower='-3' upper='3' effort='200' "
           "velocity='5'/></joint>";
  };
  const std::string urdf = scratch.write(
      "two.urdf", "<robot name='two'><link name='base'/><link name='tip'/>" +
                      link("a", "0.2", "3") + link("b", "0.15", "2") +
                      joint("revolute", "base", "a", "0") + joint("revolute", "a", "b", "0.4") +
                      joint("fixed", "b", "tip", "0.3") + "</robot>");
  const auto config = [&urdf](const std::string& gears) {
    return "{robot: {urdf: " + urdf + ", base: base, tip: tip, reflected_inertia: [0.3, 0.2]" +
           gears +
           "}, limits: {stopping_time: 0.3}, control: {mode: joint}, gains: {joint: {stiffness: "
           "[150, 80], damping: [4, 2]}}";
  };
  const std::string gears = ", gear_stiffness: [800, 400], gear_damping: [1, 0.5]";
  std::vector<std::string> arguments;
  for (const char* posture : {"[0.3, 0.8]", "[-0.5, 1.6]"}) {
    for (const char* wrench : {"[6, 8, 0, 0, 0, 0]", "[-8, 5, 0, 0, 0, 0]"}) {
      const std::string name = std::to_string(arguments.size());
      const std::string scene = scratch.write(
          name + ".yaml", config(gears) +
                              ", simulation: {robot: {gear_stiffness: [600, 320]}, sensors: "
                              "{position_noise: 1e-5 rad}}, scenario: {duration: 4, start: "
                              "{position: " +
                              posture + "}, pushes: [{begin: 0.55, end: 1.5, wrench: " + wrench +
                              "}]}}");
      arguments.push_back(scratch.path(name + ".lcm"));
      const Outcome outcome = run_program({"run", scene, "--fast", "--log", arguments.back()});
      ASSERT_EQ(outcome.status, 0) << outcome.err;
    }
  }
  const auto calibrated = [&](const std::string& with, const std::string& file) {
    return run_program(
        joined(joined({"identify", "--json"}, arguments),
               {"--from", "1.51", "--against", scratch.write("guess.yaml", config(with) + "}"),
                "--calibrate", "gear_stiffness", "--output", scratch.path(file)}));
  };
  const Json calibration = parse(calibrated(gears, "found.yaml"))["calibration"];
  EXPECT_TRUE(calibration["consistent"].get<bool>()) << calibration["misfit"];
  const std::array<double, 2> truth{600, 320};
  for (std::size_t i = 0; i < truth.size(); ++i) {
    const Json& one = calibration["parameters"][i];
    EXPECT_TRUE(one["determined"].get<bool>());
    EXPECT_NEAR(one["value"].get<double>(), truth[i], 0.01 * truth[i]);
    EXPECT_NEAR(one["value"].get<double>(), truth[i], 5 * one["std"].get<double>());
  }
  EXPECT_THAT(scratch.read("found.yaml"), HasSubstr("gear_stiffness: [59"));
  EXPECT_THAT(calibrated("", "none.yaml").err, HasSubstr("needs robot.gear_stiffness"));

  // Many parameters explain few numbers, which proves nothing and contradicts nothing.
  const std::string guess = scratch.write("guess.yaml", config(gears) + "}");
  const auto calibrated_by = [&](const std::string& file, const Words& more) {
    return run_program(
        joined({"identify", file, "--against", guess, "--output", scratch.path("few.yaml")}, more));
  };
  const Outcome few = calibrated_by(
      arguments[0],
      {"--from", "1.51", "--calibrate", "payload,reflected_inertia,friction,gear_stiffness,delay"});
  EXPECT_EQ(few.status, 0) << few.err;
  EXPECT_THAT(few.out, HasSubstr("no more numbers were measured (8) than parameters are wanted"));
  EXPECT_THAT(few.out, ::testing::Not(HasSubstr("does not explain the modes")));
  std::filesystem::remove(scratch.path("few.yaml"));

  // Without measured modes that match predictions, nothing is calibrated.
  const Outcome still =
      calibrated_by(arguments[0], {"--to", "0.4", "--calibrate", "gear_stiffness"});
  EXPECT_EQ(still.status, 1);
  EXPECT_THAT(still.err, HasSubstr("no modes: "));
  EXPECT_THAT(still.out, ::testing::Not(HasSubstr("of no numbers")));
  const Outcome other =
      calibrated_by(scratch.write("other.csv", decay_csv("time_ms,q1_rad,q2_rad", 1, 10)),
                    {"--calibrate", "gear_stiffness"});
  EXPECT_EQ(other.status, 1) << other.out;
  EXPECT_EQ(other.err,
            "dashpot identify: --calibrate: no mode that was measured is like one that is "
            "predicted\n");
  EXPECT_FALSE(std::filesystem::exists(scratch.path("few.yaml")));
}

}  // namespace
}  // namespace dashpot::tests
