// `dashpot run` in real time: beside a bus, commands and whoever listens.
#include <dashpot/lcmtypes/bus.hpp>
#include <dashpot/lcmtypes/command_t.hpp>
#include <dashpot/lcmtypes/message_reader.hpp>
#include <dashpot/tests/apps/run_program.hpp>

#include <gmock/gmock.h>

#include <chrono>
#include <csignal>
#include <fstream>
#include <iterator>
#include <lcm/lcm-cpp.hpp>
#include <nlohmann/json.hpp>
#include <thread>

namespace dashpot::tests {
namespace {

using Clock = std::chrono::steady_clock;
using Json = nlohmann::json;
using ::testing::HasSubstr;

/// A `dashpot` that runs beside the test, with its output in files.
class Running {
 public:
  explicit Running(std::vector<std::string> words) {
    words.insert(words.begin(), DASHPOT_PROGRAM);
    std::vector<char*> argv;
    for (std::string& word : words) argv.push_back(word.data());
    argv.push_back(nullptr);
    child_ = fork();
    if (child_ != 0) return;
    if (std::freopen(out().c_str(), "w", stdout) == nullptr ||
        std::freopen(err().c_str(), "w", stderr) == nullptr) {
      _exit(126);
    }
    execv(argv[0], argv.data());
    _exit(127);
  }
  Running(const Running&) = delete;
  Running& operator=(const Running&) = delete;
  ~Running() {
    if (child_ > 0) kill(child_, SIGKILL), waitpid(child_, nullptr, 0);
  }

  void send(int signal) const { kill(child_, signal); }
  /// Waits for the end; the exit status.
  int finish() {
    int status = 0;
    waitpid(child_, &status, 0);
    child_ = 0;
    return WIFEXITED(status) ? WEXITSTATUS(status) : 128 + WTERMSIG(status);
  }
  std::string out() const { return scratch_.path("out"); }
  std::string err() const { return scratch_.path("err"); }
  std::string output() const { return scratch_.read("out"); }
  std::string complaints() const { return scratch_.read("err"); }

 private:
  Scratch scratch_;
  pid_t child_ = 0;
};

/// What comes over a bus.
class Listener {
 public:
  explicit Listener(const std::string& url) : bus_(lcmtypes::open_bus(url)) {
    handlers_.on_state = [this](const state_t& message) {
      ++states;
      state = message;
    };
    handlers_.on_modes = [this](const modes_t& message) {
      ++modes_messages;
      modes = message;
    };
    handlers_.on_sampled_modes = [this](const sampled_modes_t& message) {
      ++sampled_messages;
      sampled = message;
    };
    reader_.emplace(bus_, handlers_);
  }

  /// Listens until `done()`; false if it was not within ten seconds.
  template <class Done>
  bool until(const Done& done) {
    const auto end = Clock::now() + std::chrono::seconds(10);
    while (!done()) {
      if (Clock::now() > end) return false;
      reader_->wait(50);
    }
    return true;
  }
  lcm::LCM& bus() { return *bus_; }
  std::int64_t malformed() const { return handlers_.malformed; }

  std::int64_t states = 0, modes_messages = 0, sampled_messages = 0;
  state_t state{};
  modes_t modes{};
  sampled_modes_t sampled{};

