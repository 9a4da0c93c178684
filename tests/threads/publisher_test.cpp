// Data of the real-time thread is published once, in order, and never holds the thread up.
#include <dashpot/lcmtypes/message_check.hpp>
#include <dashpot/lcmtypes/publisher.hpp>
#include <dashpot/tests/lcmtypes/random_samples.hpp>

#include <gmock/gmock.h>

#include <cmath>
#include <condition_variable>
#include <functional>
#include <limits>
#include <mutex>
#include <stdexcept>
#include <utility>

namespace dashpot::lcmtypes {
namespace {

using ::testing::ElementsAre;

constexpr double kNaN = std::numeric_limits<double>::quiet_NaN();

/// The data that a sink has received; it may be held up.
struct Received {
  std::mutex mutex;
  std::condition_variable changed;
  bool held_up = false;
  bool waiting = false;  ///< a message is at the sink and cannot get through
  std::vector<state_t> states;
  std::vector<modes_t> modes;
  std::vector<std::int64_t> times;
  std::vector<std::string> order;
};

class MemorySink : public Sink {
 public:
  explicit MemorySink(Received& received) : received_(received) {}

  bool send(const std::string& channel, const Bytes& bytes, std::int64_t utime) override {
    std::unique_lock lock(received_.mutex);
    received_.waiting = received_.held_up;
    received_.changed.notify_all();
    received_.changed.wait(lock, [this] { return !received_.held_up; });
    received_.waiting = false;
    received_.times.push_back(utime);
    received_.order.push_back(channel);
    if (channel == kStateChannel) {
      return decode(bytes.data(), bytes.size(), received_.states.emplace_back());
    }
    return decode(bytes.data(), bytes.size(), received_.modes.emplace_back());
  }

