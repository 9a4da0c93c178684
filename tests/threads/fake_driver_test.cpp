// `dashpot fake-driver` by itself: whether it behaves as the public drivers do.
#include <dashpot/tests/threads/drive_arms.hpp>

#include <gmock/gmock.h>

#include <algorithm>
#include <cmath>
#include <numbers>

namespace dashpot::tests {
namespace {

using controller::JointVector;
using lcmtypes::DriverCommand;
using lcmtypes::DriverKind;
using lcmtypes::DriverStatus;
using ::testing::HasSubstr;

/// A fake driver, and who hears its statuses and commands torques.
class Commanded {
 public:
  Commanded(const Arm& arm, const std::vector<std::string>& more)
      : kind_(arm.kind), bus_(lcmtypes::open_bus(url_)) {
    bus_->subscribe(lcmtypes::profile_of(kind_).status_channel, &Commanded::take, this)
        ->setQueueCapacity(0);  // none is lost
    std::vector<std::string> words = {"fake-driver", scene(std::string("drivers/") + arm.name),
                                      arm.option, "--lcm-url", url_};
    words.insert(words.end(), more.begin(), more.end());
    fake_.emplace(words);
  }

  /// Waits for so many statuses more; false if one does not come before a hang is sure.
  bool hear(std::size_t count = 1) {
    for (const std::size_t wanted = heard.size() + count; heard.size() < wanted;) {
      if (bus_->handleTimeout(std::chrono::milliseconds(kHang).count()) <= 0) return false;
    }
    return true;
  }
  /// Answers the last status.
  void answer(const JointVector& torque) {
    const DriverStatus& last = heard.back();
    DriverCommand command;
    command.utime = last.utime;
    command.torque = torque;
    if (kind_ == DriverKind::kIiwa) command.position = last.position;
    encode(kind_, command, bytes_);
    bus_->publish(lcmtypes::profile_of(kind_).command_channel, bytes_.data(),
                  static_cast<unsigned>(bytes_.size()));
  }
  /// Waits for, and answers, so many statuses.
  bool answer(int count, const JointVector& torque) {
    for (int k = 0; k < count; ++k) {
      if (!hear()) return false;
      answer(torque);
    }
    return true;
  }
  /// Hears what is still on its way, so that a driver in lock-step waits for one answer at a time.
  void catch_up() {
    while (bus_->handleTimeout(200) > 0) {
    }
  }
  std::string complaints() const { return fake_->complaints(); }

  std::vector<DriverStatus> heard;

 private:
  void take(const lcm::ReceiveBuffer* buffer, const std::string&) {
    heard.emplace_back();
    if (!decode(kind_, buffer->data, buffer->data_size, heard.back())) heard.pop_back();
  }