 private:
  std::shared_ptr<lcm::LCM> bus_;
  lcmtypes::MessageHandlers handlers_;
  std::optional<lcmtypes::BusReader> reader_;
};

std::int64_t utime() {
  return std::chrono::duration_cast<std::chrono::microseconds>(
             std::chrono::system_clock::now().time_since_epoch())
      .count();
}

/// A command for a Panda that moves joint 1 in joint mode.
command_t joint_command(const state_t& state, double first_joint, std::int64_t sequence) {
  command_t command{};
  command.n = state.n;
  command.utime = utime();
  command.sequence = sequence;
  command.parts = int{command_t::MODE} + int{command_t::JOINT_POSITION};
  command.mode = command_t::JOINT;
  command.joint_position = state.joint_position_goal;
  command.joint_position[0] = first_joint;
  command.tip_quaternion[0] = 1;
  const auto n = static_cast<std::size_t>(state.n);
  command.joint_stiffness.assign(n, std::vector<double>(n));
  command.joint_damping = command.joint_stiffness;
  command.null_stiffness.assign(n, 0);
  command.null_damping.assign(n, 0);
  return command;
}

TEST(RunInRealTime, PublishesStatesAndModesUntilCtrlC) {
  const std::string url = own_url();
  Listener listener(url);
  Running run({"run", scene("panda_release_c2"), "--lcm-url", url, "--duration", "60", "--json"});
  if (!listener.until([&] { return listener.states > 100 && listener.modes_messages > 5; })) {
    GTEST_SKIP() << "multicast does not work on this machine: " << url;
  }
  EXPECT_EQ(listener.malformed(), 0);
  EXPECT_EQ(listener.state.n, 7);
  EXPECT_EQ(listener.state.mode, state_t::CARTESIAN);
  EXPECT_EQ(listener.modes.zero_modes, 1);
  EXPECT_EQ(listener.modes.num_modes, 6);
  EXPECT_NEAR(static_cast<double>(listener.state.utime), static_cast<double>(utime()), 20e6);
  run.send(SIGINT);
  EXPECT_EQ(run.finish(), 0);
  const Json result = Json::parse(run.output());
  EXPECT_EQ(result["interrupted"], true);
  EXPECT_EQ(result["real_time"], true);
  EXPECT_LT(result["ticks"].get<int>(), 60'000);
  EXPECT_EQ(result["messages"]["states"], result["ticks"]);
}

TEST(RunInRealTime, TakesGoodCommandsAndKeepsTheLastOne) {
  const std::string url = own_url();
  Listener listener(url);
  Running run({"run", scene("panda_release_c2"), "--lcm-url", url, "--duration", "60", "--json"});
  if (!listener.until([&] { return listener.states > 100; })) {
    GTEST_SKIP() << "multicast does not work on this machine: " << url;
  }
  const command_t good = joint_command(listener.state, 0.1, 1);
  listener.bus().publish(lcmtypes::kCommandChannel, &good);
  EXPECT_TRUE(listener.until([&] { return listener.state.commands_accepted == 1; }));
  // A repetition, one that is not for this robot, one far beyond its limits, and noise.
  listener.bus().publish(lcmtypes::kCommandChannel, &good);
  command_t wrong = joint_command(listener.state, 9, 2);
  listener.bus().publish(lcmtypes::kCommandChannel, &wrong);
  wrong = joint_command(listener.state, 0.3, 3);
  wrong.utime -= 3'600'000'000;
  listener.bus().publish(lcmtypes::kCommandChannel, &wrong);
  const std::vector<std::uint8_t> noise(300, 0x5a);
  listener.bus().publish(lcmtypes::kCommandChannel, noise.data(), 300U);
  EXPECT_TRUE(listener.until([&] { return listener.state.commands_rejected == 4; }));
  EXPECT_EQ(listener.state.commands_accepted, 1);
  // Nobody sends any more, and the robot goes where it was told, without a complaint.
  EXPECT_TRUE(listener.until([&] {
    return listener.state.mode == state_t::JOINT &&
           std::abs(listener.state.joint_position_goal[0] - 0.1) < 1e-9;
  }));
  const std::int64_t tick = listener.state.tick;
  EXPECT_TRUE(listener.until([&] { return listener.state.tick > tick + 2500; }));
  EXPECT_EQ(listener.state.status, 0);  // not stale
  run.send(SIGTERM);
  EXPECT_EQ(run.finish(), 0);
  const Json result = Json::parse(run.output());
  EXPECT_EQ(result["commands"]["accepted"], 1);
  EXPECT_EQ(result["commands"]["rejected"], 4);
}

TEST(RunInRealTime, PublishesTheSampledLoop) {
  const std::string url = own_url();
  Listener listener(url);
  Running run({"run", scene("panda"), "--lcm-url", url, "--duration", "60", "--json"});
  if (!listener.until([&] { return listener.states > 100; })) {
    GTEST_SKIP() << "multicast does not work on this machine: " << url;
  }
  ASSERT_TRUE(listener.until([&] { return listener.sampled_messages >= 2; }));
  EXPECT_EQ(listener.malformed(), 0);
  run.send(SIGTERM);
  EXPECT_EQ(run.finish(), 0);
  const sampled_modes_t& sampled = listener.sampled;
  EXPECT_EQ(sampled.n, 7);
  EXPECT_EQ(sampled.status, 0);
  EXPECT_LT(sampled.spectral_radius, 1);
  EXPECT_GT(sampled.gain_margin, 1);
  ASSERT_GE(sampled.num_modes, 6);
  for (std::size_t i = 0; i < 6; ++i) {  // a mode that is slow changes little
    if (sampled.continuous_frequency[i] > 30) continue;
    EXPECT_NEAR(sampled.natural_frequency[i], sampled.continuous_frequency[i],
                0.1 * sampled.continuous_frequency[i]);
  }
  EXPECT_GE(Json::parse(run.output())["messages"]["sampled_modes"].get<int>(), 2);
}

TEST(RunInRealTime, DoesNotNoticeWhoListens) {
  const std::string url = own_url();
  Listener listener(url);
  Running run({"run", scene("ur5"), "--lcm-url", url, "--duration", "3", "--json"});
  if (!listener.until([&] { return listener.states > 100; })) {
    GTEST_SKIP() << "multicast does not work on this machine: " << url;
  }
  for (int i = 0; i < 3; ++i) {
    Running monitor({"monitor", "--lcm-url", url});
    std::this_thread::sleep_for(std::chrono::milliseconds(200));
    monitor.send(SIGKILL);
    EXPECT_EQ(monitor.finish(), 128 + SIGKILL);
  }
  EXPECT_EQ(run.finish(), 0);
  const Json result = Json::parse(run.output());
  EXPECT_EQ(result["ticks"], 3000);
  EXPECT_EQ(result["status"], Json({{"ok", 3000}}));
  EXPECT_EQ(result["messages"]["errors"], 0);
}

/// Waits for the first row of a table that a run writes; false if there is none within ten seconds.
bool has_a_row(const std::string& csv) {
  const auto end = Clock::now() + std::chrono::seconds(10);
  while (Clock::now() < end) {
    std::ifstream table(csv);
    std::string heading, row;
    if (std::getline(table, heading) && std::getline(table, row)) return true;
    std::this_thread::sleep_for(std::chrono::milliseconds(10));
  }
  return false;
}

// Whoever takes the processor away for longer than a period makes no tick slower.
TEST(RunInFastMotion, CountsItsOwnComputingAlone) {
  Running run({"run", scene("panda_release_c2"), "--fast", "--duration", "60", "--json"});
  for (int i = 0; i < 150; ++i) {
    run.send(SIGSTOP);
    std::this_thread::sleep_for(std::chrono::milliseconds(2));
    run.send(SIGCONT);
    std::this_thread::sleep_for(std::chrono::milliseconds(5));
  }
  EXPECT_EQ(run.finish(), 0) << run.complaints();
  const Json result = Json::parse(run.output());
  EXPECT_EQ(result["ticks"], 60'000);
  EXPECT_LT(result["overruns"], 50);  // of 150 interruptions, each longer than a period
}

// The releases take long with a period this short; the run itself is over when its table is there.
TEST(RunInFastMotion, EndsItsRingDownOnCtrlC) {
  const Scratch scratch;
  std::ifstream original(scene("panda_release_c1"));
  std::string text(std::istreambuf_iterator<char>(original), {});
  text.replace(text.find("../models"), 9, std::string(DASHPOT_SOURCE_DIR) + "/sim/models");
  const std::string control = "control:\n";
  ASSERT_NE(text.find(control), std::string::npos);
  text.insert(text.find(control) + control.size(), "  period: 100 us\n");
  text.insert(text.find(control), "motion: {smoothing: 10 ms}\n");
  const std::string file = scratch.write("slow.yaml", text), csv = scratch.path("states.csv");
  Running run(
      {"run", file, "--fast", "--ring-down", "--duration", "0.0001", "--csv", csv, "--json"});
  ASSERT_TRUE(has_a_row(csv)) << run.complaints();
  run.send(SIGINT);
  EXPECT_EQ(run.finish(), 0) << run.complaints();
  const Json result = Json::parse(run.output());
  EXPECT_EQ(result["ticks"], 1);
  EXPECT_EQ(result["interrupted"], true);
  EXPECT_FALSE(result.contains("ring_down"));
}

TEST(RunInRealTime, ShowsHowFarItIs) {
  Running run({"run", scene("chain3"), "--duration", "4.5", "--lcm-url", own_url()});
  EXPECT_EQ(run.finish(), 0);
  EXPECT_THAT(run.complaints(), HasSubstr(" of 4.5 s, "));
  EXPECT_THAT(run.output(), HasSubstr("4500 ticks of 1.00 ms, in real time; "));
}

}  // namespace
}  // namespace dashpot::tests
