// Good commands come through a bus; hostile senders on the same bus change nothing but counters.
#include <dashpot/lcmtypes/command_receiver.hpp>
#include <dashpot/tests/lcmtypes/random_samples.hpp>
#include <dashpot/tests/support/sanitized.hpp>

#include <gtest/gtest.h>
#include <unistd.h>

#include <chrono>
#include <functional>
#include <future>
#include <lcm/lcm-cpp.hpp>
#include <thread>

namespace dashpot::lcmtypes {
namespace {

using Verdict = CommandVerdict;

constexpr int kJoints = 7;
constexpr std::int64_t kLongTime = 60'000'000;  // us, so that a busy machine spoils nothing

CommandLimits patient_limits() {
  CommandLimits limits = limits_for(kJoints);
  limits.oldest = limits.furthest = kLongTime;
  return limits;
}

std::int64_t unix_time() {
  return std::chrono::duration_cast<std::chrono::microseconds>(
             std::chrono::system_clock::now().time_since_epoch())
      .count();
}

void send(lcm::LCM& bus, const Bytes& bytes) {
  bus.publish(kCommandChannel, bytes.data(), static_cast<unsigned>(bytes.size()));
}

class Sender {
 public:
  Sender(lcm::LCM& bus, std::uint64_t seed, std::int64_t first_sequence = 1)
      : bus_(bus), random_(seed), first_(first_sequence) {}

  /// A good command, given now; returns its sequence.
  std::int64_t send_good() {
    command_t message = random_command(random_, kJoints);
    message.utime = unix_time();
    message.sequence = next_sequence();
    sent_.push_back(message);
    send(bus_, bytes_of(message));
    return message.sequence;
  }

  /// One of every kind of bad message.
  void send_bad() {
    const Bytes last = bytes_of(sent_.back());
    send(bus_, Bytes(last.begin(), last.end() - random_.integer(1, 100)));  // truncated
    send(bus_, last);                                                       // replayed
    send(bus_, {});
    send(bus_, Bytes(static_cast<std::size_t>(random_.integer(1, 3000)), 0xff));
    Bytes huge = last;  // a size that asks for gigabytes
    huge[8] = 0x7f;
    send(bus_, huge);
    command_t message = random_command(random_, kJoints);
    message.sequence = next_sequence();  // good but for one thing:
    message.utime = unix_time() - 2 * kLongTime;
    send(bus_, bytes_of(message));
    message.utime = unix_time() + 2 * kLongTime;
    send(bus_, bytes_of(message));
    message.utime = unix_time();
    message.wrench[2] = std::numeric_limits<double>::quiet_NaN();
    send(bus_, bytes_of(message));
    message.wrench[2] = 1e6;
    send(bus_, bytes_of(message));
    message = random_command(random_, kJoints - 1);
    message.sequence = next_sequence();
    message.utime = unix_time();
    send(bus_, bytes_of(message));
  }
  static constexpr int kKindsOfBad = 10;

  /// Whether `command` is one of the good ones, whole.
  bool is_one(const Command& command) const {
    const std::int64_t i = command.sequence - first_;
    if (i < 0 || i >= static_cast<std::int64_t>(sent_.size())) return false;
    const command_t& message = sent_[static_cast<std::size_t>(i)];
    return command.utime == message.utime && command.setpoint.wrench[5] == message.wrench[5] &&
           command.setpoint.joint_position[kJoints - 1] == message.joint_position[kJoints - 1] &&
           command.setpoint.gains.joint_damping(6, 5) == message.joint_damping[6][5];
  }
  bool is_last(const Command& command) const {
    return is_one(command) && command.sequence == sent_.back().sequence;
  }

 private:
  std::int64_t next_sequence() const { return first_ + static_cast<std::int64_t>(sent_.size()); }

