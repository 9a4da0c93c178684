// `dashpot monitor` on logs, on a live bus and on a terminal.
#include <dashpot/lcmtypes/publish/encode.hpp>
#include <dashpot/lcmtypes/publisher.hpp>
#include <dashpot/tests/apps/run_program.hpp>
#include <dashpot/tests/support/places.hpp>
#include <dashpot/tests/support/sanitized.hpp>

#include <gmock/gmock.h>
#include <poll.h>
#include <pty.h>

#include <atomic>
#include <chrono>
#include <csignal>
#include <filesystem>
#include <limits>
#include <sstream>
#include <thread>

namespace dashpot::tests {
namespace {

using ::testing::AllOf;
using ::testing::EndsWith;
using ::testing::HasSubstr;
using ::testing::Not;
using ::testing::StartsWith;

constexpr std::int64_t kStart = 1'700'000'000'000'000;  // us

lcmtypes::StateSample state_at(int tick) {
  lcmtypes::StateSample sample;
  sample.utime = kStart + 1000LL * tick;
  controller::Snapshot& snapshot = sample.snapshot;
  snapshot.tick = static_cast<std::uint64_t>(tick);
  snapshot.restarts = 1;
  snapshot.mode = controller::Mode::kCartesian;
  snapshot.status = tick % 10 == 0 ? controller::Status::kTorqueLimited : controller::Status::kOk;
  for (auto* vector : {&snapshot.position, &snapshot.velocity, &snapshot.torque,
                       &snapshot.law_torque, &snapshot.reference_position}) {
    *vector = controller::JointVector::LinSpaced(7, 0.1, 0.7);
  }
  snapshot.tip_error << 0.003, 0.004, 0, 0, 0, 0.01;
  sample.health.tick_time = 12'300;
  sample.health.longest_tick_time = 45'600;
  sample.health.overruns = 2;
  return sample;
}

/// The robot turns, so that every one is published.
lcmtypes::ModesSample modes_at(int tick) {
  lcmtypes::ModesSample sample;
  sample.utime = kStart + 1000LL * tick;
  controller::Vibration& vibration = sample.vibration;
  vibration.tick = static_cast<std::uint64_t>(tick);
  vibration.position = controller::JointVector::Constant(7, 1e-3 * tick);
  vibration.zero_modes = 1;
  vibration.count = 2;
  for (std::size_t i = 0; i < 2; ++i) {
    controller::VibrationMode& mode = vibration.modes[i];
    mode.label = static_cast<std::int32_t>(i + 1);
    mode.natural_frequency = i == 0 ? 20.234 : 9.761;
    mode.damping_ratio = i == 0 ? 0.25 : 1.5;
    mode.kind = i == 0 ? analysis::ModeKind::kUnderdamped : analysis::ModeKind::kOverdamped;
    mode.natural_frequency_bound = 2.5e-13;
    mode.shape.setZero(7);
    mode.shape[static_cast<Eigen::Index>(i)] = 1;
    mode.shape[5] = -0.5;
  }
  return sample;
}

/// `ticks` states, 1 ms apart, and modes with every hundredth.
void publish(lcmtypes::Publisher& publisher, int ticks, int first = 1) {
  for (int tick = first; tick < first + ticks; ++tick) {
    publisher.offer(state_at(tick));
    if (tick % 100 == 0) publisher.offer(modes_at(tick));
    publisher.publish_pending();
  }
}

lcmtypes::Publisher publisher_to(std::unique_ptr<lcmtypes::Sink> sink) {
  std::vector<std::unique_ptr<lcmtypes::Sink>> sinks;
  sinks.push_back(std::move(sink));
  return lcmtypes::Publisher(std::move(sinks));
}

/// A log of what `offer` publishes.
template <class Offer>
std::string log_of(const Scratch& scratch, const Offer& offer) {
  std::string path = scratch.path("run.lcm");
  std::filesystem::remove(path);
  lcmtypes::Publisher publisher = publisher_to(lcmtypes::make_log_sink(path));
  offer(publisher);
  publisher.publish_pending();
  return path;
}

std::string make_log(const Scratch& scratch, int ticks) {
  return log_of(scratch, [ticks](lcmtypes::Publisher& publisher) { publish(publisher, ticks); });
}

std::vector<std::string> lines_of(const std::string& text) {
  std::vector<std::string> lines;
  std::istringstream stream(text);
  for (std::string line; std::getline(stream, line);) lines.push_back(line);
  return lines;
}

TEST(Monitor, ShowsALineForEverySecondOfALog) {
  const Scratch scratch;
  const Outcome outcome = run_program({"monitor", "--log", make_log(scratch, 5500)});
  EXPECT_EQ(outcome.status, 0) << outcome.err;
  EXPECT_EQ(outcome.err, "");
  const std::vector<std::string> lines = lines_of(outcome.out);
  ASSERT_GT(lines.size(), 6u);
  for (std::size_t i = 0; i < 6; ++i) {
    EXPECT_THAT(lines[i], AllOf(StartsWith(std::to_string(i) + ".0 s  tick "),
                                HasSubstr("tick 12.3 us (longest 45.6), 2 overruns")));
  }
  EXPECT_THAT(lines[0], Not(HasSubstr("modes")));  // there are none yet
  EXPECT_THAT(lines[3], AllOf(HasSubstr("1000 ticks/s"), HasSubstr("20.23 (0.250) 9.761 (1.50)")));
  EXPECT_EQ(lines[6], "");  // the summary follows
}

TEST(Monitor, EndsALogWithASummary) {
  const Scratch scratch;
  const Outcome outcome = run_program({"monitor", "--log", make_log(scratch, 2000)});
  EXPECT_THAT(outcome.out, HasSubstr("\n2000 states and 20 modes messages over 2.0 s; "
                                     "0 modes messages lost, 0 messages malformed\n"));
  EXPECT_THAT(outcome.out, HasSubstr("  ok: 1800 states\n"));
  EXPECT_THAT(outcome.out, HasSubstr(": 200 states\n"));
  EXPECT_THAT(outcome.out, HasSubstr("2 overruns, longest 45.6 us; largest tip error 5.00 mm\n"));
  EXPECT_THAT(outcome.out, HasSubstr("2 modes, 1 zero mode at tick 2000, solved directly: ok\n"));
  const std::string last = lines_of(outcome.out).back();
  EXPECT_THAT(last, AllOf(HasSubstr("2   9.76100"), HasSubstr("overdamped"), HasSubstr("2.5e-13"),
                          HasSubstr("q2 - 0.50 q6")));
}

TEST(Monitor, ShowsTheSampledLoop) {
  const Scratch scratch;
  const auto summary = [&scratch](double radius, double margin) {
    lcmtypes::SampledModesSample sample;
    sample.utime = kStart;
    sample.vibration.tick = 501;
    sample.vibration.position = controller::JointVector::Zero(7);
    sample.vibration.spectral_radius = radius;
    sample.vibration.gain_margin = margin;
    sample.vibration.count = 1;
    sample.vibration.modes[0] = {analysis::ModeKind::kUnderdamped, 20.25, 0.7, 20.5, 0.65, 15.5};
    const std::string path =
        log_of(scratch, [&](lcmtypes::Publisher& publisher) { publisher.offer(sample); });
    return run_program({"monitor", "--log", path}).out;
  };
  const std::string stable = summary(0.999, 3.25);
  EXPECT_THAT(stable, HasSubstr("Sampled loop at the end\n  tick 501: stable; all gains can grow "
                                "to 3.25 times what they are\n"));
  EXPECT_THAT(lines_of(stable).back(),
              ::testing::ContainsRegex("20.2500 +0.700000 +20.5000 +0.650000 +underdamped"));
  EXPECT_THAT(summary(1.001, 0.5), HasSubstr("UNSTABLE; all gains have to shrink to 0.500 of"));
  EXPECT_THAT(summary(0.5, std::numeric_limits<double>::infinity()),
              HasSubstr("stable, however large the gains"));
}

TEST(Monitor, CountsMalformedAndLostMessages) {
  const Scratch scratch;
  const std::string path = scratch.path("bad.lcm");
  {
    const auto sink = lcmtypes::make_log_sink(path);
    std::vector<std::uint8_t> bytes(100, 0xab);
    EXPECT_TRUE(sink->send(lcmtypes::kStateChannel, bytes, kStart));
    EXPECT_TRUE(sink->send(lcmtypes::kModesChannel, bytes, kStart));
    EXPECT_TRUE(sink->send("SOMETHING_ELSE", bytes, kStart));
    modes_t message{};
    lcmtypes::fill(modes_at(1), message);
    for (const int sequence : {1, 2, 6}) {
      message.sequence = sequence;
      lcmtypes::encode(message, bytes);
      EXPECT_TRUE(sink->send(lcmtypes::kModesChannel, bytes, kStart));
    }
  }
  const Outcome outcome = run_program({"monitor", "--log", path});
  EXPECT_EQ(outcome.status, 0);
  EXPECT_THAT(outcome.out, HasSubstr("0 states and 3 modes messages over 0.0 s; "
                                     "3 modes messages lost, 2 messages malformed\n"));
}

std::string summary_of_ticks(const std::vector<int>& ticks) {
  const Scratch scratch;
  const auto offer = [&ticks](lcmtypes::Publisher& publisher) {
    for (const int tick : ticks) {
      publisher.offer(state_at(tick));
      publisher.publish_pending();
    }
  };
  return run_program({"monitor", "--log", log_of(scratch, offer)}).out;
}

TEST(Monitor, WarnsOfASecondLoopOnTheBus) {
  std::vector<int> apart, together, slow;
  for (int i = 1; i <= 50; ++i) {
    apart.insert(apart.end(), {5000 + i, 20 + i});
    together.insert(together.end(), {i, i});
    slow.push_back(5000 + i);
    if (i % 10 == 0) slow.push_back(i / 10);
  }
  for (const auto& ticks : {apart, together, slow}) {
    const std::string shown = summary_of_ticks(ticks);
    EXPECT_THAT(shown, HasSubstr("\n  Warning: more than one loop sends to this bus: "));
  }
}

TEST(Monitor, TakesALoopThatIsStartedAnewForOne) {
  std::vector<int> ticks;
  for (int run = 0; run < 8; ++run) {
    for (int i = 1; i <= 100; i += i % 9 == 0 ? 3 : 1) ticks.push_back(i);  // some get lost
  }
  EXPECT_THAT(summary_of_ticks(ticks), Not(HasSubstr("more than one loop")));
  ticks.clear();
  for (int i = 1; i <= 50; ++i) ticks.insert(ticks.end(), i % 10 == 0 ? 20 : 1, i);  // it pauses
  EXPECT_THAT(summary_of_ticks(ticks), Not(HasSubstr("more than one loop")));
}

TEST(Monitor, SaysWhereALogIsDamagedOrCutOff) {
  const Scratch scratch;
  make_log(scratch, 500);
  const std::string whole = scratch.read("run.lcm");
  const auto shown = [&scratch](const std::string& bytes) {
    const Outcome outcome = run_program({"monitor", "--log", scratch.write("a.lcm", bytes)});
    EXPECT_EQ(outcome.status, 0) << outcome.err;
    return outcome.out;
  };
  EXPECT_THAT(shown(whole), Not(HasSubstr("The log is")));
  const std::string sync = "\xED\xA1\xDA\x01";
  const std::size_t last = whole.rfind(sync);
  EXPECT_THAT(
      shown(whole.substr(0, whole.size() - 1)),
      EndsWith("\nThe log is cut off in the event at byte " + std::to_string(last) + ".\n"));
  std::string damaged = whole;  // the length of the first event's data: 2^31 - 1
  damaged.replace(24, 4, "\x7F\xFF\xFF\xFF");
  const std::size_t second = whole.find(sync, 1);
  const std::string out = shown(damaged);
  EXPECT_THAT(out, HasSubstr("\n499 states and 5 modes messages"));
  EXPECT_THAT(out, EndsWith("\nThe log is damaged at byte 0, " + std::to_string(second) +
                            " bytes skipped.\n"));
}

TEST(Monitor, BearsTimesAndTicksOfAnySize) {
  constexpr std::int64_t kLeast = std::numeric_limits<std::int64_t>::min();
  constexpr std::int64_t kMost = std::numeric_limits<std::int64_t>::max();
  const Scratch scratch;
  const auto offer = [&](lcmtypes::Publisher& publisher) {
    for (const std::int64_t number : {kMost, kLeast, kMost - 1, kLeast, std::int64_t{0}, kMost}) {
      lcmtypes::StateSample state = state_at(1);
      lcmtypes::ModesSample modes = modes_at(1);
      state.utime = modes.utime = number;
      state.snapshot.tick = modes.vibration.tick = static_cast<std::uint64_t>(number);
      publisher.offer(state);
      publisher.offer(modes);
      publisher.publish_pending();
    }
  };
  const Outcome outcome = run_program({"monitor", "--log", log_of(scratch, offer)});
  EXPECT_EQ(outcome.status, 0) << outcome.err;
  EXPECT_THAT(outcome.out, HasSubstr("\n6 states and "));
}

TEST(Monitor, NamesWhatIsWrongWithItsInput) {
  const Scratch scratch;
  const std::string text = scratch.write("a.txt", std::string(200, 'x'));
  expect_refusals({"monitor"},
                  {
                      {{"--log", "/nonexistent/a.lcm"},
                       "/nonexistent/a.lcm: cannot read the log: No such file or directory"},
                      {{"--log", text}, "a.txt: is not an LCM log"},
                      {{"--log", scratch.path("")}, "cannot read the log: Is a directory"},
                      {{"--log", ""}, "--log: names no file"},
                      {{"--log", text, "--speed", "nan"}, "--speed"},
                      {{"--lcm-url", "carrier-pigeon://x"}, "carrier-pigeon://x"},
                      {{"--log", "a", "--lcm-url", "memq://"}, "--lcm-url"},
                      {{"--log", "a", "--speed", "-1"}, "--speed"},
                  });
}

/// A `dashpot monitor` that runs beside the test, on a terminal of its own.
class OnTerminal {
 public:
  explicit OnTerminal(std::vector<std::string> arguments) {
    std::vector<char*> argv = {const_cast<char*>(DASHPOT_PROGRAM)};
    for (std::string& argument : arguments) argv.push_back(argument.data());
    argv.push_back(nullptr);
    const winsize size = {40, 120, 0, 0};
    child_ = forkpty(&terminal_, nullptr, nullptr, &size);
    if (child_ == 0) {
      execv(argv[0], argv.data());
      _exit(127);
    }
  }
  OnTerminal(const OnTerminal&) = delete;
  OnTerminal& operator=(const OnTerminal&) = delete;
  ~OnTerminal() {
    if (child_ > 0) kill(child_, SIGKILL), waitpid(child_, nullptr, 0);
    close(terminal_);
  }

