// `dashpot run --excite`: the wrench that acts, refusals, and the effect of a fault.
#include <dashpot/lcmtypes/message_reader.hpp>
#include <dashpot/tests/apps/scene_run.hpp>
#include <dashpot/tests/support/places.hpp>
#include <dashpot/tests/support/sanitized.hpp>

#include <gmock/gmock.h>
#include <nlohmann/json.hpp>

#include <algorithm>
#include <cmath>
#include <string>
#include <vector>

namespace dashpot::tests {
namespace {

using ::testing::HasSubstr;

/// A calm scene with springs at the joints, so the tip's wrench is the excitation alone.
std::string calm_scene(const Scratch& scratch, const std::string& more = "") {
  return scratch.write("scene.yaml",
                       R"(
robot: {urdf: )" + std::string(DASHPOT_SOURCE_DIR) +
                           R"(/sim/models/panda.urdf, base: panda_link0, tip: panda_hand_tcp}
control: {mode: joint}
motion: {gain_time: 10 ms}
gains: {joint: {stiffness: [600, 600, 600, 600, 100, 100, 20], damping: [20, 50, 8, 30, 5, 5, 1]}}
)" + more + R"(
scenario:
  duration: 3 s
  start: {position: [0, -45 deg, 0, -135 deg, 0, 90 deg, 45 deg]}
)");
}

/// What a run says, and its states.
struct Excited {
  nlohmann::json identified;
  std::vector<state_t> states;

  Excited(const std::string& path, const std::vector<std::string>& options) {
    const Scratch scratch;
    const Outcome outcome =
        run_scene(path, joined({"--json", "--log", scratch.path("log")}, options));
    EXPECT_EQ(outcome.status, 0) << outcome.err;
    identified = nlohmann::json::parse(outcome.out).value("identified", nlohmann::json());
    lcmtypes::MessageHandlers handlers;
    handlers.on_state = [&](const state_t& state) { states.push_back(state); };
    lcmtypes::LogReader log(scratch.path("log"), handlers);
    while (log.read()) log.handle();
  }

