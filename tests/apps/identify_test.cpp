// `dashpot identify`: what a user sees, and what is refused.
#include <dashpot/tests/apps/json_result.hpp>
#include <dashpot/tests/support/arms.hpp>
#include <dashpot/tests/support/released_springs.hpp>
#include <dashpot/tests/support/sanitized.hpp>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdio>

namespace dashpot::tests {
namespace {

using ::testing::HasSubstr;

/// A file with a decay of 9 rad/s at 0.12 and one of 14 rad/s at 0.55 in two channels, after half a
/// second of rest.
std::string decay_csv(const std::string& heading, double angle, double time = 1) {
  std::string text = heading + "\n";
  std::uint64_t state = 7;  // of noise, about even, that every machine makes alike
  const auto noise = [&state] {
    state = state * 6364136223846793005U + 1442695040888963407U;
    return (static_cast<double>(state >> 33) / 2147483648.0 - 0.5) * 3e-5;
  };
  for (int i = 0; i < 1200; ++i) {
    const double t = 0.002 * i - 0.5;
    const auto wave = [t](double w, double z) {
      return t < 0 ? 1 : std::exp(-z * w * t) * std::cos(w * std::sqrt(1 - z * z) * t);
    };
    const double x = 0.02 * wave(9, 0.12), y = 0.02 * wave(14, 0.55);
    std::array<char, 200> line{};
    std::snprintf(line.data(), line.size(), "%.6f,%.9f,%.9f\n", time * (t + 0.5),
                  angle * (x + y / 2 + noise()), angle * (x / 2 - y + noise()));
    text += line.data();
  }
  return text;
}

Json identify(const Words& arguments) {
  return parse(run_program(joined({"identify", "--json"}, arguments)));
}

/// The report on records that have no modes: the program says so in one line, and fails.
Json no_modes(const Words& arguments) {
  Outcome outcome = run_program(joined({"identify", "--json"}, arguments));
  EXPECT_EQ(outcome.status, 1);
  EXPECT_THAT(outcome.err, HasSubstr("dashpot identify: no modes: "));
  EXPECT_EQ(std::count(outcome.err.begin(), outcome.err.end(), '\n'), 1);
  return Json::parse(outcome.out);
}

void expect_known_modes(const Json& found) {
  ASSERT_EQ(found["modes"].size(), 2U) << found.dump();
  const std::array<double, 2> w{9, 14}, z{0.12, 0.55};
  for (std::size_t k = 0; k < 2; ++k) {
    const Json& mode = found["modes"][k];
    EXPECT_NEAR(mode["natural_frequency"].get<double>(), w[k], 0.002 * w[k]);
    EXPECT_NEAR(mode["damping_ratio"].get<double>(), z[k], 0.003);
    EXPECT_LT(mode["natural_frequency_std"].get<double>(), 0.002 * w[k]);
    EXPECT_GT(mode["damping_ratio_std"].get<double>(), 0);
    EXPECT_EQ(mode["shape"].size(), 2U);
    EXPECT_GE(mode["stability"].get<double>(), 0.5);
  }
}

std::string replaced(std::string text, const std::string& from, const std::string& to) {
  for (std::size_t at = 0; (at = text.find(from, at)) != std::string::npos; at += to.size()) {
    text.replace(at, from.size(), to);
  }
  return text;
}

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
    std::array<char, 200> line{};
    std::snprintf(line.data(), line.size(), "%.3f,%.9f,%.9f\n", 0.01 * i,
                  0.3 + first.x + second.x / 2 + 1e-5 * draw.normal(),
                  first.x / 2 - second.x + 1e-5 * draw.normal());
    text += line.data();
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
  EXPECT_THAT(none.err, HasSubstr("no modes: "));
}

TEST(Identify, TakesFilesAsPeopleAndRecordersWriteThem) {
  const Scratch scratch;
  const double degree = 57.29577951308232;
  std::string stamps = replaced(decay_csv("timestamp,q[0],q[1],q_d_0,tau_J_0,mode,", 1, 1e6), "\n",
                                ",0.7,0,kMove,\n");
  stamps.erase(stamps.find(",0.7,"), 13);  // of the line of names
  const std::string european = replaced(decay_csv("Time,q1 (rad),q2 (rad)", 1), ",", ";");
  const std::string dos =
      "\xEF\xBB\xBF# a comment\r\n" + replaced(decay_csv("timestamp,q1,q2", 1), "\n", "\r\n");
  const std::vector<std::string> texts = {
      replaced(decay_csv("\"t_ms\",q1 (deg),\"q2_deg\"", degree, 1000), ",", ";"),
      "# a recorder\n# " + replaced(decay_csv("time q_0 q_1", 1), ",", " "),
      replaced(european, ".", ","), dos, stamps};
  Json found;
  std::string file;
  for (const std::string& text : texts) {
    SCOPED_TRACE(text.substr(0, 60));
    file = scratch.write("file" + std::to_string(text.size()), text);
    found = identify({file});
    expect_known_modes(found);
  }
  EXPECT_THAT(found["notes"].dump(), HasSubstr("timestamp is taken to be in us"));
  EXPECT_THAT(found["notes"].dump(), HasSubstr("as they hold text: mode"));
  const Json both = identify({file, file});
  EXPECT_EQ(both["records"].size(), 2U);
  EXPECT_EQ(both["postures"].size(), 1U);
}

/// Without names, without a time, with others' units, with dates, and with names that are there
/// twice but not wanted.
TEST(Identify, TakesFilesThatDoNotSayWhatTheyAre) {
  const Scratch scratch;
  const std::string plain = decay_csv("", 1).substr(1);
  expect_known_modes(identify({scratch.write("plain.csv", plain)}));
  expect_known_modes(
      identify({scratch.write("named.csv", plain), "--columns", "t,q1 [rad],q2 [rad]"}));
  std::string timeless, dated = "stamp,q1,q2,speed [m/s^2],speed\n", epoch = "timestamp,q1,q2\n";
  std::size_t at = 0;
  for (int i = 0; at < plain.size(); ++i) {
    const std::size_t comma = plain.find(',', at), end = plain.find('\n', at);
    const std::string values = plain.substr(comma + 1, end - comma - 1);
    at = end + 1;
    timeless += values + "\n";
    std::array<char, 60> time{};
    std::snprintf(time.data(), time.size(), "2026-01-31T23:59:%02d.%03dZ,", 58 + 2 * i / 1000,
                  2 * i % 1000);
    std::string stamp = time.data();
    if (2 * i / 1000 > 1) {  // into the next day, month
      std::snprintf(time.data(), time.size(), "2026-02-01T00:00:%02d.%03dZ,", 2 * i / 1000 - 2,
                    2 * i % 1000);
      stamp = time.data();
    }
    dated += stamp + values + ",1,2\n";
    std::snprintf(time.data(), time.size(), "17%08d%09lld,", 12345678 + 2 * i / 1000,
                  2'000'000LL * i % 1'000'000'000LL);
    epoch += time.data() + values + "\n";
  }
  expect_known_modes(identify({scratch.write("timeless.csv", timeless), "--rate", "500"}));
  expect_known_modes(identify({scratch.write("dated.csv", dated)}));
  expect_known_modes(identify({scratch.write("epoch.csv", epoch)}));
  const std::string duration = decay_csv("duration,q1,q2", 1);
  expect_known_modes(identify({scratch.write("duration.csv", duration)}));
}

/// Each is what a recorder or a spreadsheet makes of it, and none of it changes the modes.
TEST(Identify, TakesWhatRecordersAddAndLeaveOut) {
  const Scratch scratch;
  const std::string good = decay_csv("time,q1,q2", 1), rows = good.substr(good.find('\n') + 1);
  const auto with = [&rows](const std::string& heading, const std::string& end = "") {
    return heading + "\n" + rows + end;
  };
  const auto column = [&rows](const std::string& heading, const std::string& early,
                              const std::string& late) {
    std::string text = heading + "\n" + replaced(rows, "\n", "," + early + "\n");
    const std::size_t half = text.size() / 2;
    return text.substr(0, half) +
           replaced(text.substr(half), "," + early + "\n", "," + late + "\n");
  };
  const std::vector<std::string> texts = {
      with("Recorder 3.1\nArm: iiwa, at 500 Hz\n\ntime,q1,q2"),
      with("# recorded on a Friday"),
      with("time,q1,q2\ns,rad,rad"),
      with("date,Angle1 [radians],Angle2 [radians]"),
      with("__time,/joint_states/position[0],/joint_states/position[1]"),
      with("% time,field.position0,field.position1"),
      with("time,q1,q2", "\n\n  \n,,\n"),
      with("time,q1,q2", "2.4001,0.00"),  // whose end was not written
      replaced(good, "\n", "\r"),
      column("time,q1,q2,note", "", "hit"),
      column("time,q1,q2,q3 [A]", "NA", "null"),
      replaced(column("time,q1,q2,q3 [A]", "5", ""), ",", "\t"),
  };
  for (const std::string& text : texts) {
    SCOPED_TRACE(text.substr(0, 60));
    expect_known_modes(identify({scratch.write("file.csv", text)}));
  }
  std::string degrees = decay_csv("Time (sec),q1 (\xC2\xB0),q2 (degrees)", 57.29577951308232);
  const std::size_t comma = degrees.find(',', degrees.size() / 2);
  degrees.replace(comma + 1, degrees.find(',', comma + 1) - comma - 1, "n/a");
  expect_known_modes(identify({scratch.write("degrees.csv", degrees)}));
  expect_refusal(run_program({"identify", scratch.write("note.csv", column("time,q1,q2", "", "x")),
                              "--columns", "time,q1,q2,q3", "--channels", "q1,q3"}),
                 "q3: 'x' is no number");
}

TEST(Identify, SaysFirstWhatARecordShows) {
  const Scratch scratch;
  const auto record = [&](const std::string& name, double size, auto motion) {
    std::string text = "time [s],q1 [rad],force [N]\n";
    testing::Dice draw(5);
    for (int i = 0; i < 4000; ++i) {
      std::array<char, 100> line{};
      std::snprintf(line.data(), line.size(), "%.3f,%.9f,%.6f\n", 0.01 * i,
                    size * motion(0.01 * i) + 1e-6 * draw.normal(), draw.normal());
      text += line.data();
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
  EXPECT_EQ(verdict("pendulum.csv", 1, pendulum, {})["verdict"], "large motion");
  const auto spring = [](double t) { return std::exp(-0.15 * t) * std::cos(5 * t); };
  const Json linear = identify({record("spring.csv", 1.2, spring)});
  EXPECT_EQ(linear["verdict"], "decay");
  ASSERT_EQ(linear["modes"].size(), 1U);
  EXPECT_NEAR(linear["modes"][0]["natural_frequency"].get<double>(), std::hypot(5, 0.15), 1e-4);
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
    std::array<char, 100> line{};
    std::snprintf(line.data(), line.size(), "%.4f,%.9f,%.9f\n", t, std::max(a, -0.008), b);
    text += line.data();
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
    std::array<char, 200> line{};
    std::snprintf(line.data(), line.size(), "%.4f,%.9f,0.5,%.9f\n", t, x + 1e-5 * draw.normal(),
                  10 * u);
    text += line.data();
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

TEST(Identify, LeavesOutWhatIsMissingOrTwiceAndSaysSo) {
  const Scratch scratch;
  std::string text = decay_csv("time [s],q1 [rad],q2 [rad],note", 1), with_holes;
  int line = 0;
  for (std::size_t at = 0; at < text.size(); ++line) {
    const auto end = text.find('\n', at);
    std::string row = text.substr(at, end - at);
    at = end + 1;
    if (line > 0) row += ",";
    if (line % 50 == 7) row = row.substr(0, row.find(',')) + ",,nan,";
    with_holes += row + "\n";
    if (line == 300) with_holes += row + "\n0.1,1,2,3\n";  // twice, and back in time
  }
  const Json found = identify({scratch.write("a.csv", with_holes), "--channels", "q1,q2"});
  expect_known_modes(found);
  EXPECT_THAT(found["notes"].dump(), HasSubstr("1 samples left out, because another has the same"));
  EXPECT_THAT(found["notes"].dump(), HasSubstr("time runs backwards"));
}

/// Releases of an iiwa with a payload and drives that its controller does not know of.
class HiddenArm {
 public:
  /// Its configuration, with what is known or all of it.
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

TEST(Identify, RefusesInOneLineThatNamesFileLineAndColumn) {
  const Scratch scratch;
  const std::string good = decay_csv("time [s],q1 [rad],q2 [rad]", 1);
  int number = 0;
  const auto file = [&](const std::string& text) {
    return scratch.write("bad" + std::to_string(number++) + ".csv", text);
  };
  const std::vector<std::pair<std::vector<std::string>, std::string>> all = {
      {{file("")}, "is empty"},
      {{file("time,q1\n")}, "0 samples, need 20"},
      {{file("time,time,q1\n1,2,3\n")}, "two columns of time"},
      {{file("a,b\n1,2\n")}, "line 1: no column of time"},
      {{file("0,1\n1,2\n1,3\n")}, "line 1: numbers, where a line of names"},
      {{file("recorder\n\na,b\n1,2\n")}, "line 3: no column of time"},
      {{file("time,q1\n12:00:00,2\n")}, "line 2, time: '12:00:00' is no time"},
      {{file("\xFF\xFEt\n")}, "is text in UTF-16: save it as UTF-8"},
      {{file("SQLite format 3 of a bag")}, "dashpot.read_log(FILE)"},
      {{file(good), "--rate", "nan"}, "--rate: has to be a finite number"},
      {{file(replaced(good, "\n1.", ",7\n1.")), "--columns", "t,q1,q2"}, "not 3 columns"},
      {{file("time\n1\n")}, "no column but the time"},
      {{file("time [kg],q1\n1,2\n")}, "in kg, a time is wanted"},
      {{file(replaced(good, "q1 [rad],q2 [rad]", "q [m/s^2],p [furlong]"))},
       "--channels: no column is known to be a position"},
      {{file(replaced(good, "q2", "q1"))}, "two columns are called 'q1': --columns"},
      {{file(good), "--from", "nan"}, "--from: has to be a finite time"},
      {{file(good), "--from", "2", "--to", "1"}, "--from: has to be before --to"},
      {{file("time,q1\n1,2\n2\n")}, "line 3: not 2 columns"},
      {{file("time,q1\n1,2,3\n")}, "line 2: not 2 columns"},
      {{file("time,q1\n1,2\n2,x\n")}, "line 3, q1: 'x' is no number"},
      {{file("time,q1\nnan,2\n")}, "line 2: no time"},
      {{file(std::string("\x7f"
                         "ELF\0\0\1",
                         7))},
       "no column of time"},
      {{file(good), "--inputs", "torque"}, "--inputs: no channel 'torque'; there are q1"},
      {{file(good), "--inputs", "q1", "--channels", "q1,q2"}, "'q1' is among --inputs"},
      {{file(good), "--excited"}, "--excited: needs --inputs"},
      {{file(good), "--channels", "q9"}, "no channel 'q9'; there are q1, q2"},
      {{file(good), "--channels", "q1,q1"}, "'q1' twice"},
      {{file(good), "--from", "7"}, "0 samples from --from to --to"},
      {{file("time,x\n" + good.substr(good.find('\n') + 1, 3000))}, "columns"},
      {{file(good), file(decay_csv("time,q1,q3", 1))}, "its channels differ"},
      {{file(good), "--calibrate", "payload"}, "--against"},
      {{file(good), "--plot", "x.pdf"}, "--plot: x.pdf: has to end"},
      {{file("time [s],label,natural_frequency [rad/s]\n0,1,2\n")}, "has modes in place of motion"},
      {{scratch.path("none.csv")}, "none.csv"},
      {{scratch.path("")}, "cannot be read"},
  };
  for (const auto& [arguments, words] : all) {
    expect_refusal(run_program(joined({"identify"}, arguments)), words);
  }
}

/// Four releases give the payload and the reflected inertias, which the file that is written has
/// as well; a single release cannot tell them apart.
TEST(Identify, ShowsMeasuredBesidePredictedModesAndCalibrates) {
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
  // Deviations are what they say, because what is not linear is in the model.
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
              HasSubstr("'colour' is none of payload"));
}

/// A mass at the centre that the configuration has explains no payload 5 cm beside it.
TEST(Identify, DeterminesNothingOfAPayloadThatIsElsewhere) {
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
TEST(Identify, CalibratesAPayloadWithItsCenterAndInertia) {
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

}  // namespace
}  // namespace dashpot::tests