  /// Reads until `text` appears; false if it has not before a hang is sure.
  bool wait_for(const std::string& text) {
    const auto end = std::chrono::steady_clock::now() + testing::kHang;
    while (shown_.find(text) == std::string::npos) {
      if (std::chrono::steady_clock::now() > end || !read_some()) return false;
    }
    return true;
  }
  /// Ctrl-C.
  void interrupt() const { EXPECT_EQ(write(terminal_, "\003", 1), 1); }
  /// Reads to the end; the exit status.
  int finish() {
    while (read_some()) {
    }
    int status = 0;
    waitpid(child_, &status, 0);
    child_ = 0;
    return WIFEXITED(status) ? WEXITSTATUS(status) : 128 + WTERMSIG(status);
  }
  const std::string& shown() const { return shown_; }

 private:
  bool read_some() {
    pollfd ready = {terminal_, POLLIN, 0};
    if (poll(&ready, 1, std::chrono::milliseconds(testing::kHang).count()) <= 0) return false;
    char buffer[4096];
    const ssize_t size = read(terminal_, buffer, sizeof buffer);
    if (size > 0) shown_.append(buffer, static_cast<std::size_t>(size));
    return size > 0;
  }

  pid_t child_ = 0;
  int terminal_ = -1;
  std::string shown_;
};

TEST(Monitor, UpdatesATerminalInPlaceAndLeavesItClean) {
  const Scratch scratch;
  OnTerminal monitor({"monitor", "--log", make_log(scratch, 700), "--speed", "2"});
  EXPECT_EQ(monitor.finish(), 0);
  const std::string& shown = monitor.shown();
  EXPECT_THAT(shown, StartsWith("\033[?1049h\033[?25l\033[?7l\033[H"));
  const std::size_t end = shown.find("\033[?7h\033[?25h\033[?1049l");
  ASSERT_NE(end, std::string::npos);
  const std::string drawn = shown.substr(0, end);
  EXPECT_THAT(drawn, HasSubstr("\033[1mModes\033[0m"));
  EXPECT_THAT(drawn, HasSubstr("2 modes, 1 zero mode at tick"));
  int screens = 0;
  for (std::size_t at = 0; (at = drawn.find("\033[H", at)) != std::string::npos; ++at) ++screens;
  EXPECT_GE(screens, 2);
  EXPECT_LE(screens, 700 / 2);  // not one for each message
  EXPECT_THAT(shown.substr(end), HasSubstr("700 states and 7 modes messages over 0.7 s"));
}

TEST(Monitor, FollowsABusUntilCtrlC) {
  const std::string url = own_url();
  lcmtypes::Publisher publisher = publisher_to(lcmtypes::make_bus_sink(lcmtypes::open_bus(url)));
  OnTerminal monitor({"monitor", "--lcm-url", url});
  ASSERT_TRUE(monitor.wait_for("waiting for messages"));
  std::atomic<bool> stop{false};
  std::thread controller([&] {
    for (int first = 1; !stop.load(); first += 20) {  // at 1 kHz
      publish(publisher, 20, first);
      std::this_thread::sleep_for(std::chrono::milliseconds(20));
    }
  });
  const bool seen = monitor.wait_for("2 modes, 1 zero mode at tick ");
  stop.store(true);
  controller.join();
  if (!seen) GTEST_SKIP() << "multicast does not work on this machine: " << url;
  monitor.interrupt();
  EXPECT_EQ(monitor.finish(), 0);
  EXPECT_THAT(monitor.shown(), HasSubstr("messages malformed\r\n"));
}

TEST(Monitor, WaitsForAControllerAndEndsOnCtrlCWithoutOne) {
  OnTerminal monitor({"monitor", "--lcm-url", own_url()});
  ASSERT_TRUE(monitor.wait_for("waiting for messages"));
  monitor.interrupt();
  EXPECT_EQ(monitor.finish(), 0);
  EXPECT_THAT(monitor.shown(), HasSubstr("0 states and 0 modes messages"));
}

}  // namespace
}  // namespace dashpot::tests