  lcm::LCM& bus_;
  Random random_;
  std::int64_t first_;
  std::vector<command_t> sent_;
};

/// Waits until this is so; false if it is not before a hang is sure.
bool wait_until(const std::function<bool()>& so) {
  const auto end = std::chrono::steady_clock::now() + testing::kHang;
  while (!so()) {
    if (std::chrono::steady_clock::now() > end) return false;
    std::this_thread::sleep_for(std::chrono::milliseconds(1));
  }
  return true;
}

/// Waits until the receiver has judged so many messages.
bool wait_for(const CommandReceiver& receiver, std::int64_t judged) {
  return wait_until(
      [&] { return receiver.tally().accepted() + receiver.tally().rejected() >= judged; });
}

/// Waits until the sequence has come through.
bool wait_for_sequence(CommandReceiver& receiver, std::int64_t sequence) {
  return wait_until([&] { return receiver.fetch() && receiver.command().sequence == sequence; });
}

/// Two threads that send what `next` makes for each, every 20 us or so.
class Flood {
 public:
  template <class Next>
  Flood(lcm::LCM& bus, const Next& next) {
    for (std::uint64_t number = 1; number <= 2; ++number) {
      threads_.emplace_back([this, &bus, make = next(number)]() mutable {
        while (!stop_.load()) {
          send(bus, make());
          std::this_thread::sleep_for(std::chrono::microseconds(20));
        }
      });
    }
  }
  ~Flood() { end(); }
  void end() {
    stop_.store(true);
    for (std::thread& thread : threads_) thread.join();
    threads_.clear();
  }

