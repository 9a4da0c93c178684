// `dashpot identify`: what a user sees.
#include <dashpot/tests/apps/identify_run.hpp>
#include <dashpot/tests/support/arms.hpp>
#include <dashpot/tests/support/released_springs.hpp>
#include <dashpot/tests/support/sanitized.hpp>

namespace dashpot::tests {
namespace {

using ::testing::HasSubstr;

TEST(Identify, FindsTheDecayInAFile) {
  const Scratch scratch;
  const std::string file = scratch.write("decay.csv", decay_csv("time [s],q1 [rad],q2 [rad]", 1));
  const Json found = identify({file});
  expect_known_modes(found);
  EXPECT_GE(found["records"][0]["from"].get<double>(), 0.49);
  EXPECT_LT(found["records"][0]["from"].get<double>(), 0.8);
  expect_known_modes(identify({file, "--from", "0.51", "--to", "2.4"}));
  const Outcome table = run_program({"identify", file});
  EXPECT_EQ(table.status, 0);
  EXPECT_THAT(table.out, HasSubstr("1 free decay of 2 channels at 1 posture"));
  EXPECT_THAT(table.out, HasSubstr("q1 + 0.50 q2"));
}

/// Five minutes of two oscillators, 9 rad/s at 0.12 and 14 rad/s at 0.3, under random pushes at 100
/// Hz.
std::string shaken_csv() {
  std::string text = "time [s],q1 [rad],q2 [rad]\n";
  testing::Dice draw(3);
  struct Oscillator {
    double w, z, x = 0, v = 0;
    void step(double push) {  // exactly
      const double t = 0.01, d = w * std::sqrt(1 - z * z), b = (v + z * w * x) / d;
      const double fade = std::exp(-z * w * t), c = std::cos(d * t), s = std::sin(d * t);
      const double next = fade * (x * c + b * s);
      v = fade * ((b * c - x * s) * d) - z * w * next + push;
      x = next;
    }
  };
  Oscillator first{9, 0.12}, second{14, 0.3};
  for (int i = 0; i < 30000; ++i) {
    first.step(0.01 * draw.normal());
    second.step(0.03 * draw.normal());
    text +=
        printed("%.3f,%.9f,%.9f\n", 0.01 * i, 0.3 + first.x + second.x / 2 + 1e-5 * draw.normal(),
                first.x / 2 - second.x + 1e-5 * draw.normal());
  }
  return text;
}

TEST(Identify, FindsModesOfAmbientMotion) {
  const Scratch scratch;
  const std::string file = scratch.write("shaken.csv", shaken_csv());
  const Json found = identify({file, "--ambient"});
  ASSERT_EQ(found["modes"].size(), 2U) << found.dump();
  const std::array<double, 2> w{9, 14}, z{0.12, 0.3};
  for (std::size_t k = 0; k < 2; ++k) {
    const Json& mode = found["modes"][k];
    const double w_std = mode["natural_frequency_std"], z_std = mode["damping_ratio_std"];
    EXPECT_LT(std::abs(mode["natural_frequency"].get<double>() - w[k]), 4 * w_std);
    EXPECT_LT(std::abs(mode["damping_ratio"].get<double>() - z[k]), 4 * z_std);
    EXPECT_LT(w_std, 0.05 * w[k]);
    EXPECT_LT(z_std, 0.05);
  }
  EXPECT_NEAR(found["rest"][0].get<double>(), 0.3, 0.01);
  EXPECT_NEAR(found["records"][0]["to"].get<double>(), 299.99, 1e-6);
  const Outcome part = run_program({"identify", file, "--ambient", "--from", "30", "--to", "290"});
  EXPECT_EQ(part.status, 0);
  EXPECT_THAT(part.out, HasSubstr("1 ambient record of 2 channels at 1 posture"));
  EXPECT_THAT(part.out, HasSubstr("shaken.csv: 30.0000 to 290.000 s"));
  EXPECT_THAT(part.out, HasSubstr("2 modes from 1 record"));
  const Outcome none = run_program({"identify", file, "--ambient", "--to", "1"});
  EXPECT_EQ(none.status, 1);
  EXPECT_THAT(none.out, HasSubstr("takes a longer record"));
  EXPECT_THAT(none.err, HasSubstr("no modes: motion under unknown forces"));
}

/// Seven modes of four decays as predicted; with friction almost none, and the verdict says why.
TEST(Identify, FindsInScenesWhatIsPredictedOrSaysThatTheyAreNotLinear) {
  const Scratch scratch;
  const auto found_in = [&](const std::string& name) {
    const std::string file = scratch.path(name + ".lcm");
    EXPECT_EQ(run_program({"run", scene(name), "--fast", "--log", file}).status, 0);
    return identify({file, "--against", scene(name)});
  };
  const Json knocks = found_in("iiwa14_knocks");
  ASSERT_EQ(knocks["modes"].size(), 7U) << knocks.dump();
  EXPECT_TRUE(knocks["notes"].empty()) << knocks["notes"].dump();
  ASSERT_EQ(knocks["difference"].size(), 7U);
  for (const Json& one : knocks["difference"]) {
    EXPECT_TRUE(one["within"].get<bool>());
    EXPECT_LT(std::abs(one["natural_frequency"].get<double>()), 0.006);  // rad/s
  }
  const Json friction = found_in("ur5");
  EXPECT_THAT(friction["notes"].dump(), HasSubstr("not explained by modes"));
}

/// A well-damped arm that rubs: no mode is believed, and the verdict names what finds them.
TEST(Identify, NamesCalibrateWhereFrictionHidesModes) {
  const Scratch scratch;
  for (const char* displacement : {"[2 cm, 1 cm, 1 cm, 0.05, 0, 0.05]", "[0, 2 cm, 0, 0, 0, 0]"}) {
    const std::string file = scratch.write(
        "rubs.yaml",
        "robot:\n  urdf: " + testing::arm_path("ur5") +
            "\n  base: base_link\n  tip: ee_link\ncontrol: {mode: cartesian}\n"
            "gains: {task: {stiffness: [600, 600, 600, 30, 30, 30], damping_ratio: 1}}\n"
            "simulation:\n  robot: {viscous_friction: 0.3, coulomb_friction: 0.2, "
            "reflected_inertia: 0.1}\n"
            "  sensors: {position_noise: 1e-5 rad, position_resolution: 1e-5 rad}\n"
            "scenario:\n  duration: 8 s\n  start: {position: [0, -70 deg, 90 deg, -110 deg, -90 "
            "deg, 0], tip_displacement: " +
            std::string(displacement) + "}\n");
    const std::string log = scratch.path("rubs.lcm");
    EXPECT_EQ(run_program({"run", file, "--fast", "--log", log}).status, 0);
    const Json found = no_modes({log});
    EXPECT_EQ(found["verdict"], "decay");
    EXPECT_THAT(found["advice"].dump(), HasSubstr("dashpot calibrate")) << displacement;
  }
}

TEST(Identify, SaysFirstWhatARecordShows) {
  DASHPOT_SKIP_IF_QUICK();
  const Scratch scratch;
  const auto record = [&](const std::string& name, double size, auto motion) {
    std::string text = "time [s],q1 [rad],force [N]\n";
    testing::Dice draw(5);
    for (int i = 0; i < 4000; ++i) {
      text += printed("%.3f,%.9f,%.6f\n", 0.01 * i, size * motion(0.01 * i) + 1e-6 * draw.normal(),
                      draw.normal());
    }
    return scratch.write(name, text);
  };
  const auto verdict = [&](const std::string& name, double size, auto motion, const Words& more) {
    return no_modes(joined({record(name, size, motion)}, more));
  };
  const auto sweep = [](double t) {
    return std::sin(t) + 0.5 * std::sin(2.7 * t) + std::cos(4 * t);
  };
  const auto beat = [](double t) { return std::sin(5 * t) + 0.02 * std::sin(15 * t); };
  EXPECT_EQ(verdict("sweep.csv", 1, sweep, {})["verdict"], "large motion");
  EXPECT_EQ(verdict("sweep.csv", 1, sweep, {"--inputs", "force"})["verdict"], "large motion");
  double angle = 1.2, speed = 0;
  const auto pendulum = [&](double /*t*/) {
    const double now = angle;
    for (int part = 0; part < 100; ++part) {
      speed += 1e-4 * (-25 * std::sin(angle) - 0.3 * speed);
      angle += 1e-4 * speed;
    }
    return now;
  };
  const std::string far = record("pendulum.csv", 1, pendulum);
  const Json refused = no_modes({far});
  EXPECT_EQ(refused["verdict"], "large motion");
  EXPECT_THAT(refused["advice"].dump(), HasSubstr("--large-motion takes it"));
  const Json taken = no_modes({far, "--large-motion"});
  EXPECT_EQ(taken["verdict"], "decay");
  EXPECT_THAT(taken["notes"].dump(), HasSubstr("change with the size of the motion"));
  const auto spring = [](double t) { return std::exp(-0.15 * t) * std::cos(5 * t); };
  const Json linear = identify({record("spring.csv", 1.2, spring)});
  EXPECT_EQ(linear["verdict"], "decay");
  ASSERT_EQ(linear["modes"].size(), 1U);
  EXPECT_NEAR(linear["modes"][0]["natural_frequency"].get<double>(), std::hypot(5, 0.15), 1e-4);
  // Undamped, but rubbing: each half turn takes 0.04 from the amplitude, until it sticks.
  const auto rubbing = [](double t) {
    const double half = std::floor(9 * t / std::numbers::pi);
    if (half > 24) return 0.0;
    return (0.98 - 0.04 * half) * std::cos(9 * t) + (std::fmod(half, 2) == 0 ? 0.02 : -0.02);
  };
  const std::string rubs = record("rubbing.csv", 1.2, rubbing);
  const Json joint = identify({rubs, "--channels", "q1"});
  ASSERT_EQ(joint["modes"].size(), 1U);
  EXPECT_NEAR(joint["modes"][0]["natural_frequency"].get<double>(), 9, 1e-3);
  EXPECT_NEAR(joint["friction"].get<double>(), 1.2 * 0.02, 1e-3);
  EXPECT_GT(joint["friction_std"].get<double>(), 0);
  EXPECT_THAT(run_program({"identify", rubs, "--channels", "q1"}).out,
              HasSubstr("with Coulomb friction worth 0.02400 +- "));
  const Json cycle = verdict("cycle.csv", 0.1, beat, {});
  EXPECT_EQ(cycle["verdict"], "limit cycle");
  EXPECT_THAT(cycle["advice"].dump(), HasSubstr("5.00"));
  EXPECT_TRUE(cycle["modes"].empty());
  EXPECT_EQ(verdict("still.csv", 0, sweep, {})["verdict"], "nothing");
  const std::string file = scratch.write("decay.csv", decay_csv("time [s],q1 [rad],q2 [rad]", 1));
  EXPECT_EQ(identify({file})["verdict"], "decay");
  const std::string shaken = scratch.write("shaken.csv", shaken_csv());
  EXPECT_EQ(identify({shaken})["verdict"], "ambient");
  const Json mixed = identify({file, shaken});
  EXPECT_EQ(mixed["verdict"], "decay");
  EXPECT_THAT(mixed["records"].dump(), HasSubstr("another kind of motion"));
  EXPECT_THAT(run_program({"identify", scratch.path("still.csv")}).out,
              HasSubstr("Verdict: nothing: nothing moves beyond the noise"));
}

TEST(Identify, LeavesOutWhatIsClipped) {
  const Scratch scratch;
  std::string text = "time [s],q1 [rad],q2 [rad]\n";
  std::string rows = decay_csv("", 1).substr(1);
  for (std::size_t at = 0; at < rows.size();) {
    const std::size_t end = rows.find('\n', at);
    double t = 0, a = 0, b = 0;
    std::sscanf(rows.substr(at, end - at).c_str(), "%lf,%lf,%lf", &t, &a, &b);
    at = end + 1;
    text += printed("%.4f,%.9f,%.9f\n", t, std::max(a, -0.008), b);
  }
  const Json found = identify({scratch.write("clipped.csv", text)});
  ASSERT_EQ(found["modes"].size(), 2U);
  EXPECT_NEAR(found["modes"][0]["natural_frequency"].get<double>(), 9, 0.02);
  EXPECT_NEAR(found["modes"][1]["natural_frequency"].get<double>(), 14, 0.03);
  EXPECT_THAT(found["notes"].dump(), HasSubstr("samples of q1 left out, because they are clipped"));
}

/// Eight seconds of an oscillator of 9 rad/s at 0.12 under a force of 0.3 to 5 Hz at 200 Hz.
TEST(Identify, TakesInputsFromColumns) {
  const Scratch scratch;
  std::string text = "time [s],q1 [rad],q2 [rad],force [N]\n";
  testing::Dice draw(8);
  double x = 0, v = 0;
  for (int i = 0; i < 1600; ++i) {
    const double t = 0.005 * i, u = std::sin(6.283185307179586 * t * (0.3 + 0.29 * t));
    text += printed("%.4f,%.9f,0.5,%.9f\n", t, x + 1e-5 * draw.normal(), 10 * u);
    for (int part = 0; part < 50; ++part) {
      v += 0.0001 * (u - 2 * 0.12 * 9 * v - 81 * x);
      x += 0.0001 * v;
    }
  }
  const std::string file = scratch.write("driven.csv", text);
  const Json found = identify({file, "--inputs", "force"});
  ASSERT_EQ(found["modes"].size(), 1U) << found.dump();
  EXPECT_NEAR(found["modes"][0]["natural_frequency"].get<double>(), 9, 0.01);
  EXPECT_NEAR(found["modes"][0]["damping_ratio"].get<double>(), 0.12, 0.001);
  EXPECT_THAT(found["notes"].dump(), HasSubstr("q2 never moves"));
  const Outcome table = run_program({"identify", file, "--inputs", "force"});
  EXPECT_THAT(table.out, HasSubstr("1 driven record of 2 channels at 1 posture"));
}

}  // namespace
}  // namespace dashpot::tests
