// Logs can be read back, by our reader and by the stock tools; damaged ones do no harm.
#include <dashpot/lcmtypes/message_reader.hpp>
#include <dashpot/lcmtypes/publisher.hpp>
#include <dashpot/tests/lcmtypes/random_samples.hpp>
#include <dashpot/tests/support/places.hpp>
#include <dashpot/tests/support/refusal.hpp>
#include <dashpot/tests/support/scratch.hpp>

#include <gmock/gmock.h>

#include <cstdlib>
#include <nlohmann/json.hpp>
#include <optional>
#include <stdexcept>
#include <utility>

namespace dashpot::lcmtypes {
namespace {

using ::testing::HasSubstr;
using tests::Scratch;

struct Event {
  std::int64_t utime = 0;
  Bytes bytes;
  bool operator==(const Event&) const = default;
};

/// All our messages in a log, encoded again; and how many were malformed.
std::vector<Event> read_log(const std::string& path, std::int64_t* malformed = nullptr) {
  std::vector<Event> events;
  MessageHandlers handlers;
  std::int64_t utime = 0;
  handlers.on_state = [&](const state_t& message) { events.push_back({utime, bytes_of(message)}); };
  handlers.on_modes = [&](const modes_t& message) { events.push_back({utime, bytes_of(message)}); };
  LogReader reader(path, handlers);
  while (reader.read()) {
    utime = reader.utime();
    reader.handle();
  }
  if (malformed != nullptr) *malformed = handlers.malformed;
  return events;
}

/// Publishes random samples into a log, and returns what it should hold.
std::vector<Event> write_log(const std::string& path, int ticks) {
  Random random(951);
  std::vector<std::unique_ptr<Sink>> sinks;
  sinks.push_back(make_log_sink(path));
  Publisher publisher(std::move(sinks));
  std::vector<Event> expected;
  for (int tick = 1; tick <= ticks; ++tick) {
    StateSample state = random_state(random, 7);
    ModesSample modes = random_modes(random, 7);
    state.utime = modes.utime = kNow + 1000 * tick;
    publisher.offer(state);
    publisher.offer(modes);
    publisher.publish_pending();
    expected.push_back({state.utime, bytes_of(message_of<state_t>(state))});
    auto message = message_of<modes_t>(modes);
    message.sequence = tick;
    expected.push_back({modes.utime, bytes_of(message)});
  }
  return expected;
}

TEST(Log, GivesBackWhatWasPublished) {
  const Scratch scratch;
  const std::vector<Event> expected = write_log(scratch.path("a.lcm"), 200);
  std::int64_t malformed = -1;
  EXPECT_EQ(read_log(scratch.path("a.lcm"), &malformed), expected);
  EXPECT_EQ(malformed, 0);
  write_log(scratch.path("b.lcm"), 200);
  EXPECT_EQ(scratch.read("a.lcm"), scratch.read("b.lcm"));  // the same twice
}

TEST(Log, IsReplayedByTheStockPlayer) {
  const Scratch scratch;
  const std::vector<Event> expected = write_log(scratch.path("a.lcm"), 100);
  const std::string command = "lcm-logplayer --speed=1000 --lcm-url='file://" +
                              scratch.path("b.lcm") + "?mode=w' " + scratch.path("a.lcm") + " >" +
                              scratch.path("out") + " 2>&1";
  ASSERT_EQ(std::system(command.c_str()), 0) << scratch.read("out");  // NOLINT: a fixed command
  const std::vector<Event> replayed = read_log(scratch.path("b.lcm"));
  ASSERT_EQ(replayed.size(), expected.size());
  for (std::size_t i = 0; i < expected.size(); ++i) {
    EXPECT_EQ(replayed[i].bytes, expected[i].bytes) << i;  // with the times of the replay
  }
}

TEST(Log, IsReadThroughAFileUrl) {
  const Scratch scratch;
  const std::vector<Event> expected = write_log(scratch.path("a.lcm"), 100);
  std::vector<Bytes> seen;
  MessageHandlers handlers;
  handlers.on_state = [&](const state_t& message) { seen.push_back(bytes_of(message)); };
  handlers.on_modes = [&](const modes_t& message) { seen.push_back(bytes_of(message)); };
  BusReader reader(open_bus("file://" + scratch.path("a.lcm") + "?speed=0"), handlers);
  while (seen.size() < expected.size() && reader.wait(10'000)) {
  }
  ASSERT_EQ(seen.size(), expected.size());
  for (std::size_t i = 0; i < expected.size(); ++i) EXPECT_EQ(seen[i], expected[i].bytes) << i;
}

TEST(Log, EndsWhereItIsCutOff) {
  const Scratch scratch;
  const std::vector<Event> expected = write_log(scratch.path("a.lcm"), 20);
  const std::string whole = scratch.read("a.lcm");
  for (std::size_t size = 0; size < whole.size(); size += 997) {
    const std::vector<Event> events = read_log(scratch.write("cut.lcm", whole.substr(0, size)));
    ASSERT_LE(events.size(), expected.size());
    for (std::size_t i = 0; i < events.size(); ++i) EXPECT_EQ(events[i], expected[i]) << size;
  }
}

/// An event as it stands in a log, with these lengths in place of the true ones.
std::string event_bytes(const std::string& channel, const std::string& data,
                        std::optional<std::uint32_t> channel_length = {},
                        std::optional<std::uint32_t> data_length = {}) {
  std::string bytes;
  const auto add = [&bytes](std::uint64_t value, int count) {
    while (count-- > 0) bytes += static_cast<char>(value >> (8 * count) & 0xFF);
  };
  add(0xEDA1DA01, 4);
  add(7, 8);  // number
  add(kNow, 8);
  add(channel_length.value_or(static_cast<std::uint32_t>(channel.size())), 4);
  add(data_length.value_or(static_cast<std::uint32_t>(data.size())), 4);
  return bytes + channel + data;
}

/// The channels of the events in these bytes, and the description of the log.
std::pair<std::string, std::string> channels_of(const std::string& bytes) {
  const Scratch scratch;
  LogFile log(scratch.write("a.lcm", bytes));
  std::string channels;
  while (log.read()) channels += log.event().channel + " ";
  EXPECT_FALSE(log.read());
  return {channels, describe(log.damage())};
}

using Said = std::pair<std::string, std::string>;

TEST(Log, IsReadOnAfterLengthsThatAreFalse) {
  const std::string a = event_bytes("A", "12345"), b = event_bytes("B", "");
  ASSERT_EQ(a.size(), 34u);
  EXPECT_EQ(channels_of(a + b), Said("A B ", ""));
  // 2^31 - 1 bytes of data ended the program: LCM's reader makes room for one more.
  for (const std::uint32_t length : {0x7FFFFFFFu, 0x7FFFFFFEu, 0x80000000u, 0xFFFFFFFFu, 40u}) {
    EXPECT_EQ(channels_of(a + event_bytes("X", "123", {}, length) + b),
              Said("A B ", "damaged at byte 34, 32 bytes skipped"))
        << length;
  }
  for (const std::uint32_t length : {0u, 64u, 999u, 0x7FFFFFFFu, 0xFFFFFFFFu}) {
    EXPECT_EQ(channels_of(a + event_bytes("X", "123", length) + b),
              Said("A B ", "damaged at byte 34, 32 bytes skipped"))
        << length;
  }
  const std::string longest(63, 'c');
  EXPECT_EQ(channels_of(event_bytes(longest, "1")), Said(longest + " ", ""));
  EXPECT_EQ(channels_of(event_bytes(longest + "c", "1") + b),
            Said("B ", "damaged at byte 0, 93 bytes skipped"));
  const std::string bad = event_bytes("X", "123", {}, 0x7FFFFFFF);
  EXPECT_EQ(channels_of(bad + a + bad + bad + b + "junk" + b),
            Said("A B B ", "damaged at byte 0 and 2 more times after it, 100 bytes skipped"));
}

TEST(Log, SaysWhereItIsCutOffOrDamaged) {
  const std::string a = event_bytes("A", "12345"), b = event_bytes("B", "678");
  for (std::size_t kept = 1; kept < b.size(); ++kept) {
    EXPECT_EQ(channels_of(a + b.substr(0, kept)), Said("A ", "cut off in the event at byte 34"))
        << kept;
  }
  EXPECT_EQ(channels_of(a + "junk and not an event"),
            Said("A ", "damaged at byte 34, 21 bytes skipped"));
  EXPECT_EQ(channels_of("junk" + b + "junk" + a.substr(0, 30)),
            Said("B ",
                 "damaged at byte 0 and 1 more times after it, 8 bytes skipped; cut off in "
                 "the event at byte 40"));
  EXPECT_EQ(channels_of(""), Said("", ""));
}

TEST(Log, KeepsNoDataThatIsTooLargeForAMessage) {
  const Scratch scratch;
  const std::string large(200'000, 'x');
  LogFile log(scratch.write("a.lcm", event_bytes("CAMERA", large) + event_bytes("B", "1")));
  ASSERT_TRUE(log.read());
  EXPECT_EQ(log.event().size, large.size());
  EXPECT_TRUE(log.event().data.empty());
  ASSERT_TRUE(log.read());
  EXPECT_EQ(log.event().data, std::vector<std::uint8_t>{'1'});
  EXPECT_EQ(describe(log.damage()), "");

  MessageHandlers handlers;
  LogReader reader(scratch.write("b.lcm", event_bytes(kStateChannel, large)), handlers);
  while (reader.read()) reader.handle();
  EXPECT_EQ(handlers.malformed, 1);
  EXPECT_EQ(reader.damage(), "");
}

// LCM reads it then.
TEST(Log, IsNoBusIfItIsDamaged) {
  const Scratch scratch;
  const std::string path = scratch.write(
      "a.lcm", event_bytes("A", "1") + event_bytes(kStateChannel, "123", {}, 0x7FFFFFFF));
  for (const std::string options : {"", "?speed=0", "?mode=r", "?mode=w&mode=r"}) {
    const std::string url = "file://" + path + options;
    EXPECT_EQ(testing::refusal<std::runtime_error>([&] { open_bus(url); }),
              "cannot open the LCM bus " + url + ": cut off in the event at byte 30");
  }
  EXPECT_THROW(open_bus("file:///dev/zero"), std::runtime_error);
  EXPECT_THROW(open_bus("file://" + scratch.path("none")), std::runtime_error);
}

TEST(Log, IsTheFileOfAUrl) {
  EXPECT_EQ(path_of("file://a/b.lcm?mode=w"), "a/b.lcm");
  EXPECT_EQ(path_of("file:///b.lcm"), "/b.lcm");
  EXPECT_EQ(path_of("udpm://239.255.76.67:7667?ttl=0"), "");
  EXPECT_EQ(path_of(""), "");
}

TEST(Log, DoesNoHarmWhenDamaged) {
  constexpr std::uint64_t kSeed = 952;
  Random random(kSeed);
  const Scratch scratch;
  write_log(scratch.path("a.lcm"), 10);
  const std::string whole = scratch.read("a.lcm");
  std::int64_t events = 0, malformed = 0;
  for (int i = 0; i < 150; ++i) {
    std::string damaged = whole;
    for (int k = random.integer(1, 20); k > 0; --k) {
      damaged[static_cast<std::size_t>(random.integer(0, static_cast<int>(whole.size()) - 1))] =
          static_cast<char>(random.integer(0, 255));
    }
    std::int64_t bad = 0;
    events +=
        static_cast<std::int64_t>(read_log(scratch.write("damaged.lcm", damaged), &bad).size());
    malformed += bad;
  }
  std::printf("seed %llu: %lld messages read, %lld malformed\n",
              static_cast<unsigned long long>(kSeed), static_cast<long long>(events),
              static_cast<long long>(malformed));
  EXPECT_GT(events, 150);
  EXPECT_GT(malformed, 5);
}

TEST(Log, NamesTheFileThatCannotBeOpened) {
  const std::string path = "/nonexistent/a.lcm";
  MessageHandlers handlers;
  const auto message_of_error = [](const auto& act) {
    return testing::refusal<std::runtime_error>(act);
  };
  EXPECT_EQ(message_of_error([&] { make_log_sink(path); }),
            path + ": cannot write the log: No such file or directory");
  EXPECT_EQ(message_of_error([&] { LogReader reader(path, handlers); }),
            path + ": cannot read the log: No such file or directory");
  EXPECT_THAT(message_of_error([] { open_bus("nonsense://"); }), HasSubstr("nonsense://"));
}

TEST(DefaultUrl, IsLocalUnlessTheEnvironmentSaysOtherwise) {
  const char* before = std::getenv("LCM_DEFAULT_URL");
  const std::string saved = before != nullptr ? before : "";
  unsetenv("LCM_DEFAULT_URL");
  EXPECT_EQ(default_url(), "udpm://239.255.76.67:7667?ttl=0");
  setenv("LCM_DEFAULT_URL", "memq://", 1);
  EXPECT_EQ(default_url(), "memq://");
  if (before != nullptr) {
    setenv("LCM_DEFAULT_URL", saved.c_str(), 1);
  } else {
    unsetenv("LCM_DEFAULT_URL");
  }
}

// A log read in Python, with types from the stock generator, contains the published samples.

/// Runs a command of the shell; its output, or a failure that shows what it complained of.
std::string run(const Scratch& scratch, const std::string& command) {
  const std::string line = command + " >" + scratch.path("out") + " 2>" + scratch.path("err");
  EXPECT_EQ(std::system(line.c_str()), 0) << command << '\n' << scratch.read("err");
  return scratch.read("out");
}

/// Modes as they come from the analysis: frequency, ratio and eigenvalues agree.
void make_consistent(Random& random, ModesSample& sample) {
  for (std::size_t i = 0; i < static_cast<std::size_t>(sample.vibration.count); ++i) {
    controller::VibrationMode& mode = sample.vibration.modes[i];
    const analysis::Complex first(-random.uniform(0.1, 5), random.uniform(1, 30));
    mode.eigenvalues = {first, std::conj(first)};
    mode.natural_frequency = std::abs(first);
    mode.damping_ratio = -first.real() / std::abs(first);
    mode.damped_frequency = first.imag();
  }
}

TEST(Python, ReadsALogWithGeneratedTypes) {
  const Scratch scratch;
  Random random(971);
  std::vector<StateSample> states;
  std::vector<ModesSample> modes;
  {
    std::vector<std::unique_ptr<Sink>> sinks;
    sinks.push_back(make_log_sink(scratch.path("a.lcm")));
    Publisher publisher(std::move(sinks));
    for (int n = 1; n <= controller::kMaxJoints; ++n) {
      states.push_back(random_state(random, n));
      modes.push_back(random_modes(random, n));
      make_consistent(random, modes.back());
      publisher.offer(states.back());
      publisher.offer(modes.back());
      publisher.publish_pending();
    }
  }
  const std::string source = DASHPOT_SOURCE_DIR;
  run(scratch,
      "lcm-gen --python --ppath " + scratch.path("types") + " " + source + "/lcmtypes/*.lcm");
  const std::string output = run(scratch, "python3 -B " + source + "/tests/lcmtypes/read_log.py " +
                                              scratch.path("types") + " " + scratch.path("a.lcm"));
  const auto read = nlohmann::json::parse(output);
  ASSERT_EQ(read["states"].size(), states.size());
  ASSERT_EQ(read["modes"].size(), modes.size());
  for (std::size_t i = 0; i < states.size(); ++i) {
    const controller::Snapshot& snapshot = states[i].snapshot;
    const auto& state = read["states"][i];
    EXPECT_EQ(state["tick"], snapshot.tick);
    EXPECT_EQ(state["q"], list(snapshot.position));
    EXPECT_EQ(state["torque"], list(snapshot.torque));
    double quaternion[4];
    write_quaternion(snapshot.tip.rotation, quaternion);
    EXPECT_EQ(state["quaternion"], std::vector<double>(quaternion, quaternion + 4));
    const controller::Vibration& vibration = modes[i].vibration;
    const auto& message = read["modes"][i];
    EXPECT_EQ(message["q"], list(vibration.position));
    for (std::size_t k = 0; k < static_cast<std::size_t>(vibration.count); ++k) {
      EXPECT_EQ(message["frequency"][k], vibration.modes[k].natural_frequency);
      EXPECT_EQ(message["label"][k], vibration.modes[k].label);
      const Eigen::VectorXd shape = vibration.modes[k].shape.real();
      EXPECT_EQ(message["shape"][k], list(shape));
    }
  }
}

}  // namespace
}  // namespace dashpot::lcmtypes