 private:
  Received& received_;
};

class FailingSink : public Sink {
 public:
  bool send(const std::string&, const Bytes&, std::int64_t) override { return false; }
};

std::vector<std::unique_ptr<Sink>> sink_into(Received& received) {
  std::vector<std::unique_ptr<Sink>> sinks;
  sinks.push_back(std::make_unique<MemorySink>(received));
  return sinks;
}

StateSample state_at(std::int64_t tick) {
  StateSample sample;
  sample.utime = kNow + 1000 * tick;
  sample.snapshot.tick = static_cast<std::uint64_t>(tick);
  for (auto* vector :
       {&sample.snapshot.position, &sample.snapshot.velocity, &sample.snapshot.torque,
        &sample.snapshot.law_torque, &sample.snapshot.reference_position}) {
    *vector = controller::JointVector::Constant(7, static_cast<double>(tick));
  }
  return sample;
}

std::vector<std::int64_t> ticks_of(const Received& received) {
  std::vector<std::int64_t> ticks;
  for (const state_t& message : received.states) ticks.push_back(message.tick);
  return ticks;
}

TEST(Publisher, SendsEveryStateInOrder) {
  Received received;
  Publisher publisher(sink_into(received));
  for (int tick = 1; tick <= 500; ++tick) publisher.offer(state_at(tick));
  publisher.publish_pending();
  ASSERT_EQ(received.states.size(), 500u);
  for (int tick = 1; tick <= 500; ++tick) {
    const auto i = static_cast<std::size_t>(tick - 1);
    EXPECT_EQ(received.states[i].tick, tick);
    EXPECT_EQ(received.states[i].joint_torque[6], tick);
    EXPECT_EQ(received.times[i], kNow + 1000 * tick);
  }
  EXPECT_EQ(publisher.counters().states, 500);
  EXPECT_EQ(publisher.counters().states_dropped, 0);
  PublisherOptions options;
  options.state_every = 3;
  Received few;
  Publisher every_third(sink_into(few), options);
  for (int tick = 1; tick <= 10; ++tick) every_third.offer(state_at(tick));
  every_third.publish_pending();
  EXPECT_THAT(ticks_of(few), ElementsAre(1, 4, 7, 10));
}

TEST(Publisher, CountsWhatFindsNoRoomAndSaysSoInTheNextMessage) {
  Received received;
  PublisherOptions options;
  options.queue = 4;
  Publisher publisher(sink_into(received), options);
  for (int tick = 1; tick <= 10; ++tick) publisher.offer(state_at(tick));
  publisher.publish_pending();
  EXPECT_THAT(ticks_of(received), ElementsAre(1, 2, 3, 4));
  publisher.offer(state_at(11));
  publisher.publish_pending();
  EXPECT_EQ(received.states.back().tick, 11);
  EXPECT_EQ(received.states.back().states_dropped, 6);
  EXPECT_EQ(publisher.counters().states_dropped, 6);
}

TEST(Publisher, LeavesNothingBehindAtItsEndOrWhenItIsStopped) {
  for (const bool threaded : {false, true}) {
    Received received;
    {
      Publisher publisher(sink_into(received));
      if (threaded) publisher.start();
      for (int tick = 1; tick <= 100; ++tick) publisher.offer(state_at(tick));
      for (int k = 0; k < 2 && threaded; ++k) {  // once is enough
        publisher.stop();
        EXPECT_EQ(publisher.counters().states, 100);
      }
    }
    EXPECT_EQ(received.states.size(), 100u);
  }
  Received received;
  {
    Publisher publisher(sink_into(received));
    publisher.start();
    for (int tick = 1; tick <= 100; ++tick) publisher.offer(state_at(tick));
  }
  EXPECT_EQ(received.states.size(), 100u);
}

TEST(Publisher, CountsLostMessagesAndServesTheOtherSinks) {
  Received received;
  auto sinks = sink_into(received);
  sinks.insert(sinks.begin(), std::make_unique<FailingSink>());
  Publisher publisher(std::move(sinks));
  for (int tick = 1; tick <= 3; ++tick) publisher.offer(state_at(tick));
  publisher.publish_pending();
  EXPECT_THAT(ticks_of(received), ElementsAre(1, 2, 3));
  EXPECT_EQ(publisher.counters().send_errors, 3);
  EXPECT_EQ(publisher.counters().states, 3);
}

// A sink that hangs: the writer goes on for thousands of ticks, and once the sink moves again, all
// that was in the queue arrives in order and the rest is counted.
TEST(Publisher, IsNeverHeldUpByASlowSink) {
  constexpr int kTicks = 5000;
  Received received;
  received.held_up = true;
  {
    Publisher publisher(sink_into(received));
    publisher.start();
    publisher.offer(state_at(1));
    {
      std::unique_lock lock(received.mutex);
      received.changed.wait(lock, [&] { return received.waiting; });
    }
    Random random(941);
    const ModesSample modes = random_modes(random, 7);
    for (int tick = 2; tick <= kTicks; ++tick) {
      publisher.offer(state_at(tick));  // would never return if it waited for the sink
      publisher.offer(modes);
    }
    EXPECT_EQ(publisher.counters().states, 0);
    EXPECT_EQ(publisher.counters().states_dropped, kTicks - 1 - 1024);
    const std::lock_guard lock(received.mutex);
    received.held_up = false;
    received.changed.notify_all();
  }
  ASSERT_EQ(received.states.size(), 1025u);
  for (std::size_t i = 0; i < received.states.size(); ++i) {
    EXPECT_EQ(received.states[i].tick, static_cast<std::int64_t>(i) + 1);
  }
  EXPECT_EQ(received.states.back().states_dropped, kTicks - 1 - 1024);
  EXPECT_EQ(received.modes.size(), 1u);
}

TEST(Publisher, HandsWholeSamplesFromThreadToThread) {
  constexpr int kTicks = 20'000;
  Received received;
  std::int64_t dropped = 0;
  {
    Publisher publisher(sink_into(received));
    publisher.start();
    Random random(942);
    ModesSample modes = random_modes(random, 7);
    for (int tick = 1; tick <= kTicks; ++tick) {
      publisher.offer(state_at(tick));
      modes.vibration.tick = static_cast<std::uint64_t>(tick);
      modes.vibration.position.setConstant(tick);
      publisher.offer(modes);
      if (tick % 500 == 0) std::this_thread::yield();
    }
    dropped = publisher.counters().states_dropped;
  }
  EXPECT_EQ(static_cast<std::int64_t>(received.states.size()) + dropped, kTicks);
  std::int64_t last = 0;
  for (const state_t& message : received.states) {
    ASSERT_GT(message.tick, last);
    last = message.tick;
    for (std::size_t i = 0; i < 7; ++i) {
      ASSERT_EQ(message.joint_position[i], static_cast<double>(message.tick));
      ASSERT_EQ(message.joint_torque[i], static_cast<double>(message.tick));
    }
  }
  last = 0;
  for (const modes_t& message : received.modes) {
    ASSERT_GT(message.tick, last);
    last = message.tick;
    for (const double q : message.joint_position) ASSERT_EQ(q, static_cast<double>(last));
  }
  EXPECT_EQ(last, kTicks);  // whatever was skipped, the newest arrives
}

class ModesPublisher : public ::testing::Test {
 protected:
  ModesPublisher() : random(943), publisher(sink_into(received)) {
    modes.vibration.position = random.vector(7);
    modes.utime = kNow;
    modes.vibration.count = 2;
    modes.vibration.zero_modes = 5;
    for (std::size_t i = 0; i < 2; ++i) {
      modes.vibration.modes[i].natural_frequency = 20 - 5.0 * static_cast<double>(i);
      modes.vibration.modes[i].damping_ratio = 0.4;
    }
  }

