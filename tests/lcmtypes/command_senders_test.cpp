// Who commands: one sender at a time, whatever others send; and how a release names its fault.
#include <dashpot/lcmtypes/command_filter.hpp>
#include <dashpot/tests/lcmtypes/random_samples.hpp>

#include <gtest/gtest.h>

#include <limits>
#include <string>
#include <vector>

namespace dashpot::lcmtypes {
namespace {

constexpr std::int64_t kMillisecond = 1000;    // us
constexpr std::int64_t kSilence = 1'000'000;   // us, by default
constexpr std::int64_t kRemembered = 600'000;  // us: oldest and furthest by default

/// Senders of commands to one filter, on one clock.
class CommandSenders : public ::testing::Test {
 protected:
  using Verdict = CommandVerdict;

  /// A good command of `sender`, given now.
  command_t command_of(std::int64_t sender) {
    command_t message = sample;
    message.sender = sender;
    message.utime = kNow + elapsed;
    message.sequence = ++last_sequence;
    return message;
  }
  Verdict arrive(CommandFilter& filter, const command_t& message) const {
    const Bytes bytes = bytes_of(message);
    return filter.judge(bytes.data(), bytes.size(), kNow + elapsed, kSteadyStart + elapsed);
  }
  Verdict send_as(std::int64_t sender) { return arrive(shared, command_of(sender)); }
  Verdict send_parts(std::int64_t sender, std::int32_t parts, std::int64_t fault_tick = 0) {
    command_t message = command_of(sender);
    message.parts = parts;
    message.fault_tick = fault_tick;
    return arrive(shared, message);
  }
  void pass(std::int64_t microseconds) { elapsed += microseconds; }

