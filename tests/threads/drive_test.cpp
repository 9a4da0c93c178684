// `dashpot drive` with `dashpot fake-driver`: what it answers, what it refuses, and what becomes of
// a driver's troubles.
#include <dashpot/controller/plugin.h>
#include <dashpot/controller/tick_status.hpp>
#include <dashpot/tests/support/places.hpp>
#include <dashpot/tests/support/sanitized.hpp>
#include <dashpot/tests/threads/drive_arms.hpp>

#include <gmock/gmock.h>

#include <algorithm>
#include <atomic>
#include <cmath>
#include <list>
#include <thread>
#include <tuple>

namespace dashpot::tests {
namespace {

using lcmtypes::DriverKind;
using ::testing::HasSubstr;

class Drive : public AtPace, public ::testing::WithParamInterface<Arm> {
 protected:
  std::vector<std::string> driver(const std::vector<std::string>& more = {}) const {
    std::vector<std::string> words = {"fake-driver", scene(std::string("drivers/") + arm.name),
                                      arm.option,    "--lcm-url",
                                      url,           "--lock-step"};
    words.insert(words.end(), more.begin(), more.end());
    return words;
  }
  std::vector<std::string> drive(const std::string& config,
                                 const std::vector<std::string>& more = {}) const {
    std::vector<std::string> words = {"drive", config, arm.option, "--json", "--lcm-url", url};
    words.insert(words.end(), more.begin(), more.end());
    return words;
  }
  /// Drives the arm while its driver is in trouble; what drive says at its end.
  Json troubled(const std::string& trouble, const std::string& longest_gap = "10 ms",
                const std::string& lasts = "0.1") {
    const Scratch scratch;
    Listener listener(url);
    Running fake(driver({"--trouble", trouble, "--from", "2", "--lasts", lasts}));
    Running driving(drive(changed_configuration(
        scratch, arm, {{"analysis:", "watchdog: {longest_gap: " + longest_gap + "}\nanalysis:"}})));
    seen = listener.until([&] { return listener.states > 100; }, driving);
    if (!seen) return {};
    // The simulated time of the driver.
    listener.until([&] {
      // A command that ends the motion ends the Panda's driver.
      const bool ended = driving.ended() && (arm.kind == DriverKind::kIiwa || fake.ended());
      return ended || listener.state.utime == 0 || listener.states > 4500;
    });
    state = listener.state;
    driving.send(SIGTERM);
    driving.finish();
    fake.send(SIGTERM);
    fake_status = fake.finish();
    fake_said = fake.complaints();
    return Json::parse(driving.output());
  }
  /// Holds the arm, and moves it by commands.
  void hold_and_move();
  /// Neither gaps of a machine that is busy nor old commands end anything.
  std::string patient_configuration(const Scratch& scratch) const {
    return changed_configuration(
        scratch, arm,
        {{"analysis:",
          "commands: {silence: 30 s, oldest: 20 s}\nwatchdog: {longest_gap: 200 ms}\nanalysis:"}});
  }
  /// Whether the program went without time for so long that the loop ended for good reason.
  static bool lost_pace(const Json& summary, const std::vector<state_t>& states) {
    for (const auto late : {controller::Status::kTimeGap, controller::Status::kWrongRate}) {
      if (summary["tick_statuses"].contains(controller::to_text(late))) return true;
    }
    constexpr std::int64_t kLongestGap = 200'000;  // us, of patient_configuration
    return std::adjacent_find(states.begin(), states.end(), [](const auto& a, const auto& b) {
             return b.utime - a.utime > kLongestGap;
           }) != states.end();
  }
  /// Sends the command until the loop has it, as a busy machine may lose a message.
  template <class Done>
  static bool command_until(Listener& listener, const command_t& command, const Done& done) {
    std::int64_t sent = -1;
    return listener.until([&] {
      if (listener.state.commander == 0 && (sent < 0 || listener.states - sent > 500)) {
        sent = listener.states;
        listener.bus().publish(lcmtypes::kCommandChannel, &command);
      }
      return done();
    });
  }