  std::string url_ = own_url();
  DriverKind kind_;
  std::shared_ptr<lcm::LCM> bus_;
  std::vector<std::uint8_t> bytes_;
  std::optional<Running> fake_;
};

class FakeDrivers : public ::testing::TestWithParam<Arm> {};

/// A command acts a period after its status; a Panda's through what libfranka does to torques.
TEST_P(FakeDrivers, PutOutWhatWasCommanded) {
  const Arm arm = GetParam();
  Commanded driver(arm, {"--lock-step"});
  if (!driver.hear(320)) GTEST_SKIP() << kNoMulticast;
  JointVector torque = JointVector::Zero(7);
  ASSERT_TRUE(driver.answer(20, torque)) << driver.complaints();  // from now on in lock-step
  driver.catch_up();  // or two commands might meet in one period
  const std::size_t asked = driver.heard.size() - 1;
  torque[0] = 0.5;
  driver.answer(torque);
  ASSERT_TRUE(driver.answer(29, torque)) << driver.complaints();
  torque[0] = 20;
  ASSERT_TRUE(driver.answer(30, torque)) << driver.complaints();
  ASSERT_TRUE(driver.hear());
  // libfranka: lowpassFilter and limitRate, 30 Hz and 1000 N m/s
  const double gain = 1e-3 / (1e-3 + 1 / (2 * std::numbers::pi * 30));
  double expected = 0;
  std::size_t first = asked;  // that shows a command: one or two later, as the bus delivers
  while (first < asked + 4 && driver.heard[first].torque[0] == 0) ++first;
  EXPECT_GE(first, asked + 1);
  while (driver.heard.size() < first + 58) {  // the bus may show some later
    driver.answer(torque);
    ASSERT_TRUE(driver.hear()) << driver.complaints();
  }
  for (std::size_t k = 0; k < 58; ++k) {
    const double wanted = k < 30 ? 0.5 : 20;
    expected = arm.kind == DriverKind::kIiwa
                   ? wanted
                   : expected + std::clamp(gain * (wanted - expected), -1.0, 1.0);
    EXPECT_NEAR(driver.heard[first + k].torque[0], expected, 1e-12) << k;
  }
}

TEST_P(FakeDrivers, HoldOrDampAnArmThatNobodyCommandsAnyMore) {
  const Arm arm = GetParam();
  Commanded driver(arm, {"--lock-step"});  // its clock is the simulation
  if (!driver.hear(320)) GTEST_SKIP() << kNoMulticast;
  JointVector torque = JointVector::Zero(7);
  torque[0] = 4;
  torque[5] = 0.2;
  ASSERT_TRUE(driver.answer(150, torque)) << driver.complaints();
  const auto speed = [&] { return driver.heard.back().velocity.cwiseAbs().maxCoeff(); };
  // The fake driver damps where a busy machine answers late.
  for (int k = 0; k < 20 && speed() <= 0.1; ++k) {
    ASSERT_TRUE(driver.answer(50, torque)) << driver.complaints();
  }
  EXPECT_GT(speed(), 0.1);
  ASSERT_TRUE(driver.hear(150)) << driver.complaints();
  const JointVector there = driver.heard.back().position;
  ASSERT_TRUE(driver.hear(300)) << driver.complaints();
  EXPECT_LT(speed(), 0.02);
  EXPECT_LT((driver.heard.back().position - there).cwiseAbs().maxCoeff(), 0.05);
  EXPECT_GT(std::abs(there[0] - driver.heard.front().position[0]), 0.02);
}

INSTANTIATE_TEST_SUITE_P(Arms, FakeDrivers, ::testing::Values(kIiwa, kIiwa7, kPanda, kFr3),
                         [](const auto& given) { return std::string(given.param.name); });

TEST(FakeDriver, DiesAsTheDriverDoes) {
  const std::string url = own_url();
  for (const Arm& arm : {kIiwa, kPanda}) {
    Listener listener(url);
    Running fake({"fake-driver", scene(std::string("drivers/") + arm.name), arm.option, "--lcm-url",
                  url, "--duration", "10"});
    lcmtypes::DriverCommand command;
    command.torque = controller::JointVector::Zero(6);
    std::vector<std::uint8_t> bytes;
    encode(arm.kind, command, bytes);
    EXPECT_TRUE(listener.until([&] {
      listener.bus().publish(lcmtypes::profile_of(arm.kind).command_channel, bytes.data(),
                             static_cast<unsigned>(bytes.size()));
      return fake.ended();
    }));
    EXPECT_EQ(fake.finish(), 1);
    EXPECT_THAT(
        fake.complaints(),
        HasSubstr(arm.kind == DriverKind::kIiwa ? "a command came within 0.25 s of the first status"
                                                : "a command has 6 torques and 0 positions"));
  }
}

TEST(FakeDriver, DiesWhereItIsAskedTo) {
  Running fake({"fake-driver", scene("drivers/panda"), "--panda", "--lcm-url", own_url(),
                "--trouble", "die", "--from", "0.1"});
  EXPECT_EQ(fake.finish(), 1);
  EXPECT_THAT(fake.complaints(), HasSubstr("died, as asked for"));
}

TEST(FakeDriver, RefusesWhatItCannotBe) {
  const std::string panda = scene("drivers/panda"), iiwa = scene("drivers/iiwa14");
  expect_refusals({"fake-driver"},
                  {{{scene("panda_release_c2"), "--panda", "--duration", "0.1"},
                    "robot.gravity: must be [0, 0, 0]"},
                   {{panda, "--panda", "--iiwa"}, ""},
                   {{panda}, "one of them is wanted"},
                   {{iiwa, "--iiwa", "--trouble", "user-stop"}, "user-stop is for --panda"},
                   {{panda, "--panda", "--from", "1"}, "--trouble"}});
}

}  // namespace
}  // namespace dashpot::tests