 private:
  std::atomic<bool> stop_{false};
  std::vector<std::thread> threads_;
};

TEST(CommandReceiver, HandsOnGoodCommands) {
  const auto bus = open_bus("memq://");
  CommandReceiver receiver(bus, patient_limits());
  EXPECT_FALSE(receiver.fetch());
  EXPECT_EQ(receiver.command().parts, 0);
  Sender sender(*bus, 961);
  for (int i = 1; i <= 20; ++i) {
    ASSERT_TRUE(wait_for_sequence(receiver, sender.send_good()));
    EXPECT_TRUE(sender.is_last(receiver.command()));
    EXPECT_FALSE(receiver.fetch());  // nothing new
  }
  EXPECT_EQ(receiver.tally().count(Verdict::kAccepted), 20);
  EXPECT_EQ(receiver.tally().rejected(), 0);
}

TEST(CommandReceiver, KeepsTheLastGoodCommandUnderAttack) {
  const auto bus = open_bus("memq://");
  CommandReceiver receiver(bus, patient_limits());
  Sender sender(*bus, 962);
  std::int64_t judged = 0;
  for (int round = 0; round < 50; ++round) {
    ASSERT_TRUE(wait_for_sequence(receiver, sender.send_good()));
    ++judged;
    sender.send_bad();
    judged += Sender::kKindsOfBad;
    ASSERT_TRUE(wait_for(receiver, judged));
    EXPECT_FALSE(receiver.fetch());
    EXPECT_TRUE(sender.is_last(receiver.command()));
  }
  EXPECT_EQ(receiver.tally().count(Verdict::kAccepted), 50);
  EXPECT_EQ(receiver.tally().rejected(), 50 * Sender::kKindsOfBad);
  EXPECT_EQ(receiver.tally().count(Verdict::kMalformed), 50 * 4);
  for (const Verdict verdict : {Verdict::kReplayed, Verdict::kStale, Verdict::kFromFuture,
                                Verdict::kNotFinite, Verdict::kOutOfLimits, Verdict::kWrongSize}) {
    EXPECT_EQ(receiver.tally().count(verdict), 50) << to_text(verdict);
  }
}

// Noise, and a program that commands without being asked to, at full speed: whoever commands is
// still heard, and what the real-time thread reads is always a whole command of that sender.
TEST(CommandReceiver, HearsTheOneThatCommandsThroughAFloodOfOthers) {
  const auto bus = open_bus("memq://");
  CommandReceiver receiver(bus, patient_limits());
  Sender sender(*bus, 968);
  ASSERT_TRUE(wait_for_sequence(receiver, sender.send_good()));
  Flood flood(*bus, [](std::uint64_t number) -> std::function<Bytes()> {
    if (number == 2) {
      return [engine = std::mt19937_64(964)]() mutable {
        Bytes bytes(engine() % 2000);
        for (std::uint8_t& byte : bytes) byte = static_cast<std::uint8_t>(engine());
        return bytes;
      };
    }
    Random random(969);
    command_t message = random_command(random, kJoints);
    message.sender = static_cast<std::int64_t>(number);
    message.sequence = std::numeric_limits<std::int64_t>::max();
    return [message]() mutable {
      message.utime = unix_time();
      return bytes_of(message);
    };
  });
  int came_through = 0;
  const auto flooded = [&] {
    constexpr int kFlood = 100;
    const CommandTally now = receiver.tally();
    return now.count(Verdict::kOtherSender) > kFlood && now.count(Verdict::kMalformed) > kFlood;
  };
  for (int i = 0; i < 50 || !flooded(); ++i) {
    const std::int64_t sequence = sender.send_good();
    for (int tick = 0; tick < 20; ++tick) {
      if (receiver.fetch()) {
        EXPECT_TRUE(sender.is_one(receiver.command()));
      }
      std::this_thread::sleep_for(std::chrono::milliseconds(1));
      if (receiver.command().sequence == sequence) break;
    }
    if (receiver.command().sequence == sequence) ++came_through;
  }
  flood.end();
  EXPECT_GT(came_through, 0);
  const CommandTally tally = receiver.tally();
  EXPECT_EQ(tally.commander, kSender);
  EXPECT_EQ(tally.rejected(),
            tally.count(Verdict::kOtherSender) + tally.count(Verdict::kMalformed));
}

// The real-time thread goes on while gains are judged, and sees them only once they have passed.
TEST(CommandReceiver, JudgesGainsOnItsOwnThread) {
  const auto bus = open_bus("memq://");
  std::promise<std::thread::id> begun;
  std::promise<bool> answer;
  bool first = true;
  CommandReceiver receiver(bus, patient_limits(), [&](const Command&, std::string& reason) {
    if (!first) return true;
    first = false;
    begun.set_value(std::this_thread::get_id());
    reason = "too little is left";
    return answer.get_future().get();
  });
  Sender sender(*bus, 970);
  sender.send_good();
  EXPECT_NE(begun.get_future().get(), std::this_thread::get_id());
  for (int tick = 0; tick < 100; ++tick) {
    EXPECT_FALSE(receiver.fetch());
    EXPECT_EQ(receiver.fetch_tally().accepted() + receiver.fetch_tally().rejected(), 0);
  }
  answer.set_value(false);
  ASSERT_TRUE(wait_for(receiver, 1));
  EXPECT_FALSE(receiver.fetch());
  EXPECT_EQ(receiver.fetch_tally().count(Verdict::kUnstable), 1);
  EXPECT_EQ(receiver.last_reason(), "refused by the controller: too little is left");
  ASSERT_TRUE(wait_for_sequence(receiver, sender.send_good()));
}

// The state reports the missing commander, although no message announces it.
TEST(CommandReceiver, LetsGoOfASilentSender) {
  const auto bus = open_bus("memq://");
  CommandLimits limits = patient_limits();
  limits.silence = 1;  // us
  CommandReceiver receiver(bus, limits);
  Sender sender(*bus, 972);
  ASSERT_TRUE(wait_for_sequence(receiver, sender.send_good()));
  EXPECT_TRUE(wait_until([&] { return receiver.fetch_tally().commander == 0; }));
  EXPECT_EQ(receiver.fetch_tally().accepted(), 1);
}

// A sender that starts again begins its sequence again; it counts once its predecessor is
// forgotten.
TEST(CommandReceiver, OutlivesItsSenders) {
  // A port of this process alone, so that tests may run side by side.
  const std::string url =
      "udpm://239.255.76.67:" + std::to_string(20000 + getpid() % 30000) + "?ttl=0";
  const auto bus = open_bus(url);
  CommandReceiver receiver(bus, limits_for(kJoints));
  for (const std::int64_t first_sequence : {1'000'000, 1}) {
    const auto own_bus = open_bus(url);
    Sender sender(*own_bus, 967, first_sequence);
    bool through = false;
    for (int i = 0; i < 2000 && !through; ++i) {
      sender.send_good();
      std::this_thread::sleep_for(std::chrono::milliseconds(5));
      // The first sender's last commands may come late.
      through = receiver.fetch() && sender.is_one(receiver.command());
    }
    if (receiver.tally().accepted() + receiver.tally().rejected() == 0) {
      GTEST_SKIP() << "multicast does not work on this machine: " << url;
    }
    ASSERT_TRUE(through) << first_sequence;
  }
  EXPECT_GT(receiver.tally().count(Verdict::kReplayed), 0);
}

TEST(CommandReceiver, EndsWhileNobodySends) {
  for (int i = 0; i < 5; ++i) CommandReceiver receiver(open_bus("memq://"), limits_for(kJoints));
}

}  // namespace
}  // namespace dashpot::lcmtypes