  static constexpr std::int64_t kSteadyStart = 5'000'000;  // us
  Random engine{941};
  command_t sample = random_command(engine, 7);
  std::int64_t elapsed = 0;        // us since the start
  std::int64_t last_sequence = 0;  // of all senders
  CommandFilter shared{limits_for(7)};
};

TEST_F(CommandSenders, TheFirstCommandsUntilItHasBeenSilent) {
  EXPECT_EQ(shared.tally().commander, 0);
  EXPECT_EQ(send_as(1), Verdict::kAccepted);
  EXPECT_EQ(shared.tally().commander, 1);
  for (int i = 0; i < 100; ++i) {
    pass(kSilence / 10);
    EXPECT_EQ(send_as(2), Verdict::kOtherSender);
    EXPECT_EQ(shared.command().accepted, 1 + i / 5);
    if (i % 5 == 4) {
      EXPECT_EQ(send_as(1), Verdict::kAccepted);
    }
  }
  pass(kSilence);
  EXPECT_EQ(send_as(2), Verdict::kOtherSender);
  pass(1);
  EXPECT_EQ(send_as(2), Verdict::kAccepted);
  EXPECT_EQ(shared.tally().commander, 2);
  EXPECT_EQ(send_as(1), Verdict::kOtherSender);
}

TEST_F(CommandSenders, SilenceIsNoticedWithoutACommand) {
  EXPECT_EQ(send_as(1), Verdict::kAccepted);
  shared.notice_silence(kSteadyStart + kSilence);
  EXPECT_EQ(shared.tally().commander, 1);
  shared.notice_silence(kSteadyStart + kSilence + 1);
  EXPECT_EQ(shared.tally().commander, 0);
  EXPECT_EQ(shared.tally().accepted(), 1);
}

TEST_F(CommandSenders, OneThatGivesUpIsFollowedAtOnce) {
  EXPECT_EQ(send_as(1), Verdict::kAccepted);
  pass(kMillisecond);
  const std::int32_t last_parts = int{command_t::WRENCH} + int{command_t::GIVE_UP};
  EXPECT_EQ(send_parts(2, last_parts), Verdict::kOtherSender);
  EXPECT_EQ(shared.tally().commander, 1);
  EXPECT_EQ(send_parts(1, last_parts), Verdict::kAccepted);
  EXPECT_TRUE(has_set(shared.command(), command_t::WRENCH, 1));  // the other part counts as well
  EXPECT_EQ(shared.tally().commander, 0);
  EXPECT_EQ(send_as(2), Verdict::kAccepted);
  EXPECT_EQ(shared.tally().commander, 2);
}

// A recorded command counts no more than before once its sender has given up.
TEST_F(CommandSenders, ARecordingCountsForNobody) {
  command_t recorded = command_of(1);
  EXPECT_EQ(arrive(shared, recorded), Verdict::kAccepted);
  pass(kMillisecond);
  EXPECT_EQ(send_parts(1, command_t::GIVE_UP), Verdict::kAccepted);
  for (int i = 0; i < 700; ++i, pass(kMillisecond)) {
    EXPECT_NE(arrive(shared, recorded), Verdict::kAccepted) << i;
    if (i == 100) {
      EXPECT_EQ(send_parts(2, command_t::GIVE_UP), Verdict::kAccepted);
    }
  }
  // Nor does it under another name: for that its sender has to be silent, or to give up.
  EXPECT_EQ(send_as(1), Verdict::kAccepted);
  pass(kMillisecond);
  recorded = command_of(1);
  EXPECT_EQ(arrive(shared, recorded), Verdict::kAccepted);
  recorded.sender = 2;
  EXPECT_EQ(arrive(shared, recorded), Verdict::kOtherSender);
}

TEST_F(CommandSenders, AFloodOfAnotherTakesNothingFromTheOneThatCommands) {
  CommandLimits limits = limits_for(7);
  limits.most_per_second = 100;
  limits.burst = 1;
  int judged = 0;
  CommandFilter filter(limits, [&judged](const Command&, std::string&) { return ++judged > 0; });
  EXPECT_EQ(arrive(filter, command_of(1)), Verdict::kAccepted);
  constexpr int kRounds = 100;
  for (int round = 0; round < kRounds; ++round) {
    for (int i = 0; i < 40; ++i) {
      pass(kMillisecond / 4);
      EXPECT_EQ(arrive(filter, command_of(2 + i % 3)), Verdict::kOtherSender);
    }
    EXPECT_EQ(arrive(filter, command_of(1)), Verdict::kAccepted);
  }
  EXPECT_EQ(filter.tally().count(Verdict::kOtherSender), 40 * kRounds);
  EXPECT_EQ(judged, kRounds + 1);
}

// Without a commander, one sender sends more refused commands than the bucket holds.
TEST_F(CommandSenders, WhoeverBeginsToCommandFindsTheBucketFull) {
  CommandLimits limits = limits_for(7);
  limits.most_per_second = 100;
  limits.burst = 3;
  CommandFilter filter(limits, [](const Command& command, std::string&) {
    return command.setpoint.gains.null_damping[0] == 0;  // of sender 1 alone
  });
  for (int i = 0; i < 100; ++i) {
    pass(kMillisecond / 10);
    EXPECT_NE(arrive(filter, command_of(2)), Verdict::kAccepted);
  }
  EXPECT_GT(filter.tally().count(Verdict::kTooMany), 50);
  pass(10 * kMillisecond);
  for (const Verdict verdict :
       {Verdict::kAccepted, Verdict::kAccepted, Verdict::kAccepted, Verdict::kTooMany}) {
    command_t message = command_of(1);
    message.null_damping.assign(7, 0);
    EXPECT_EQ(arrive(filter, message), verdict);
    pass(1);
  }
}

TEST_F(CommandSenders, AHugeSequenceLocksNobodyOut) {
  command_t far = command_of(2);
  far.sequence = std::numeric_limits<std::int64_t>::max();
  far.utime += 100 * kMillisecond;  // as far ahead as it may be
  EXPECT_EQ(arrive(shared, far), Verdict::kAccepted);
  pass(kMillisecond);
  EXPECT_EQ(send_as(2), Verdict::kReplayed);  // it has locked itself out
  pass(kSilence);
  EXPECT_EQ(send_as(1), Verdict::kAccepted);
  pass(kMillisecond);
  EXPECT_EQ(send_as(1), Verdict::kAccepted);
  // It holds while the first is still remembered.
  far = command_of(1);
  far.sequence = std::numeric_limits<std::int64_t>::max();
  far.utime += 100 * kMillisecond;
  far.parts = command_t::GIVE_UP;
  EXPECT_EQ(arrive(shared, far), Verdict::kAccepted);
  EXPECT_EQ(send_as(3), Verdict::kAccepted);
}

TEST_F(CommandSenders, AreRememberedAsLongAsTheirCommandsCouldBeReplayed) {
  std::vector<command_t> recorded;
  for (std::int64_t sender = 1; sender <= 8; ++sender) {
    recorded.push_back(command_of(sender));
    recorded.back().parts |= command_t::GIVE_UP;
    EXPECT_EQ(arrive(shared, recorded.back()), Verdict::kAccepted);
    pass(kMillisecond);
  }
  EXPECT_EQ(send_as(9), Verdict::kTooMany);  // no room to remember it
  for (const command_t& message : recorded) {
    EXPECT_EQ(arrive(shared, message), Verdict::kReplayed);
  }
  pass(kRemembered - 8 * kMillisecond);
  EXPECT_EQ(send_as(9), Verdict::kTooMany);
  pass(1);
  EXPECT_EQ(send_as(9), Verdict::kAccepted);
}

TEST_F(CommandSenders, AReleaseNamesTheFaultThatIsLatched) {
  const std::int32_t release = command_t::RELEASE;
  EXPECT_EQ(send_parts(1, release, 0), Verdict::kNoSuchFault);  // there is no fault
  EXPECT_EQ(send_parts(1, release, 500), Verdict::kNoSuchFault);
  const command_t before = [this] {
    command_t message = command_of(1);
    message.parts = command_t::RELEASE;
    message.fault_tick = 400;  // the latest fault that its sender can know before 500
    return message;
  }();
  shared.set_fault_tick(500);
  pass(kMillisecond);
  EXPECT_EQ(arrive(shared, before), Verdict::kNoSuchFault);
  for (const std::int64_t tick : {std::int64_t{0}, std::int64_t{499}, std::int64_t{501},
                                  std::numeric_limits<std::int64_t>::max()}) {
    EXPECT_EQ(send_parts(1, release, tick), Verdict::kNoSuchFault) << tick;
  }
  EXPECT_FALSE(has_set(shared.command(), release, 0));
  EXPECT_EQ(send_parts(1, release, 500), Verdict::kAccepted);
  EXPECT_TRUE(has_set(shared.command(), release, 0));
  EXPECT_EQ(shared.command().fault_tick, 500);
  // No later message repeats the release, and the next fault has another name.
  pass(kMillisecond);
  EXPECT_EQ(send_parts(1, command_t::WRENCH), Verdict::kAccepted);
  EXPECT_FALSE(has_set(shared.command(), release, 1));
  shared.set_fault_tick(900);
  pass(kMillisecond);
  EXPECT_EQ(send_parts(1, release, 500), Verdict::kNoSuchFault);
  EXPECT_EQ(send_parts(2, release, 900), Verdict::kOtherSender);
  pass(kMillisecond);
  EXPECT_EQ(send_parts(1, release, 900), Verdict::kAccepted);
}

TEST_F(CommandSenders, TheControllerIsAskedLastAndItsReasonKept) {
  bool good = true;
  std::vector<double> judged;
  CommandFilter filter(limits_for(7), [&](const Command& command, std::string& reason) {
    judged.push_back(command.setpoint.gains.task_stiffness(0, 0));
    reason = "a margin of 1.25 is left";
    return good;
  });
  command_t message = command_of(1);
  EXPECT_EQ(arrive(filter, message), Verdict::kAccepted);
  ASSERT_EQ(judged.size(), 1U);
  EXPECT_EQ(judged[0], message.task_stiffness[0][0]);
  EXPECT_EQ(filter.last_reason(), "");
  good = false;
  pass(kMillisecond);
  message = command_of(1);
  message.parts = command_t::TASK_GAINS;
  message.task_stiffness[0][0] += 100;
  EXPECT_EQ(arrive(filter, message), Verdict::kUnstable);
  EXPECT_EQ(filter.last_reason(), "refused by the controller: a margin of 1.25 is left");
  EXPECT_EQ(filter.command().accepted, 1);
  EXPECT_EQ(filter.command().setpoint.gains.task_stiffness(0, 0), judged[0]);
  EXPECT_EQ(judged.size(), 2U);
  // Commands that are refused otherwise, or come from others, are not judged.
  good = true;
  message.sequence = ++last_sequence;
  EXPECT_EQ(arrive(filter, message), Verdict::kAccepted);
  EXPECT_EQ(judged.size(), 3U);
  EXPECT_EQ(arrive(filter, message), Verdict::kReplayed);
  EXPECT_EQ(filter.last_reason(), "replayed or out of order");
  EXPECT_EQ(arrive(filter, command_of(2)), Verdict::kOtherSender);
  EXPECT_EQ(judged.size(), 3U);
}

TEST_F(CommandSenders, AreKeptApartWhateverTheySend) {
  constexpr std::uint64_t kSeed = 942;
  Random random(kSeed);
  std::printf("seed %llu\n", static_cast<unsigned long long>(kSeed));
  std::int64_t heard_at = -10 * kSilence, commander = 0;
  for (int i = 0; i < 10'000; ++i) {
    pass(random.integer(0, 3) == 0 ? random.integer(0, 1'200'000) : random.integer(0, 2000));
    const std::int64_t sender = random.integer(1, 4);
    command_t message = command_of(sender);
    if (random.integer(0, 2) == 0) message.sequence = random.integer(0, 1'000'000);
    if (random.integer(0, 5) == 0) message.utime += random.integer(-700'000, 200'000);
    if (random.integer(0, 9) == 0) message.parts = command_t::GIVE_UP;
    const Verdict verdict = arrive(shared, message);
    const bool free = commander == 0 || elapsed - heard_at > kSilence;
    if (!free && sender != commander) {
      ASSERT_EQ(verdict, Verdict::kOtherSender) << i;
    } else {
      ASSERT_NE(verdict, Verdict::kOtherSender) << i;
    }
    if (free) commander = 0;
    if (verdict != Verdict::kAccepted) continue;
    heard_at = elapsed;
    commander = message.parts == command_t::GIVE_UP ? 0 : sender;
    ASSERT_EQ(shared.tally().commander, commander) << i;
  }
  EXPECT_GT(shared.tally().accepted(), 1000);
  EXPECT_GT(shared.tally().count(Verdict::kOtherSender), 1000);
}

}  // namespace
}  // namespace dashpot::lcmtypes