  /// Offers the modes again some time later, and says whether they were published.
  bool is_published(std::int64_t later) {
    const std::size_t before = received.modes.size();
    modes.utime += later;
    publisher.offer(modes);
    publisher.publish_pending();
    return received.modes.size() > before;
  }

  Random random;
  Received received;
  Publisher publisher;
  ModesSample modes;
};

TEST_F(ModesPublisher, RepeatsWhatIsUnchangedOncePerHeartbeat) {
  EXPECT_TRUE(is_published(0));
  for (int i = 0; i < 9; ++i) EXPECT_FALSE(is_published(100'000));
  EXPECT_EQ(publisher.counters().modes, 1);
  EXPECT_EQ(publisher.counters().modes_skipped, 9);
  int published = 0;
  for (int i = 0; i < 1000; ++i) published += is_published(10'000);
  EXPECT_EQ(published, 10);
  EXPECT_EQ(received.modes.back().sequence, 11);
}

TEST_F(ModesPublisher, PublishesAndNumbersEveryChangeOfUse) {
  ASSERT_TRUE(is_published(0));
  controller::Vibration& v = modes.vibration;
  const std::pair<const char*, std::function<void()>> changes[] = {
      {"position", [&] { v.position[3] += 2e-6; }},
      {"frequency", [&] { v.modes[1].natural_frequency *= 1 + 2e-6; }},
      {"ratio", [&] { v.modes[0].damping_ratio *= 1 - 2e-6; }},
      {"frequency lost", [&] { v.modes[0].natural_frequency = kNaN; }},
      {"kind", [&] { v.modes[0].kind = analysis::ModeKind::kUnstable; }},
      {"label", [&] { v.modes[1].label = 7; }},
      {"status", [&] { v.status = analysis::Status::kUncertified; }},
      {"zero modes", [&] { v.zero_modes = 4; }},
      {"number of modes", [&] { v.count = 3; }},
      {"not a position", [&] { v.position[0] = kNaN; }}};
  std::int64_t sequence = received.modes.back().sequence;
  for (const auto& [name, change] : changes) {
    change();
    EXPECT_TRUE(is_published(1000)) << name;
    EXPECT_EQ(received.modes.back().sequence, ++sequence);
    if (!std::isnan(v.position[0])) {
      EXPECT_FALSE(is_published(1000)) << name << " again";
    }
  }
}

// Slow drift does not creep past the tolerance: changes count from what was published.
TEST_F(ModesPublisher, FollowsASlowDrift) {
  ASSERT_TRUE(is_published(0));
  int published = 0;
  for (int i = 0; i < 100; ++i) {
    modes.vibration.position[2] += 0.25e-6;
    published += is_published(1000);
  }
  EXPECT_EQ(published, 20);
}

TEST(PublisherOptions, AreChecked) {
  const auto make = [](const PublisherOptions& options) { Publisher publisher({}, options); };
  PublisherOptions options;
  options.state_every = 0;
  EXPECT_THROW(make(options), std::invalid_argument);
  options = {};
  options.modes_heartbeat = kNaN;
  EXPECT_THROW(make(options), std::invalid_argument);
  options = {};
  options.modes_tolerance = -1;
  EXPECT_THROW(make(options), std::invalid_argument);
}

}  // namespace
}  // namespace dashpot::lcmtypes