  /// Expects at least one measured mode at its predicted place, and of its shape if `shapes`.
  void expect_close(bool shapes) const {
    int close = 0;
    for (const auto& difference : identified.at("difference")) {
      const auto& mode = identified.at("modes").at(difference.at("measured").get<std::size_t>());
      const double relative = difference.at("natural_frequency").get<double>() /
                              mode.at("natural_frequency").get<double>();
      const double of_ratio = difference.at("damping_ratio").get<double>();
      close += std::abs(relative) < 0.01 && std::abs(of_ratio) < 0.01 &&
               (!shapes || difference.at("likeness").get<double>() > 0.9);
    }
    EXPECT_GE(close, 1) << identified.dump(1);
  }
};

TEST(Excite, PulsesActWhenTheyShouldAndWhatFollowsIsIdentified) {
  DASHPOT_SKIP_IF_QUICK();
  const Scratch scratch;
  const std::string path = calm_scene(scratch);
  const Excited run(path, {"--duration", "2.2", "--excite",
                           "pulse,direction=z,force=-5 N,duration=0.1,at=0.2,every=800 ms,"
                           "count=2"});
  const auto& states = run.states;
  ASSERT_EQ(states.size(), 2200u);
  const auto force = [&](std::size_t ms) { return states[ms].tip_wrench[2]; };
  for (const std::size_t ms : {0u, 199u, 315u, 700u, 999u, 1115u, 1800u, 2199u}) {
    EXPECT_EQ(force(ms), 0) << ms;
  }
  for (const std::size_t ms : {215u, 299u, 1015u, 1099u}) EXPECT_EQ(force(ms), -5) << ms;
  EXPECT_LT(force(205), 0);  // over gain_time
  EXPECT_GT(force(205), -5);
  for (const int other : {0, 1, 3, 4, 5}) EXPECT_EQ(states[250].tip_wrench[other], 0) << other;
  double before = 0, after = 0;
  for (std::size_t i = 0; i < 7; ++i) {
    before = std::max(before, std::abs(states[199].joint_velocity[i]));
    after = std::max(after, std::abs(states[320].joint_velocity[i]));
  }
  EXPECT_GT(after, 1e-3 + 10 * before);  // rad/s
  EXPECT_EQ(states.back().fault, 0);
  EXPECT_EQ(run.identified.at("postures").at(0).at("parts"), 2);
  run.expect_close(true);

  const Outcome too_short = run_scene(path, {"--duration", "0.01", "--log", scratch.path("log"),
                                             "--excite", "pulse,direction=z,force=1,duration=0.5"});
  EXPECT_EQ(too_short.status, 0) << too_short.err;
  EXPECT_THAT(too_short.out, HasSubstr("Note: no modes are identified: "));
  EXPECT_THAT(too_short.out, HasSubstr("10 samples"));
}

TEST(Excite, AChirpSweepsItsFrequenciesAndWhatItMovesIsIdentified) {
  DASHPOT_SKIP_IF_QUICK();
  const Scratch scratch;
  const Excited run(calm_scene(scratch),
                    {"--duration", "3.5", "--excite",
                     "chirp,direction=ry,torque=1,from=1,to=9,duration=3,at=0.3"});
  const auto& states = run.states;
  ASSERT_EQ(states.size(), 3500u);
  const auto crossings = [&](std::size_t begin, std::size_t end) {
    int count = 0;
    for (std::size_t i = begin + 1; i < end; ++i) {
      if (states[i - 1].tip_wrench[4] < 0 && states[i].tip_wrench[4] >= 0) ++count;
    }
    return count;
  };
  EXPECT_EQ(crossings(0, 300), 0);
  EXPECT_NEAR(crossings(300, 1800), 4.5, 1);    // 1 to 5 Hz in 1.5 s
  EXPECT_NEAR(crossings(1800, 3300), 10.5, 1);  // 5 to 9 Hz in 1.5 s
  double greatest = 0;
  for (const state_t& state : states) greatest = std::max(greatest, std::abs(state.tip_wrench[4]));
  EXPECT_LE(greatest, 1);
  EXPECT_GT(greatest, 0.8);
  EXPECT_EQ(states.back().tip_wrench[4], 0);
  ASSERT_EQ(run.identified.at("postures").size(), 1U) << run.identified.dump(1);
  EXPECT_GT(run.identified.at("explained").get<double>(), 0.999);
  run.expect_close(false);
}

// The sensors show NaN for 50 ms at 1 s, which latches a fault; the controller releases it.
TEST(Excite, EndsForGoodAtAFault) {
  const Scratch scratch;
  const std::string path = calm_scene(scratch, "watchdog: {release_after: 0.2 s}");
  const std::string text =
      text_of(path) + "  faults: [{begin: 1 s, end: 1.05 s, not_a_number: true}]\n";
  const Excited run(scratch.write("fault.yaml", text),
                    {"--duration", "2", "--excite",
                     "pulse,direction=z,force=2,duration=0.1,at=0.3,every=0.2,count=20"});
  const auto& states = run.states;
  ASSERT_EQ(states.size(), 2000u);
  EXPECT_EQ(states[1040].fault, states[1040].status);
  EXPECT_NE(states[1040].fault, 0);
  EXPECT_EQ(states[1900].fault, 0);  // the controller has released it
  // Until 1.05 s nothing is measured, and the state shows the last measurement.
  for (std::size_t i = 1055; i < states.size(); ++i) ASSERT_EQ(states[i].tip_wrench[2], 0) << i;
  EXPECT_EQ(states[380].tip_wrench[2], 2);
}

TEST(Excite, RefusesWhatIsTooMuch) {
  const Scratch scratch;
  const std::string path = calm_scene(scratch);
  const auto said = [&](const std::string& words) {
    const Outcome outcome = run_scene(path, {"--duration", "0.01", "--excite", words});
    EXPECT_EQ(outcome.status, outcome.err.empty() ? 0 : 2) << words;
    return outcome.err;
  };
  EXPECT_EQ(said("pulse,direction=z,force=20,duration=0.5"), "");
  const std::vector<std::pair<std::string, std::string>> cases = {
      {"pulse,direction=z,force=21,duration=0.5", "force has to be from -20 to 20 N"},
      {"pulse,direction=rz,torque=-3.1,duration=0.5", "torque has to be from -3 to 3 N m"},
      {"pulse,direction=z,torque=1,duration=0.5", "a pulse needs force"},
      {"pulse,direction=z,force=1 kg,duration=0.5", "force has a wrong unit"},
      {"pulse,direction=w,force=1,duration=0.5", "direction is x, y, z, rx, ry or rz, not 'w'"},
      {"pulse,force=1,duration=0.5", "a pulse needs direction"},
      {"pulse,direction=z,force=1", "a pulse needs duration"},
      {"pulse,direction=z,force=1,duration=0.5,to=3", "'to' is not a key of a pulse"},
      {"pulse,direction=z,force=1,force=2,duration=0.5", "force is given twice"},
      {"pulse,direction", "KEY=VALUE is wanted, not 'direction'"},
      {"pulse,direction=z,force=1,duration=0.5,every=0.4,count=2", "every has to be from 0.5"},
      {"pulse,direction=z,force=1,duration=0.5,count=2", "a pulse needs every"},
      {"pulse,direction=z,force=1,duration=0.5,every=300,count=3", "has to end within 600 s"},
      {"pulse,direction=z,force=1,duration=5 ms", "duration is below motion.gain_time, 0.01 s"},
      {"chirp,direction=z,force=1,duration=5,from=1,to=20",
       "frequencies above 15.92 Hz do not get through motion.gain_time"},
      {"chirp,direction=z,force=1,duration=5,from=1", "a chirp needs to"},
      {"shake,direction=z", "pulse or chirp is wanted, not 'shake'"}};
  for (const auto& [words, reason] : cases) EXPECT_THAT(said(words), HasSubstr(reason)) << words;
  const Outcome deaf = run_scene(calm_scene(scratch, "feed_forward: {wrench: false}"),
                                 {"--excite", "pulse,direction=z,force=1,duration=0.5"});
  expect_refusal(deaf, "--excite: needs feed_forward.wrench: true");
}

}  // namespace
}  // namespace dashpot::tests
