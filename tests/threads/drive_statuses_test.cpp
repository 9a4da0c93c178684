// Commands of `dashpot drive` to a driver whose statuses are written by hand: at its end, after a
// pause, and after wrong statuses.
#include <dashpot/tests/support/sanitized.hpp>
#include <dashpot/tests/threads/drive_arms.hpp>

#include <gmock/gmock.h>

#include <algorithm>
#include <cmath>
#include <limits>

namespace dashpot::tests {
namespace {

using controller::JointVector;
using lcmtypes::DriverCommand;
using lcmtypes::DriverKind;
using lcmtypes::DriverStatus;
using ::testing::HasSubstr;

constexpr double kRate = 500;  // N m/s, of the configurations

/// A driver without an arm: each status is what the test says, and is followed by its answer.
class StatusWriter {
 public:
  StatusWriter(const Arm& arm, const std::string& url)
      : kind_(arm.kind), bus_(lcmtypes::open_bus(url)) {
    bus_->subscribe(lcmtypes::profile_of(kind_).command_channel, &StatusWriter::take, this);
    next.utime = 1'000'000;  // by a clock of its own
    next.position = next.velocity = JointVector::Zero(7);
    if (kind_ == DriverKind::kIiwa) {
      next.position << 0, 0.6, 0, -1.75, 0, 1, 0;
    } else {
      next.position << 0, -0.8, 0, -2.4, 0, 1.6, 0.8;
    }
    next.robot_mode = 2;
  }

  /// The next status, a millisecond after the last one, with some bit changed. Returns true if its
  /// command came within `patience`, ms.
  bool step(int patience) {
    next.utime += 1000;
    if (!frozen) next.position[6] += next.utime % 2000 == 0 ? 1e-13 : -1e-13;
    return send(next, patience);
  }
  bool send(const DriverStatus& status, int patience) {
    encode(kind_, status, bytes_);
    bus_->publish(lcmtypes::profile_of(kind_).status_channel, bytes_.data(),
                  static_cast<unsigned>(bytes_.size()));
    const auto end = Clock::now() + std::chrono::milliseconds(patience);
    const auto answered = [&] {
      return !commands.empty() && commands.back().utime == status.utime;
    };
    while (!answered() && Clock::now() < end) bus_->handleTimeout(1);
    return answered();
  }
  /// Statuses until one is answered, false where none is until a hang is sure. As soon as there are
  /// answers at all, each is given `patience`, ms: of a program that is slow for a moment (a
  /// sanitizer) ten would pass unanswered otherwise, which is a fault.
  bool until_answered(int patience = 100) {
    const auto end = Clock::now() + kHang;
    while (!step(heard_ ? patience : 2)) {
      if (Clock::now() > end) return false;
    }
    return true;
  }
  /// Forgets the commands, those to come for statuses before too.
  void forget() {
    while (bus_->handleTimeout(100) > 0) {
    }
    commands.clear();
  }
  /// Statuses that may be answered late, or on a busy machine not at all.
  void steps(int count) {
    for (int k = 0; k < count; ++k) step(100);
  }

  /// The next status, with the time of day and at it.
  bool step_in_time() {
    next.utime = std::max(next.utime + 1000, utime() / 1000 * 1000);
    while (utime() < next.utime) usleep(50);
    return send(next, 1);
  }

  DriverStatus next;
  bool frozen = false;
  std::vector<DriverCommand> commands;

 private:
  void take(const lcm::ReceiveBuffer* buffer, const std::string&) {
    heard_ = true;
    commands.emplace_back();
    if (!decode(kind_, buffer->data, buffer->data_size, commands.back())) commands.pop_back();
  }

  DriverKind kind_;
  bool heard_ = false;
  std::shared_ptr<lcm::LCM> bus_;
  std::vector<std::uint8_t> bytes_;
};

class DriveStatuses : public AtPace, public ::testing::WithParamInterface<Arm> {
 protected:
  void SetUp() override {
    AtPace::SetUp();
    if (IsSkipped()) return;
    if (!writer.until_answered()) GTEST_SKIP() << kNoMulticast;
  }
  double greatest_torque() const { return writer.commands.back().torque.cwiseAbs().maxCoeff(); }
  /// Ends the program, whose last commands still need statuses; what it says.
  Json end() {
    driving.send(SIGTERM);
    while (writer.step(20)) {
    }
    return summary_of(driving);
  }
  /// The program ends by itself and names `status`; one tick had the status `once`.
  void ends(const std::string& status, const std::string& once) {
    const auto end = Clock::now() + kHang;
    while (!driving.ended() && Clock::now() < end) writer.step(100);
    driving.send(SIGTERM);  // for the case that it goes on
    EXPECT_EQ(driving.finish(), 1);
    const Json result = Json::parse(driving.output());
    for (const std::string& said : {driving.complaints(), result["ended"].get<std::string>()}) {
      EXPECT_THAT(said, HasSubstr(status));
      EXPECT_THAT(said, HasSubstr("nothing more is sent"));
    }
    if (!once.empty()) EXPECT_EQ(result["tick_statuses"][once], 1) << result.dump(2);
    for (const DriverCommand& one : writer.commands) EXPECT_TRUE(one.torque.allFinite());
    const DriverCommand& last = writer.commands.back();
    EXPECT_TRUE(last.torque.size() == 7 && last.torque.isZero(0)) << last.torque.transpose();
    const bool panda = arm.kind == DriverKind::kPanda;
    EXPECT_EQ(last.control_mode, panda ? 0 : 4);  // the Panda's driver ends at another one
    if (!panda) EXPECT_TRUE(last.position.allFinite());
  }
  /// After some statuses that were answered.
  void begin() {
    writer.steps(20);
    writer.forget();
  }

