// Which commands count, and their effect.
#include <dashpot/lcmtypes/command_filter.hpp>
#include <dashpot/tests/lcmtypes/random_samples.hpp>
#include <dashpot/tests/support/special_values.hpp>

#include <gtest/gtest.h>

#include <functional>
#include <limits>

namespace dashpot::lcmtypes {
namespace {

using testing::kInfinity;

using Verdict = CommandVerdict;
constexpr double kNaN = std::numeric_limits<double>::quiet_NaN();
constexpr std::int64_t kSteady = 5'000'000;  // us

Verdict judge(CommandFilter& filter, const command_t& message, std::int64_t later = 0) {
  const Bytes bytes = bytes_of(message);
  return filter.judge(bytes.data(), bytes.size(), kNow + later, kSteady + later);
}

/// One filter for seven joints, and a command.
class CommandFilters : public ::testing::Test {
 protected:
  Verdict judge_next() {
    ++message.sequence;
    ++message.utime;
    return judge(filter, message);
  }
  /// Judges a command with these parts; those that follow come after it.
  Verdict judge_parts(std::int32_t parts) {
    message.parts = parts;
    return judge_next();
  }
  Random random{922};
  CommandFilter filter{limits_for(7)};
  command_t message = random_command(random, 7);
  controller::Setpoint setpoint;
};

TEST(CommandFilter, TakesEveryPart) {
  Random random(921);
  for (int n = 1; n <= controller::kMaxJoints; ++n) {
    CommandFilter filter(limits_for(n));
    const command_t message = random_command(random, n);
    ASSERT_EQ(judge(filter, message), Verdict::kAccepted) << n;
    controller::Setpoint setpoint;
    setpoint.time = 77;
    apply(filter.command(), setpoint);
    EXPECT_EQ(setpoint.time, 77);
    EXPECT_EQ(setpoint.mode, controller::Mode::kCartesian);
    EXPECT_EQ(setpoint.gains.frame, controller::Frame::kTool);
    for (std::size_t i = 0; i < 6; ++i) EXPECT_EQ(setpoint.gains.directions[i], i != 5);
    for (int i = 0; i < n; ++i) {
      const auto k = static_cast<std::size_t>(i);
      EXPECT_EQ(setpoint.joint_position[i], message.joint_position[k]);
      EXPECT_EQ(setpoint.gains.null_stiffness[i], message.null_stiffness[k]);
      EXPECT_EQ(setpoint.gains.null_damping[i], message.null_damping[k]);
      for (int j = 0; j < n; ++j) {
        const auto l = static_cast<std::size_t>(j);
        EXPECT_EQ(setpoint.gains.joint_stiffness(i, j), message.joint_stiffness[k][l]);
        EXPECT_EQ(setpoint.gains.joint_damping(i, j), message.joint_damping[k][l]);
      }
    }
    double quaternion[4];
    write_quaternion(setpoint.tip_pose.rotation, quaternion);
    for (int i = 0; i < 4; ++i) EXPECT_NEAR(quaternion[i], message.tip_quaternion[i], 1e-15);
    for (int i = 0; i < 3; ++i) EXPECT_EQ(setpoint.tip_pose.position[i], message.tip_position[i]);
    for (int i = 0; i < 6; ++i) {
      EXPECT_EQ(setpoint.wrench[i], message.wrench[i]);
      for (int j = 0; j < 6; ++j) {
        EXPECT_EQ(setpoint.gains.task_stiffness(i, j), message.task_stiffness[i][j]);
        EXPECT_EQ(setpoint.gains.task_damping(i, j), message.task_damping[i][j]);
      }
    }
    EXPECT_EQ(setpoint.gains.task_damping_ratio, message.task_damping_ratio);
    EXPECT_EQ(setpoint.gains.joint_damping_ratio, message.joint_damping_ratio);
    const Command& command = filter.command();
    EXPECT_EQ(command.payload.mass, message.payload_mass);
    for (int i = 0; i < 3; ++i) {
      EXPECT_EQ(command.payload.center[i], message.payload_center[i]);
      EXPECT_EQ(command.payload.inertia(i, i), message.payload_inertia[i][i]);
      EXPECT_EQ(command.tool.position[i], message.tool_position[i]);
    }
    write_quaternion(command.tool.rotation, quaternion);
    for (int i = 0; i < 4; ++i) EXPECT_NEAR(quaternion[i], message.tool_quaternion[i], 1e-15);
    EXPECT_EQ(command.tip_speed.linear, message.linear_velocity);
    EXPECT_EQ(command.tip_speed.angular, message.angular_velocity);
    EXPECT_EQ(command.tip_speed.limit, kInfinity);  // 0: the configuration's
  }
}

TEST_F(CommandFilters, EndsARatioWithGainsOfTheSamePart) {
  ASSERT_EQ(judge_parts(int{command_t::TASK_RATIO} + int{command_t::JOINT_RATIO}),
            Verdict::kAccepted);
  setpoint.gains.task_stiffness = random.spd(6);
  const controller::Matrix6 before = setpoint.gains.task_stiffness;
  apply(filter.command(), setpoint);
  EXPECT_EQ(setpoint.gains.task_stiffness, before);
  EXPECT_EQ(setpoint.gains.task_damping_ratio, message.task_damping_ratio);
  EXPECT_EQ(setpoint.gains.joint_damping_ratio, message.joint_damping_ratio);
  ASSERT_EQ(judge_parts(command_t::TASK_GAINS), Verdict::kAccepted);
  apply(filter.command(), setpoint, 1);
  EXPECT_EQ(setpoint.gains.task_damping_ratio, 0);
  EXPECT_EQ(setpoint.gains.joint_damping_ratio, message.joint_damping_ratio);
}

/// A sender's numbers may begin with 1; a speed that a later command does not name has no limit.
TEST_F(CommandFilters, ForgetsASpeedThatIsNotNamedAgain) {
  message.parts = command_t::TIP_SPEED;
  message.sequence = 1;
  ASSERT_EQ(judge(filter, message), Verdict::kAccepted);
  EXPECT_EQ(filter.command().tip_speed.linear, message.linear_velocity);
  message.linear_velocity = 0;
  ASSERT_EQ(judge_next(), Verdict::kAccepted);
  EXPECT_EQ(filter.command().tip_speed.linear, controller::TipSpeed().linear);
  EXPECT_EQ(filter.command().tip_speed.angular, message.angular_velocity);
}

TEST_F(CommandFilters, KeepsDampersBesideARatioUnlessThereAreOthers) {
  message.parts = int{command_t::TASK_GAINS} + int{command_t::TASK_RATIO} +
                  int{command_t::JOINT_GAINS} + int{command_t::JOINT_RATIO};
  for (auto& row : message.task_damping) std::fill(std::begin(row), std::end(row), 0.0);
  for (auto& row : message.joint_damping) std::fill(row.begin(), row.end(), 0.0);
  ASSERT_EQ(judge(filter, message), Verdict::kAccepted);
  setpoint.gains.task_damping = random.spd(6);
  setpoint.gains.joint_damping = random.spd(7);
  const controller::Gains before = setpoint.gains;
  apply(filter.command(), setpoint);
  EXPECT_EQ(setpoint.gains.task_damping, before.task_damping);
  EXPECT_EQ(setpoint.gains.joint_damping, before.joint_damping);
  EXPECT_EQ(setpoint.gains.task_damping_ratio, message.task_damping_ratio);
  // Without a ratio zeros count as zeros.
  ASSERT_EQ(judge_parts(int{command_t::TASK_GAINS} + int{command_t::JOINT_GAINS}),
            Verdict::kAccepted);
  apply(filter.command(), setpoint, 1);
  EXPECT_TRUE(setpoint.gains.task_damping.isZero(0));
  EXPECT_TRUE(setpoint.gains.joint_damping.isZero(0));
}

TEST_F(CommandFilters, LeavesAloneWhatNoCommandSet) {
  message.parts = command_t::JOINT_POSITION;
  message.wrench[0] = kNaN;  // not one of the parts: not checked
  ASSERT_EQ(judge(filter, message), Verdict::kAccepted);
  controller::Setpoint before;
  before.wrench = random.vector(6);
  before.gains.task_stiffness = random.spd(6);
  setpoint = before;
  apply(filter.command(), setpoint);
  EXPECT_EQ(setpoint.joint_position.size(), 7);
  EXPECT_EQ(setpoint.mode, before.mode);
  EXPECT_EQ(setpoint.wrench, before.wrench);
  EXPECT_EQ(setpoint.gains.task_stiffness, before.gains.task_stiffness);
  EXPECT_EQ(setpoint.gains.joint_stiffness.size(), 0);
}

TEST_F(CommandFilters, AddsUpThePartsOfSeveralCommands) {
  command_t first = random_command(random, 7), second = random_command(random, 7);
  first.parts = command_t::WRENCH | 0;
  second.parts = command_t::TIP_POSE | 0;
  second.sequence = first.sequence + 1;
  second.utime = first.utime + 1;
  ASSERT_EQ(judge(filter, first), Verdict::kAccepted);
  ASSERT_EQ(judge(filter, second), Verdict::kAccepted);
  apply(filter.command(), setpoint);
  EXPECT_EQ(setpoint.wrench[0], first.wrench[0]);
  EXPECT_EQ(setpoint.tip_pose.position[0], second.tip_position[0]);
  // The values of the first command do not come back with the second.
  controller::Setpoint later;
  apply(filter.command(), later, 1);
  EXPECT_EQ(later.wrench[0], 0);
  EXPECT_EQ(later.tip_pose.position[0], second.tip_position[0]);
}

struct Fault {
  CommandVerdict verdict;
  const char* name;
  std::function<void(command_t&)> make;
};

using V = CommandVerdict;
using M = command_t;
constexpr auto kFirst = std::numeric_limits<std::int64_t>::min();
constexpr auto kLast = std::numeric_limits<std::int64_t>::max();
const std::vector<Fault> kFaults = {
    {V::kUnknown, "no part", [](M& m) { m.parts = 0; }},
    {V::kUnknown, "unknown part", [](M& m) { m.parts = 2 * command_t::TOOL_FRAME + 1; }},
    {V::kUnknown, "all bits", [](M& m) { m.parts = -1; }},
    {V::kUnknown, "unknown mode", [](M& m) { m.mode = 2; }},
    {V::kUnknown, "unknown frame", [](M& m) { m.frame = -1; }},
    {V::kNoSender, "no sender", [](M& m) { m.sender = 0; }},
    {V::kOtherSender, "another sender", [](M& m) { ++m.sender; }},
    {V::kNoSuchFault, "no fault to release", [](M& m) { m.parts |= command_t::RELEASE; }},
    {V::kNotFinite, "position NaN", [](M& m) { m.joint_position[6] = kNaN; }},
    {V::kNotFinite, "position infinite", [](M& m) { m.joint_position[0] = -kInfinity; }},
    {V::kNotFinite, "tip NaN", [](M& m) { m.tip_position[1] = kNaN; }},
    {V::kNotFinite, "quaternion NaN", [](M& m) { m.tip_quaternion[3] = kNaN; }},
    {V::kNotFinite, "wrench infinite", [](M& m) { m.wrench[5] = kInfinity; }},
    {V::kNotFinite, "joint stiffness NaN", [](M& m) { m.joint_stiffness[3][4] = kNaN; }},
    {V::kNotFinite, "joint damping infinite", [](M& m) { m.joint_damping[6][6] = kInfinity; }},
    {V::kNotFinite, "task stiffness NaN", [](M& m) { m.task_stiffness[0][5] = kNaN; }},
    {V::kNotFinite, "task damping NaN", [](M& m) { m.task_damping[5][5] = kNaN; }},
    {V::kNotFinite, "null stiffness NaN", [](M& m) { m.null_stiffness[2] = kNaN; }},
    {V::kNotFinite, "null damping NaN", [](M& m) { m.null_damping[2] = kNaN; }},
    {V::kNotFinite, "ratio NaN", [](M& m) { m.task_damping_ratio = kNaN; }},
    {V::kNotFinite, "wrench infinite and too large",
     [](M& m) { m.wrench[0] = kInfinity, m.wrench[3] = 51; }},
    {V::kNotFinite, "payload NaN", [](M& m) { m.payload_inertia[0][2] = kNaN; }},
    {V::kNotFinite, "mass NaN", [](M& m) { m.payload_mass = kNaN; }},
    {V::kNotFinite, "tool NaN", [](M& m) { m.tool_position[2] = kNaN; }},
    {V::kNotFinite, "tool turned by NaN", [](M& m) { m.tool_quaternion[1] = kNaN; }},
    {V::kNotFinite, "speed NaN", [](M& m) { m.linear_velocity = kNaN; }},
    {V::kOutOfLimits, "position too low", [](M& m) { m.joint_position[6] = -3.0001; }},
    {V::kOutOfLimits, "position too high", [](M& m) { m.joint_position[0] = 3.0001; }},
    {V::kOutOfLimits, "tip out of reach", [](M& m) { m.tip_position[2] = 3.1; }},
    {V::kOutOfLimits, "tip overflows", [](M& m) { m.tip_position[2] = 1e200; }},
    {V::kOutOfLimits, "force too large", [](M& m) { m.wrench[2] = -201; }},
    {V::kOutOfLimits, "torque too large", [](M& m) { m.wrench[3] = 51; }},
    {V::kOutOfLimits, "joint stiffness too large", [](M& m) { m.joint_stiffness[1][1] = 20001; }},
    {V::kOutOfLimits, "joint damping too large", [](M& m) { m.joint_damping[1][1] = 2001; }},
    {V::kOutOfLimits, "task stiffness too large", [](M& m) { m.task_stiffness[1][1] = 50001; }},
    {V::kOutOfLimits, "task damping too large", [](M& m) { m.task_damping[1][1] = 5001; }},
    {V::kOutOfLimits, "null stiffness negative", [](M& m) { m.null_stiffness[0] = -1e-3; }},
    {V::kOutOfLimits, "null damping too large", [](M& m) { m.null_damping[6] = 2001; }},
    {V::kOutOfLimits, "ratio zero", [](M& m) { m.task_damping_ratio = 0; }},
    {V::kOutOfLimits, "ratio too large", [](M& m) { m.joint_damping_ratio = 2.001; }},
    {V::kOutOfLimits, "mass negative", [](M& m) { m.payload_mass = -1e-9; }},
    {V::kOutOfLimits, "mass too large", [](M& m) { m.payload_mass = 20.1; }},
    {V::kOutOfLimits, "payload unwieldy",
     [](M& m) { m.payload_inertia[0][0] = 1.01 * m.payload_mass; }},
    {V::kOutOfLimits, "payload far away", [](M& m) { m.payload_center[1] = -1.1; }},
    {V::kOutOfLimits, "tool too long", [](M& m) { m.tool_position[2] = -1.1; }},
    {V::kOutOfLimits, "speed negative", [](M& m) { m.angular_velocity = -0.1; }},
    {V::kOutOfLimits, "speed too large", [](M& m) { m.tip_velocity = 10.1; }},
    {V::kNotUnit, "tool not turned",
     [](M& m) {
       for (double& x : m.tool_quaternion) x *= 0.998;
     }},
    {V::kNotUnit, "quaternion too long",
     [](M& m) {
       for (double& x : m.tip_quaternion) x *= 1.002;
     }},
    {V::kNotUnit, "quaternion zero",
     [](M& m) {
       for (double& x : m.tip_quaternion) x = 0;
     }},
    {V::kNotUnit, "quaternion huge", [](M& m) { m.tip_quaternion[0] = 1e300; }},
    {V::kIndefinite, "joint stiffness not symmetric", [](M& m) { m.joint_stiffness[0][1] += 1; }},
    {V::kIndefinite, "joint stiffness indefinite", [](M& m) { m.joint_stiffness[2][2] = -1; }},
    {V::kIndefinite, "joint damping indefinite", [](M& m) { m.joint_damping[2][2] = -0.1; }},
    {V::kIndefinite, "task stiffness indefinite", [](M& m) { m.task_stiffness[4][4] = -1; }},
    {V::kIndefinite, "task damping not symmetric", [](M& m) { m.task_damping[4][2] -= 1; }},
    {V::kStale, "too old", [](M& m) { m.utime -= 500'001; }},
    {V::kStale, "very old", [](M& m) { m.utime = kFirst; }},
    {V::kFromFuture, "ahead", [](M& m) { m.utime += 100'001; }},
    {V::kFromFuture, "very far ahead", [](M& m) { m.utime = kLast; }},
};

TEST(CommandFilter, NamesEachFaultAndKeepsTheLastGoodCommand) {
  Random random(924);
  for (const Fault& fault : kFaults) {
    SCOPED_TRACE(fault.name);
    CommandFilter filter(limits_for(7));
    const command_t good = random_command(random, 7);
    ASSERT_EQ(judge(filter, good), Verdict::kAccepted);
    command_t bad = random_command(random, 7);
    bad.utime = kNow + 10;
    bad.sequence = good.sequence + 1;
    const std::int64_t later = 10;
    command_t sound = bad;
    fault.make(bad);
    EXPECT_EQ(judge(filter, bad, later), fault.verdict);
    EXPECT_EQ(filter.tally().count(fault.verdict), 1);
    EXPECT_EQ(filter.tally().rejected(), 1);
    EXPECT_EQ(filter.tally().last_refusal, fault.verdict);
    EXPECT_EQ(filter.tally().last_refusal_utime, kNow + later);
    EXPECT_EQ(filter.tally().last_refused_sender, bad.sender);
    EXPECT_TRUE(filter.last_reason().starts_with(to_text(fault.verdict)));
    const std::string ratio = " is 0, it has to be above 0", limits = ", the limits are ";
    const bool number =
        filter.last_reason().find(" is ") != std::string::npos &&
        filter.last_reason().find(fault.name == std::string("ratio zero") ? ratio : limits) !=
            std::string::npos;
    EXPECT_EQ(number, fault.verdict == Verdict::kOutOfLimits) << filter.last_reason();
    EXPECT_EQ(filter.command().sequence, good.sequence);
    EXPECT_EQ(filter.command().utime, good.utime);
    EXPECT_EQ(filter.command().setpoint.wrench[0], good.wrench[0]);
    EXPECT_EQ(filter.command().setpoint.joint_position[0], good.joint_position[0]);
    EXPECT_EQ(judge(filter, sound, later), Verdict::kAccepted);  // only the fault was in the way
  }
}

TEST(CommandFilter, AcceptsNothingWhereItsLimitsAreNaN) {
  Random random(925);
  CommandLimits limits = limits_for(7);
  limits.force = kNaN;
  CommandFilter filter(limits);
  EXPECT_EQ(judge(filter, random_command(random, 7)), Verdict::kOutOfLimits);
}

TEST_F(CommandFilters, RefusesAnotherNumberOfJoints) {
  EXPECT_EQ(judge(filter, random_command(random, 6)), Verdict::kWrongSize);
  EXPECT_EQ(judge(filter, random_command(random, 8)), Verdict::kWrongSize);
}

TEST_F(CommandFilters, AcceptsGainsThatAreSemidefinite) {
  const Eigen::MatrixXd W = 10 * random.matrix(2, 7);
  message.joint_stiffness = rows_of(W.transpose() * W);
  for (auto& row : message.task_stiffness) std::fill(std::begin(row), std::end(row), 0.0);
  for (auto& row : message.joint_damping) std::fill(row.begin(), row.end(), 0.0);
  EXPECT_EQ(judge(filter, message), Verdict::kAccepted);
}

TEST_F(CommandFilters, RefusesReplays) {
  command_t first = random_command(random, 7), second = first;
  second.utime += 1000;
  ++second.sequence;
  ASSERT_EQ(judge(filter, first), Verdict::kAccepted);
  EXPECT_EQ(judge(filter, first), Verdict::kReplayed);
  ASSERT_EQ(judge(filter, second, 1000), Verdict::kAccepted);
  // A recording of both, sent again and again until long after: never accepted.
  for (std::int64_t later = 1000; later < 3'000'000; later += 10'000) {
    const Verdict expected = later > 501'000 ? Verdict::kStale : Verdict::kReplayed;
    EXPECT_EQ(judge(filter, second, later), expected) << later;
    EXPECT_NE(judge(filter, first, later), Verdict::kAccepted) << later;
  }
  EXPECT_EQ(filter.command().sequence, second.sequence);
}

// The time is right, the sequence is not, and the other way round.
TEST_F(CommandFilters, WantsBothTimeAndSequenceToRise) {
  const command_t first = random_command(random, 7);
  ASSERT_EQ(judge(filter, first), Verdict::kAccepted);
  command_t message = first;
  message.utime += 10;
  EXPECT_EQ(judge(filter, message, 10), Verdict::kReplayed);
  message = first;
  message.sequence += 10;
  EXPECT_EQ(judge(filter, message, 10), Verdict::kReplayed);
}

TEST_F(CommandFilters, LetsARestartedSenderBeginItsSequenceAnewAfterASilence) {
  message.sequence = std::numeric_limits<std::int64_t>::max();
  ASSERT_EQ(judge(filter, message), Verdict::kAccepted);
  message.sequence = 1;
  message.utime = kNow + 600'000;
  EXPECT_EQ(judge(filter, message, 600'000), Verdict::kReplayed);
  message.utime = kNow + 600'001;
  EXPECT_EQ(judge(filter, message, 600'001), Verdict::kAccepted);
}

TEST_F(CommandFilters, SurvivesAClockThatIsSetBack) {
  ASSERT_EQ(judge(filter, message), Verdict::kAccepted);
  // One hour back, as all clocks of the machine; a second later commands count again.
  const std::int64_t back = 3'600'000'000;
  message.utime = kNow - back + 1'000'000;
  ++message.sequence;
  const Bytes bytes = bytes_of(message);
  EXPECT_EQ(filter.judge(bytes.data(), bytes.size(), message.utime, kSteady + 1'000'000),
            Verdict::kAccepted);
}

TEST(CommandFilter, LimitsTheRate) {
  Random random(931);
  CommandLimits limits = limits_for(7);
  limits.most_per_second = 1000;
  limits.burst = 10;
  CommandFilter filter(limits);
  command_t message = random_command(random, 7);
  int accepted = 0, too_many = 0;
  constexpr int kMessages = 5'000;  // over half a second
  for (int i = 0; i < kMessages; ++i) {
    message.utime += 100;
    ++message.sequence;
    const Verdict verdict = judge(filter, message, 100 * (i + 1));
    accepted += verdict == Verdict::kAccepted;
    too_many += verdict == Verdict::kTooMany;
  }
  EXPECT_EQ(accepted + too_many, kMessages);
  EXPECT_NEAR(accepted, 510, 2);
  // Goals are not judged: the newest of a burst counts.
  message.parts = int{command_t::JOINT_POSITION} + int{command_t::TIP_SPEED};
  for (int i = 0; i < 1000; ++i) {
    ++message.utime;
    ++message.sequence;
    message.joint_position[0] = 1e-3 * i;
    ASSERT_EQ(judge(filter, message, 500'000), Verdict::kAccepted) << i;
  }
  EXPECT_EQ(filter.command().setpoint.joint_position[0], 0.999);
}

TEST(CommandFilter, SurvivesRandomMutations) {
  constexpr std::uint64_t kSeed = 932;
  constexpr int kCases = 16'000;
  constexpr int kAfterSequence = 36;  // of another sender, or far ahead, it is refused at once
  Random random(kSeed);
  CommandFilter filter(limits_for(7));
  const command_t good = random_command(random, 7);
  std::array<int, kCommandVerdicts> verdicts{};
  for (int i = 1; i <= kCases; ++i) {
    command_t message = good;
    message.utime = kNow + i;
    message.sequence = good.sequence + i;
    Bytes bytes = bytes_of(message);
    const int last = static_cast<int>(bytes.size()) - 1;
    for (int k = random.integer(1, 3); k > 0; --k) {
      bytes[static_cast<std::size_t>(random.integer(kAfterSequence, last))] =
          static_cast<std::uint8_t>(random.integer(0, 255));
    }
    const std::int64_t before = filter.command().sequence;
    const Verdict verdict = filter.judge(bytes.data(), bytes.size(), kNow + i, kSteady + i * 1000);
    ++verdicts[static_cast<std::size_t>(verdict)];
    if (verdict != Verdict::kAccepted) {
      ASSERT_EQ(filter.command().sequence, before);
      continue;
    }
    const controller::Setpoint& setpoint = filter.command().setpoint;
    ASSERT_TRUE(setpoint.joint_position.allFinite() && setpoint.wrench.allFinite() &&
                setpoint.tip_pose.position.allFinite() && setpoint.tip_pose.rotation.allFinite());
    ASSERT_LE(setpoint.joint_position.cwiseAbs().maxCoeff(), 3);
    ASSERT_LE(setpoint.gains.task_stiffness.cwiseAbs().maxCoeff(), 50000);
    ASSERT_TRUE(
        (setpoint.tip_pose.rotation * setpoint.tip_pose.rotation.transpose()).isIdentity(1e-12));
  }
  std::printf("seed %llu:", static_cast<unsigned long long>(kSeed));
  for (std::size_t i = 0; i < verdicts.size(); ++i) {
    std::printf(" %d %s;", verdicts[i], to_text(static_cast<Verdict>(i)));
  }
  std::printf("\n");
  EXPECT_GT(verdicts[0], 50);
  EXPECT_GT(verdicts[static_cast<std::size_t>(Verdict::kIndefinite)], 50);
}

TEST(CommandFilter, WantsLimitsForEveryJoint) {
  CommandLimits limits = limits_for(7);
  limits.position_upper.resize(6);
  EXPECT_THROW(CommandFilter{limits}, std::invalid_argument);
  EXPECT_THROW(CommandFilter{CommandLimits()}, std::invalid_argument);
}

}  // namespace
}  // namespace dashpot::lcmtypes