  Arm arm = GetParam();
  std::string url = own_url();
  bool seen = false;
  int fake_status = 0;
  std::string fake_said;
  state_t state{};
};

void Drive::hold_and_move() {
  const Scratch scratch;
  const std::string config = patient_configuration(scratch);
  Listener listener(url);
  Running fake(driver());
  const std::string log = scratch.path("drive.lcm");
  Running driving(drive(config, {"--commands", "--log", log}));
  double first = -1;
  const bool heard = listener.until(
      [&] {
        if (first < 0 && listener.states > 0) {
          first = 0;
          for (const double torque : listener.state.joint_torque) {
            first = std::max(first, std::abs(torque));
          }
        }
        return listener.states > 100;
      },
      driving);
  if (!heard) GTEST_SKIP() << kNoMulticast;
  EXPECT_LT(first, 0.01);  // N m
  const double start = listener.state.joint_position[0];
  const command_t command =
      joint_command(listener.state, listener.state.reference_joint_position[0] + 0.1, 1);
  const bool arrived = command_until(listener, command, [&] {
    return std::abs(listener.state.joint_position[0] - start - 0.1) < 2e-3 &&
           std::abs(listener.state.joint_velocity[0]) < 2e-3 &&
           std::abs(listener.state.reference_joint_position[0] - start - 0.1) < 1e-9;
  });
  driving.send(SIGTERM);
  const Json result = summary_of(driving);
  fake.send(SIGTERM);
  const std::vector<state_t> states = states_of(log);
  if (lost_pace(result, states)) GTEST_SKIP() << kNoPace;
  EXPECT_TRUE(arrived) << listener.state.joint_position[0] - start;
  EXPECT_EQ(fake.finish(), 0) << fake.complaints();
  EXPECT_EQ(result["driver"], std::string(arm.option).substr(2));
  EXPECT_EQ(result["commands_sent"], result["ticks"]);
  EXPECT_EQ(result["faults"], 0);
  EXPECT_NEAR(result["period"].get<double>(), 1e-3, 1e-4);
  EXPECT_EQ(result["commands"]["accepted"], 1);
  EXPECT_EQ(result["modes"].size(), 7u);
  // The first torque acts a period after its status.
  const auto pushed = std::find_if(states.begin(), states.end(),
                                   [](const state_t& one) { return one.joint_torque[0] != 0; });
  ASSERT_GT(states.end() - pushed, 2);
  // Where an answer came late, or a state is missing in the log, the next ticks are others.
  constexpr int kTwoTicks = 2'100;  // us
  if (pushed == states.begin() || pushed[2].utime - pushed->utime > kTwoTicks ||
      pushed->utime - pushed[-1].utime > kTwoTicks / 2) {
    return;
  }
  EXPECT_EQ(pushed[1].joint_position[0], pushed->joint_position[0]);
  EXPECT_NE(pushed[2].joint_position[0], pushed->joint_position[0]);
}

TEST_P(Drive, HoldsTheArmAndMovesItWhereItIsTold) {
  hold_and_move();
}

/// Goals of a scenario, but only from where it starts.
TEST_P(Drive, GoesToTheGoalsOfAScenario) {
  const Scratch scratch;
  const bool iiwa = arm.kind == DriverKind::kIiwa;
  const std::string begin =
      iiwa ? "0, 30 deg, 0, -80 deg, 0, 60 deg, 0" : "0, -45 deg, 0, -135 deg, 0, 90 deg, 45 deg";
  const auto with = [&](const std::string& start) {
    const std::string scenario = "scenario: {duration: 4, start: {position: [" + start +
                                 "]}, steps: [{at: 0.5, joint_position: [0.1" +
                                 begin.substr(begin.find(',')) + "]}]}\n";
    return changed_configuration(
        scratch, arm, {{"analysis:", scenario + "watchdog: {longest_gap: 200 ms}\nanalysis:"}});
  };
  Listener listener(url);
  Running fake(driver());
  const std::string log = scratch.path("drive.lcm");
  {
    Running driving(drive(with("0.3" + begin.substr(begin.find(','))), {"--scenario"}));
    EXPECT_EQ(driving.finish(), 2);
    if (driving.complaints().find("no status") != std::string::npos) {
      GTEST_SKIP() << kNoMulticast;
    }
    EXPECT_THAT(driving.complaints(), HasSubstr("scenario.start.position: joint 1 starts at 0.3"));
  }
  Running driving(drive(with(begin), {"--scenario", "--log", log}));
  const Json result = summary_of(driving);
  fake.send(SIGTERM);
  const std::vector<state_t> states = states_of(log);
  if (lost_pace(result, states)) GTEST_SKIP() << kNoPace;
  EXPECT_EQ(result["ended"], "ended after its time");
  ASSERT_FALSE(states.empty());
  double goal = 0;
  for (const state_t& state : states) goal = std::max(goal, state.reference_joint_position[0]);
  EXPECT_NEAR(goal, 0.1, 1e-9);
}

/// SIGTERM reaches an arm on its way: its torque fades where it stands.
TEST_P(Drive, StopsTheArmBeforeTheTorqueFades) {
  const Scratch scratch;
  const std::string config = patient_configuration(scratch);
  Listener listener(url);
  Running fake(driver());
  const std::string log = scratch.path("drive.lcm");
  Running driving(drive(config, {"--commands", "--log", log}));
  if (!listener.until([&] { return listener.states > 100; }, driving)) GTEST_SKIP() << kNoMulticast;
  const command_t command =
      joint_command(listener.state, listener.state.reference_joint_position[0] + 1, 1);
  const bool moves =
      command_until(listener, command, [&] { return listener.state.joint_velocity[0] > 0.1; });
  driving.send(SIGTERM);
  const Json result = summary_of(driving), ended = result["ended"];
  fake.send(SIGTERM);
  const std::vector<state_t> states = states_of(log);
  if (ended == "ended by the user, without the driver" || lost_pace(result, states)) {
    GTEST_SKIP() << kNoPace;
  }
  ASSERT_TRUE(moves);
  EXPECT_EQ(ended, "ended by the user");
  const auto stops = std::find_if(states.begin(), states.end(), [](const state_t& one) {
    return one.status == DASHPOT_SETPOINT_LOST;
  });
  ASSERT_NE(stops, states.end());
  const double way = states.back().joint_position[0] - stops->joint_position[0];
  const double speed = stops->joint_velocity[0];
  if (speed > 0.15) GTEST_SKIP() << kNoPace;  // this test heard of the motion late
  EXPECT_LT(std::abs(way), 0.02) << "from " << speed << " rad/s";
  double fastest = 0;
  for (const state_t& one : states) {
    const bool fades = one.utime > states.back().utime - 190'000;
    if (fades) fastest = std::max(fastest, std::abs(one.joint_velocity[0]));
  }
  EXPECT_LT(fastest, 0.01);
  EXPECT_GT(stops->joint_velocity[0], 0.05);
}

/// Other arms behind the same drivers.
class DriveToo : public Drive {};
using DriveOfAnIiwa = AtPace;
using DriveOfAPanda = AtPace;
TEST_P(DriveToo, HoldsTheArmAndMovesItWhereItIsTold) {
  hold_and_move();
}
INSTANTIATE_TEST_SUITE_P(Arms, DriveToo, ::testing::Values(kIiwa7, kFr3),
                         [](const auto& given) { return std::string(given.param.name); });

TEST_P(Drive, CommandsNothingInADryRun) {
  Listener listener(url);
  Running fake(driver());
  Running driving(drive(configuration(arm.name), {"--dry-run"}));
  if (!listener.until([&] { return listener.states > 100 && listener.modes_messages > 0; },
                      driving)) {
    GTEST_SKIP() << kNoMulticast;
  }
  EXPECT_EQ(listener.modes.num_modes, 7);
  driving.send(SIGTERM);
  EXPECT_EQ(summary_of(driving)["commands_sent"], 0);
  fake.send(SIGTERM);
  EXPECT_EQ(fake.finish(), 0);
  EXPECT_THAT(fake.output(), HasSubstr("commands: 0,"));
}

TEST_P(Drive, RefusesALoopThatIsNotTheDrivers) {
  const Scratch scratch;
  const bool iiwa = arm.kind == DriverKind::kIiwa;
  const auto refusal = [&](const std::string& from, const std::string& to) {
    const Outcome outcome = run_program(drive(changed_configuration(scratch, arm, {{from, to}})));
    EXPECT_EQ(outcome.status, 2);
    EXPECT_EQ(outcome.out, "");
    return outcome.err;
  };
  EXPECT_THAT(refusal("gravity: false", "gravity: true"),
              HasSubstr("feed_forward.gravity: must be false"));
  EXPECT_THAT(refusal("robot:\n", "robot:\n  gravity: [0, 0, 9.81]\n"),
              HasSubstr("robot.gravity: is not along -z of the base"));
  EXPECT_THAT(refusal("delay: 1", "delay: 0"), HasSubstr("analysis.sampled.delay: must be"));
  EXPECT_THAT(
      refusal(iiwa ? ", difference_velocity: true" : ", cutoff: 27.484 Hz", ""),
      HasSubstr(iiwa ? "difference_velocity: must be true" : "cutoff: must be the cutoff of"));
  // Dampers that are too strong for the wrist are refused before the first torque.
  EXPECT_THAT(refusal("damping_ratio: 0.8", "damping: [20, 20, 10, 10, 20, 10, 4]"),
              HasSubstr("gain margin"));
}

TEST_P(Drive, RefusesADriverOfAnotherPeriod) {
  const Scratch scratch;
  Running fake(driver());
  const Outcome outcome =
      run_program(drive(changed_configuration(scratch, arm, {{"period: 1 ms", "period: 2 ms"}}),
                        {"--duration", "0.1"}));
  EXPECT_EQ(outcome.status, 2) << outcome.err;
  EXPECT_THAT(outcome.err, HasSubstr("control.period: is 2 ms, but the driver's statuses come"));
}

/// Publishes commands of somebody else until `driving` ends, which complains of them.
void command_as_well(const Arm& arm, const std::string& url, Running& driving) {
  const auto bus = lcmtypes::open_bus(url);
  std::vector<std::uint8_t> bytes;
  lcmtypes::DriverCommand command;
  command.torque = controller::JointVector::Zero(7);
  if (arm.kind == DriverKind::kIiwa) command.position = command.torque;
  for (const auto end = Clock::now() + kHang; !driving.ended() && Clock::now() < end;) {
    command.utime = utime();
    encode(arm.kind, command, bytes);
    bus->publish(lcmtypes::profile_of(arm.kind).command_channel, bytes.data(),
                 static_cast<unsigned>(bytes.size()));
    usleep(5000);
  }
}

/// Statuses of an arm without a simulation, every millisecond: it trembles about one posture.
class TremblingArm {
 public:
  /// With `fixed`, the driver commands that posture; otherwise what it measures.
  TremblingArm(const Arm& arm, const std::string& url, double tremble, bool fixed)
      : thread_([this, arm, url, tremble, fixed] {
          const auto bus = lcmtypes::open_bus(url);
          std::vector<std::uint8_t> bytes;
          controller::JointVector posture = controller::JointVector::Zero(7);
          posture[1] = 0.5;
          posture[3] = -1.4;
          posture[5] = 1;
          lcmtypes::DriverStatus status;
          status.velocity = controller::JointVector::Zero(7);
          if (fixed) status.commanded = posture;
          for (status.utime = 1'000'000; !done_; status.utime += 1000) {
            status.position = posture.array() + (status.utime % 2000 == 0 ? tremble : -tremble);
            encode(arm.kind, status, bytes);
            bus->publish(lcmtypes::profile_of(arm.kind).status_channel, bytes.data(),
                         static_cast<unsigned>(bytes.size()));
            usleep(1000);
          }
        }) {}
  ~TremblingArm() {
    done_ = true;
    thread_.join();
  }