  Arm arm = GetParam();
  std::string url = own_url();
  Scratch scratch;
  std::string log = scratch.path("drive.lcm");
  Running driving{
      {"drive", configuration(arm.name), arm.option, "--json", "--lcm-url", url, "--log", log}};
  StatusWriter writer{arm, url};
};

TEST_P(DriveStatuses, TheTorqueFadesBeforeTheEnd) {
  for (int k = 0; k < 200; ++k) {  // pushed away slowly: the springs pull
    writer.next.position[0] += 2e-4;
    writer.next.velocity[0] = 0.2;
    writer.step(100);
  }
  writer.next.velocity.setZero();
  writer.steps(200);
  const double pull = greatest_torque();
  EXPECT_GT(pull, 1);  // N m
  writer.forget();
  driving.send(arm.kind == DriverKind::kIiwa ? SIGTERM : SIGHUP);
  for (int silent = 0; silent < 20;) {
    writer.next.utime += 2000;  // 3 ms each: on a busy machine it does not wait for ever
    silent = writer.step(20) ? 0 : silent + 1;
  }
  EXPECT_EQ(summary_of(driving)["ended"], "ended by the user");
  ASSERT_GT(writer.commands.size(), 50u);
  double before = pull;
  std::int64_t then = writer.commands.front().utime - 1000;
  for (const DriverCommand& command : writer.commands) {
    const double now = command.torque.cwiseAbs().maxCoeff();
    EXPECT_LE(now, before + 0.05);
    EXPECT_LE(std::abs(now - before),
              kRate * 1e-6 * static_cast<double>(command.utime - then) + 1e-9);
    before = now;
    then = command.utime;
  }
  EXPECT_EQ(before, 0);  // this is what the driver holds until the command expires
}

TEST_P(DriveStatuses, AnArmThatNeedsItsBrakesEndsIt) {
  begin();
  writer.next.velocity[0] = 1.5;
  for (int k = 0; k < 100; ++k) {  // the springs pull, and what damps ends as the motion does
    writer.next.position[0] += 1.5e-3;
    writer.step(100);
  }
  writer.frozen = true;
  ends("state frozen", "state frozen, holding the weight");
}

TEST_P(DriveStatuses, AnArmWhoseStateIsLostForLongEndsIt) {
  begin();
  const JointVector place = writer.next.position;
  writer.next.position.setConstant(std::numeric_limits<double>::quiet_NaN());
  writer.steps(5);
  writer.next.position = place;
  writer.steps(5);
  EXPECT_FALSE(driving.ended());  // a few do not count as a fault
  writer.next.position.setConstant(std::numeric_limits<double>::quiet_NaN());
  ends("state not finite", "");
}

TEST_P(DriveStatuses, ADriverThatWasRestartedIsNotAnsweredAtOnce) {
  begin();
  if (arm.kind == DriverKind::kIiwa) {
    const DriverStatus last = writer.next;
    writer.next.utime = -1;
    for (int k = 0; k < 200; ++k) writer.send(writer.next, 1);
    writer.next.utime = last.utime + 200'000;
  } else {
    writer.next.utime += 400'000;
  }
  const std::int64_t began = writer.next.utime + 1000;
  writer.next.position[0] += 0.05;
  ASSERT_TRUE(writer.until_answered(1));
  EXPECT_GE(writer.commands.front().utime - began, 300'000);
  writer.steps(20);
  EXPECT_LT(greatest_torque(), 1e-9);  // the springs have ended, and the arm is at rest
  const Json result = end();
  EXPECT_EQ(result["fault"]["status"], "gap between states, damping");
  EXPECT_GE(result["statuses"]["awaited"].get<int>(), 100);
  EXPECT_THAT(driving.complaints(), HasSubstr("a fault has latched, the arm is damped: gap"));
}

TEST_P(DriveStatuses, AClockThatGoesBackEndsIt) {
  begin();
  writer.next.utime -= 900'000;
  for (int k = 0; k < 2000; ++k) {
    writer.step(1);
    if (driving.complaints().find("clock") != std::string::npos) break;
  }
  driving.send(SIGTERM);  // for the case that it goes on
  EXPECT_EQ(writer.commands.size(), 0u);
  EXPECT_EQ(driving.finish(), 1);
  EXPECT_THAT(driving.complaints(), HasSubstr("the driver's clock has gone back by 0."));
}

/// Neither is answered nor believed, and the next one is as if there had been none.
TEST_P(DriveStatuses, OthersThanOfThisArmAreNotAnswered) {
  begin();
  DriverStatus other = writer.next;
  other.utime = std::numeric_limits<std::int64_t>::max();
  EXPECT_FALSE(writer.send(other, 50));
  for (const int joints : {1, 6, 8, 16}) {
    other.utime = writer.next.utime + 500;
    other.position = other.velocity = JointVector::Zero(joints);
    EXPECT_FALSE(writer.send(other, 50)) << joints;
  }
  ASSERT_TRUE(writer.until_answered());
  EXPECT_EQ(writer.commands.back().torque.size(), 7);
  // The Panda's driver lets a command expire by its own clock: it has the time of its status.
  for (const DriverCommand& command : writer.commands) {  // on a busy machine an earlier status
    EXPECT_EQ(command.utime % 1000, 0);
    EXPECT_GT(command.utime, 1'000'000);
    EXPECT_LE(command.utime, writer.next.utime);
  }
  const Json result = end();
  EXPECT_EQ(result["statuses"]["unreadable"], 5);
  EXPECT_EQ(result["faults"], 0);
}

/// As the iiwa's are differenced here: over the time that has passed since the last position.
TEST_P(DriveStatuses, VelocitiesAfterPositionsThatAreNoNumbers) {
  const double velocity = 0.1;  // rad/s
  const auto move = [&](int count) {
    for (int k = 0; k < count; ++k) {
      writer.next.position[0] += 1e-3 * velocity;
      writer.next.velocity[0] = velocity;
      writer.step(100);
    }
  };
  move(50);
  const DriverStatus good = writer.next;
  for (int k = 0; k < 8; ++k) {
    writer.next.position.setConstant(std::numeric_limits<double>::quiet_NaN());
    writer.step(100);
  }
  writer.next.position = good.position;
  writer.next.position[0] += 8e-3 * velocity;
  move(50);
  end();
  double fastest = 0;
  for (const state_t& state : states_of(log)) {
    fastest = std::max(fastest, std::abs(state.joint_velocity[0]));
  }
  EXPECT_GT(fastest, 0.9 * velocity);
  EXPECT_LT(fastest, 1.1 * velocity);
}

/// kuka_driver ends at 12 N m of the sixth joint.
TEST_P(DriveStatuses, AnExternalTorqueNearTheDriversLimitIsTold) {
  writer.next.external = JointVector::Zero(7);
  writer.next.external[5] = 9.5;
  writer.steps(20);
  EXPECT_THAT(driving.complaints(), ::testing::Not(HasSubstr("external torque")));
  writer.next.external[5] = -9.7;
  writer.steps(20);
  const Json result = end();
  const auto told = HasSubstr("joint 6: external torque -9.7 N m; the driver stops at 12 N m");
  if (arm.kind == DriverKind::kIiwa) {
    EXPECT_THAT(driving.complaints(), told);
  } else {  // libfranka's limits are the robot's own business
    EXPECT_THAT(driving.complaints(), ::testing::Not(HasSubstr("external torque")));
  }
  EXPECT_EQ(result["external_torque"][5], 9.7);
}

INSTANTIATE_TEST_SUITE_P(Arms, DriveStatuses, ::testing::Values(kIiwa, kPanda),
                         [](const auto& given) {
                           return std::string(given.param.option).substr(2);
                         });

/// A status that waited because the program was kept from running.
TEST(DriveInTime, AStatusOlderThanTwoPeriodsIsNotAnswered) {
  for (const Arm& arm : {kIiwa, kPanda}) {
    const std::string url = own_url();
    Running driving({"drive", configuration(arm.name), arm.option, "--json", "--lcm-url", url});
    StatusWriter writer(arm, url);
    const auto until_answered = [&] {
      const auto end = Clock::now() + kHang;
      while (!writer.step_in_time()) {
        if (Clock::now() > end) return false;
      }
      return true;
    };
    if (!until_answered()) GTEST_SKIP() << kNoMulticast;
    for (int k = 0; k < 50; ++k) writer.step_in_time();
    writer.forget();
    ASSERT_TRUE(until_answered());
    writer.forget();
    driving.send(SIGSTOP);
    usleep(1000);
    EXPECT_FALSE(writer.step_in_time());
    usleep(20'000);
    driving.send(SIGCONT);
    EXPECT_FALSE(writer.send(writer.next, 50));  // repeated, which is not answered either
    ASSERT_TRUE(until_answered());
    driving.send(SIGTERM);
    while (!driving.ended()) writer.step_in_time();
    EXPECT_GE(Json::parse(driving.output())["statuses"]["late"].get<int>(), 1);
  }
}

}  // namespace
}  // namespace dashpot::tests