 private:
  std::atomic<bool> done_ = false;
  std::thread thread_;
};

TEST_P(Drive, RefusesToBeASecondCommander) {
  // The fake driver would die of commands this early: its statuses are sent by another program.
  Running driving(drive(configuration(arm.name)));
  {
    const TremblingArm trembling(arm, url, 0, false);
    command_as_well(arm, url, driving);
  }
  driving.send(SIGTERM);
  const int status = driving.finish();
  if (status == 0) GTEST_SKIP() << kNoMulticast;
  EXPECT_EQ(status, 2);
  EXPECT_THAT(driving.complaints(), HasSubstr("somebody else commands on"));
  EXPECT_EQ(driving.output(), "");
}

TEST_P(Drive, StopsCommandingWhenSomebodyElseBegins) {
  Listener listener(url);
  Running fake(driver());
  Running driving(drive(configuration(arm.name)));
  if (!listener.until([&] { return listener.states > 100; }, driving)) GTEST_SKIP() << kNoMulticast;
  command_as_well(arm, url, driving);
  EXPECT_EQ(driving.finish(), 1);
  EXPECT_THAT(driving.complaints(), HasSubstr("nothing more is sent"));
  EXPECT_THAT(Json::parse(driving.output())["ended"].get<std::string>(),
              HasSubstr("somebody else commands on"));
}

TEST_P(Drive, LatchesAfterAGap) {
  const Json result = troubled("stall");
  if (!seen) GTEST_SKIP() << kNoMulticast;
  EXPECT_EQ(result["faults"], 1);
  EXPECT_EQ(result["fault"]["status"], "gap between states, damping") << result.dump(2);
  EXPECT_GE(result["statuses"]["lost"].get<int>(), 90);
}

/// No status is answered twice, and of reordered ones the newer, which are too few for the loop.
TEST_P(Drive, AnswersNoStatusTwiceAndTheNewerOfReorderedOnes) {
  for (const bool reorder : {false, true}) {
    // Not the gaps of a machine that is busy.
    const Json result =
        reorder ? troubled("reorder", "200 ms") : troubled("repeat", "10 ms", "0.2");
    if (!seen) GTEST_SKIP() << kNoMulticast;
    const Json& statuses = result["statuses"];
    EXPECT_GE(statuses["repeated"].get<int>() + statuses["overtaken"].get<int>(),
              reorder ? 40 : 100);
    EXPECT_EQ(fake_status, 0) << fake_said;
    if (reorder) {
      EXPECT_EQ(result["faults"], 1);
      EXPECT_EQ(result["fault"]["status"], "loop at the wrong rate, damping") << result.dump(2);
    } else {
      EXPECT_EQ(result["commands_sent"], result["ticks"]);
    }
  }
}

INSTANTIATE_TEST_SUITE_P(Arms, Drive, ::testing::Values(kIiwa, kPanda), [](const auto& given) {
  return std::string(given.param.option).substr(2);
});

/// A drive whose driver commands one posture, or what it measures, and what drive says of it.
struct Watched {
  bool fixed;
  std::string option = "--json", config = configuration("iiwa14");
  int status = 0;
  std::string said = {}, table = {};
};

/// All of them side by side, until each has begun or ended.
void watch(std::vector<Watched>& all) {
  std::list<Running> drives;
  std::list<TremblingArm> arms;
  std::vector<std::string> urls;
  for (const Watched& one : all) {
    const auto number = 4 * getpid() + static_cast<int>(urls.size());  // a bus of its own
    urls.push_back("udpm://239.255.76.67:" + std::to_string(50'000 + number % 15'000) + "?ttl=0");
    drives.emplace_back(std::vector<std::string>{"drive", one.config, "--iiwa", "--lcm-url",
                                                 urls.back(), one.option});
  }
  for (std::size_t i = 0; i < all.size(); ++i) {
    arms.emplace_back(kIiwa, urls[i], 1e-6, all[i].fixed);
  }
  for (Running& drive : drives) {
    const auto end = Clock::now() + kHang;
    while (drive.complaints().empty() && !drive.ended() && Clock::now() < end) usleep(10'000);
  }
  usleep(100'000);
  for (const Running& drive : drives) drive.send(SIGTERM);
  auto drive = drives.begin();
  for (Watched& one : all) {
    one.status = drive->finish();
    one.said = drive->complaints();
    one.table = drive++->output();
  }
}

/// Gains with which Drake's iiwa keeps its margin at 1 ms, rings at 5 ms, and loses its margin with
/// more damping of the wrist. No driver runs: they are judged before the first status.
TEST_F(DriveOfAnIiwa, JudgesGainsForThePeriod) {
  const Scratch scratch;
  struct Judged {
    const char *period, *wrist;
    int status;
    const char* said;
  };
  const char* const refused = "the sampled loop has a gain margin of 0.";
  const Judged all[] = {{"1 ms", "5, 1, 0.1", 0, "no status on IIWA_STATUS"},
                        {"5 ms", "5, 1, 0.1", 2, refused},
                        {"1 ms", "20, 10, 4", 2, refused}};
  for (const Judged& one : all) {
    SCOPED_TRACE(std::string(one.period) + ", " + one.wrist);
    const std::string config = changed_configuration(
        scratch, kIiwa,
        {{"period: 1 ms", std::string("period: ") + one.period},
         {"[150, 150, 100, 100, 40, 20, 8]", "[600, 600, 600, 400, 100, 50, 10]"},
         {"damping_ratio: 0.8", std::string("damping: [60, 60, 50, 40, ") + one.wrist + "]"}});
    Running driving({"drive", config, "--iiwa", "--lcm-url", own_url()});
    const auto waits = [&] { return driving.complaints().find("no status") != std::string::npos; };
    while (!waits() && !driving.ended()) usleep(10'000);
    if (waits()) driving.send(SIGTERM);
    EXPECT_EQ(driving.finish(), one.status);
    EXPECT_THAT(driving.complaints(), HasSubstr(one.said));
  }
}

TEST_F(DriveOfAnIiwa, RefusesSpringsOfKukas) {
  const Scratch scratch;
  const std::string stiff = changed_configuration(
      scratch, kIiwa,
      {{"analysis:",
        "environment: {joint_stiffness: 100 N m/rad, joint_damping: 1 N m s/rad}\nanalysis:"}});
  std::vector<Watched> all = {{true}, {true, "--json", stiff}, {true, "--dry-run"}, {false}};
  watch(all);
  const auto& [springs, stiffness, dry, none] = std::tie(all[0], all[1], all[2], all[3]);
  if (springs.status == 0) GTEST_SKIP() << kNoMulticast;
  EXPECT_EQ(springs.status, 2);
  EXPECT_THAT(springs.said, HasSubstr("KUKA's mode Torque"));
  EXPECT_THAT(springs.said, ::testing::Not(HasSubstr("the arm is held")));
  EXPECT_EQ(stiffness.status, 2);
  EXPECT_THAT(stiffness.said,
              HasSubstr("environment.joint_stiffness must be 0 in KUKA's mode Torque"));
  EXPECT_EQ(dry.status, 0);
  EXPECT_THAT(dry.table, HasSubstr("dry run: nothing was commanded"));
  EXPECT_THAT(dry.table, HasSubstr("  modes, rad/s (ratio): "));
  EXPECT_THAT(dry.said, HasSubstr("KUKA's mode Torque"));
  EXPECT_EQ(none.status, 0);
  EXPECT_THAT(none.said, HasSubstr("the arm is held where it is"));
  EXPECT_THAT(none.said, ::testing::Not(HasSubstr("KUKA's mode Torque")));
}

/// Springs of KUKA's that commands lead to where the arm is hold nothing, and damp.
TEST_F(DriveOfAnIiwa, CountsWhatSpringsOfKukasDamp) {
  // So small that the simulated loop, whose springs act from period to period, tolerates them.
  const std::string springs = "[1000, 1000, 1000, 500, 100, 20, 5]";  // N m/rad
  const std::string dampers = "[4, 4, 2, 2, 0.3, 0.1, 0.01]";         // N m s/rad
  const std::string in_all = "[5, 5, 3, 2.5, 0.4, 0.12, 0.015]";      // and a period's lag
  const Scratch scratch;
  std::string robot = text_of(scene("drivers/iiwa14"));
  robot.replace(robot.find("../.."), 5, std::string(DASHPOT_SOURCE_DIR) + "/sim");
  robot = scratch.write("robot.yaml", robot + "environment: {joint_stiffness: " + springs +
                                          ", joint_damping: " + dampers + "}\n");
  // A command acts a period after its status.
  const std::string config = changed_configuration(
      scratch, kIiwa,
      {{"damping_ratio: 0.8", "damping: [20, 20, 10, 10, 1.5, 0.7, 0.15]"},   // so that it rings
       {"viscous_friction: 0 N m s/rad", "viscous_friction: 0.5 N m s/rad"},  // the simulated arm's
       {"analysis:",
        "motion: {gain_time: 10 ms}\nenvironment: {joint_damping: " + in_all + "}\nanalysis:"}});
  const std::string url = own_url();
  Running fake({"fake-driver", robot, "--iiwa", "--lcm-url", url, "--lock-step"});
  Running driving({"drive", config, "--iiwa", "--json", "--lcm-url", url, "--log",
                   scratch.path("log"), "--excite", "pulse,direction=y,force=5,duration=0.1,at=0.2",
                   "--duration", "1.5"});
  const int status = driving.finish();
  fake.send(SIGTERM);
  fake.finish();
  if (driving.complaints().find("no status") != std::string::npos) {
    GTEST_SKIP() << kNoMulticast;
  }
  ASSERT_EQ(status, 0) << driving.complaints();
  const Json result = Json::parse(driving.output());
  const Json found = result["identified"];
  // Another program may have had the processor too long for a decay to be whole.
  if (result["statuses"]["lost"].get<int>() > 0) return;
  EXPECT_GE(found["difference"].size(), 2u) << found.dump(1);
  for (const Json& one : found["difference"]) {
    const Json& mode = found["modes"][one["measured"].get<std::size_t>()];
    const double frequency = mode["natural_frequency"];
    EXPECT_LT(std::abs(one["natural_frequency"].get<double>()), 0.01 * frequency) << one;
    EXPECT_LT(std::abs(one["damping_ratio"].get<double>()), 0.01) << one;
  }
}

TEST_F(DriveOfAPanda, WaitsForTheNextDriverAfterOneThatDied) {
  const std::string url = own_url();
  const std::vector<std::string> words = {"fake-driver", scene("drivers/panda"), "--panda",
                                          "--lcm-url", url};
  Listener listener(url);
  Running driving({"drive", configuration("panda"), "--panda", "--json", "--lcm-url", url});
  Running first(words);
  if (!listener.until([&] { return listener.states > 20; }, driving)) {
    GTEST_SKIP() << (driving.ended() ? kNoPace : kNoMulticast);
  }
  first.send(SIGKILL);
  EXPECT_EQ(first.finish(), 128 + SIGKILL);
  const auto waits = [&] {  // for a driver, and has said so since the arm was held
    const std::string said = driving.complaints(), held = "the arm is held where it is";
    return said.find("no status on PANDA_STATUS for 2 s", said.find(held)) != std::string::npos;
  };
  EXPECT_TRUE(listener.until(waits));
  Running next(words);
  EXPECT_TRUE(listener.until([&] { return listener.state.fault != 0; }));
  driving.send(SIGTERM);
  const Json result = summary_of(driving);
  EXPECT_EQ(result["ended"], "ended by the user");
  EXPECT_EQ(result["fault"]["status"], "gap between states, damping");
  EXPECT_GE(result["statuses"]["awaited"].get<int>(), 100);
}

TEST_F(DriveOfAPanda, DoesNotAnswerARobotThatHasStopped) {
  const std::string url = own_url();
  Listener listener(url);
  Running fake({"fake-driver", scene("drivers/panda"), "--panda", "--lcm-url", url, "--lock-step",
                "--trouble", "user-stop", "--from", "2", "--lasts", "0.1"});
  const Scratch scratch;
  const std::string config = changed_configuration(
      scratch, kPanda,
      {{"analysis:",  // no fault but the gap, also where a busy machine makes the loop slow
        "watchdog: {feedback: 0}\nanalysis:"}});
  Running driving({"drive", config, "--panda", "--json", "--lcm-url", url});
  if (!listener.until([&] { return listener.states > 100; }, driving)) GTEST_SKIP() << kNoMulticast;
  const auto says = [&](const char* what) {
    return driving.complaints().find(what) != std::string::npos;
  };
  EXPECT_TRUE(listener.until([&] {
    return says("the robot has stopped by itself (robot_mode 5)");
  })) << driving.complaints();
  // The robot goes on. What is heard may lie any time behind it: only a fault says that it did.
  EXPECT_TRUE(listener.until([&] { return listener.state.fault != 0; }));
  driving.send(SIGTERM);
  const Json result = summary_of(driving);
  EXPECT_GE(result["statuses"]["of_stopped_robot"].get<int>(), 50);
  EXPECT_EQ(result["fault"]["status"], "gap between states, damping");
  EXPECT_THAT(driving.complaints(), HasSubstr("the robot has stopped by itself (robot_mode 5)"));
}

}  // namespace
}  // namespace dashpot::tests
