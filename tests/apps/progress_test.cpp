// Long tasks: their progress, and their results after Ctrl-C.
#include <dashpot/tests/apps/run_program.hpp>
#include <dashpot/tests/apps/scene_run.hpp>
#include <dashpot/tests/support/dice.hpp>
#include <dashpot/tests/support/sanitized.hpp>

#include <gmock/gmock.h>
#include <poll.h>
#include <sys/stat.h>

#include <array>
#include <csignal>
#include <cstdlib>
#include <functional>

namespace dashpot::tests {
namespace {

using ::testing::HasSubstr;
using ::testing::Not;

/// Runs `dashpot ARGUMENTS...` with a terminal as standard error, which is read into Outcome::err.
/// Calls `on_text` after each piece of it with the program and all that was read.
Outcome run_on_terminal(const Words& arguments,
                        const std::function<void(Running&, const std::string&)>& on_text) {
  const int terminal = posix_openpt(O_RDWR | O_NOCTTY);
  if (terminal < 0 || grantpt(terminal) != 0 || unlockpt(terminal) != 0) {
    throw std::runtime_error("no terminal");
  }
  Running program(arguments, {.out = {}, .err = ptsname(terminal)});
  Outcome outcome;
  bool ended = false;
  const auto read_on = [&] {
    pollfd ready{terminal, POLLIN, 0};
    char text[1024];
    while (poll(&ready, 1, 20) == 1 && (ready.revents & POLLIN) != 0) {
      const ssize_t size = read(terminal, text, sizeof text);
      if (size <= 0) break;
      outcome.err.append(text, static_cast<std::size_t>(size));
      if (!ended) on_text(program, outcome.err);
    }
  };
  while (!ended) {
    read_on();
    ended = program.ended();
  }
  read_on();
  close(terminal);
  outcome.status = program.finish();
  outcome.out = program.output();
  return outcome;
}

/// The same, ended by Ctrl-C once a bar is seen.
Outcome interrupted(const Words& arguments) {
  bool sent = false;
  return run_on_terminal(arguments, [&](Running& program, const std::string& text) {
    if (sent || text.find(" %") == std::string::npos) return;
    program.send(SIGINT);
    sent = true;
  });
}

const Words kTaskStiffness = {"--task-stiffness", "200,200,200,20,20,20"};

TEST(Progress, OfAnAuditIsABarAndCtrlCLeavesWhatWasDone) {
  const Outcome outcome = interrupted(
      joined(of_panda("audit", kTaskStiffness), {"--damping-factor", "2", "--samples", "3000000"}));
  EXPECT_EQ(outcome.status, 130);
  EXPECT_THAT(outcome.err, HasSubstr("\r\033[K["));
  EXPECT_THAT(outcome.err, HasSubstr(" of 3000000 postures were audited"));
  EXPECT_THAT(outcome.out, HasSubstr("(interrupted: no more were done)"));
}

TEST(Progress, OfARegionSaysThatThereIsNothingYet) {
  DASHPOT_SKIP_IF_QUICK();
  const Outcome outcome =
      interrupted(joined(of_panda("design", kTaskStiffness),
                         {"--damping-ratio", "0.7", "--region", "--samples", "20000"}));
  EXPECT_EQ(outcome.status, 130);
  EXPECT_THAT(outcome.err, HasSubstr("it has no damping to show before its end"));
  EXPECT_EQ(outcome.out, "");
}

/// Five oscillators in five channels, shaken for four minutes by a force that was measured. Of
/// their 24002 samples there are 24001 differences, a prime number, which must not take a Fourier
/// transform longer.
TEST(Progress, OfAnIdentificationIsABarAndCtrlCLeavesTheModesFoundUntilThen) {
  const Scratch scratch;
  std::string text = "time [s],x1 [m],x2 [m],x3 [m],x4 [m],x5 [m],force [N]\n";
  testing::Dice draw(11);
  std::array<double, 5> x{}, v{};
  for (int i = 0; i < 24002; ++i) {
    const double force = draw.normal();
    text += std::to_string(0.01 * i);
    for (std::size_t k = 0; k < x.size(); ++k) {
      const double w = 3 + 7 * static_cast<double>(k);
      text += "," + std::to_string(x[k] + 0.3 * x[(k + 1) % x.size()] + 1e-3 * draw.normal());
      v[k] += 0.01 * (-w * w * x[k] - 0.1 * w * v[k] + 10 * force);
      x[k] += 0.01 * v[k];
    }
    text += "," + std::to_string(force) + "\n";
  }
  Words words = {"identify", "--inputs", "force"};
  for (int k = 0; k < 4; ++k) {  // no record is a copy of another
    text += "\n";
    words.push_back(scratch.write("shaken" + std::to_string(k) + ".csv", text));
  }
  const Outcome outcome = interrupted(words);
  EXPECT_EQ(outcome.status, 130);
  EXPECT_THAT(outcome.err, HasSubstr("\r\033[K["));
  EXPECT_THAT(outcome.err, HasSubstr("the modes above are those found until then"));
  EXPECT_THAT(outcome.out, HasSubstr("4 driven records of 5 channels at 1 posture"));
}

TEST(Progress, OfManySystemsIsABarAndCtrlCLeavesThoseDone) {
  const Scratch scratch;
  constexpr int kSize = 12;  // which takes some tenths of a millisecond
  std::string mass, stiffness, text;
  for (int i = 0; i < kSize; ++i) {
    std::string row[2];
    for (int j = 0; j < kSize; ++j) {
      row[0] += (j > 0 ? "," : "") + std::string(i == j ? "2" : "0");
      row[1] += (j > 0 ? "," : "") + std::string(i == j ? "30" : std::abs(i - j) == 1 ? "-1" : "0");
    }
    mass += (i > 0 ? ",[" : "[") + row[0] + "]";
    stiffness += (i > 0 ? ",[" : "[") + row[1] + "]";
  }
  // More than a bar waits for, whatever the processor.
  const std::string count = testing::quick() ? "2000" : "10000";
  for (int i = 0; i < std::stoi(count); ++i) {
    text += "- {mass: [" + mass + "], stiffness: [" + stiffness + "]}\n";
  }
  const Outcome outcome =
      interrupted({"design", "--damping-ratio", "0.7", scratch.write("a.yaml", text)});
  EXPECT_EQ(outcome.status, 130);
  EXPECT_THAT(outcome.err, HasSubstr(" of " + count + " systems are done"));
  EXPECT_TRUE(outcome.out.starts_with("[0] damping\n")) << outcome.out.substr(0, 80);
}

TEST(Progress, OfARunTellsTimesAndOverruns) {
  const Outcome outcome = run_on_terminal(
      {"run", scene("ur5"), "--duration", "2.5", "--lcm-url", own_url()}, [](Running&, auto&) {});
  EXPECT_EQ(outcome.status, 0);
  EXPECT_THAT(outcome.err, HasSubstr(" of 2.50 s, "));
  EXPECT_THAT(outcome.err, HasSubstr(" overruns"));
  EXPECT_TRUE(outcome.err.ends_with("\r\033[K")) << outcome.err;
}

TEST(Progress, IsNotWrittenToFiles) {
  const Outcome outcome =
      run_program({"run", scene("ur5"), "--duration", "1.5", "--lcm-url", own_url()});
  EXPECT_EQ(outcome.err, "");
}

TEST(Progress, CtrlCEndsAnExportWithWholeFiles) {
  const Scratch scratch;
  const std::string log = scratch.path("a.lcm"), pipe = scratch.path("pipe");
  const std::string csv = scratch.path("a.csv");
  ASSERT_EQ(run_scene(scene("panda_release_c1"), {"--duration", "1", "--log", log}).status, 0);
  ASSERT_EQ(mkfifo(pipe.c_str(), 0600), 0);
  const std::string text = text_of(log);
  const pid_t writer = fork();  // keeps the log open, as if it went on
  if (writer == 0) {
    const int end = open(pipe.c_str(), O_WRONLY);
    const bool written = write(end, text.data(), text.size()) > 0;
    for (;;) written ? pause() : (_exit(1), 0);
  }
  Running program({"export", pipe, "--csv", csv});
  while (text_of(csv).empty() && !program.ended()) usleep(10'000);
  program.send(SIGINT);
  EXPECT_EQ(program.finish(), 130);
  kill(writer, SIGKILL);
  waitpid(writer, nullptr, 0);
  EXPECT_THAT(program.output(), HasSubstr(" messages exported, "));
  EXPECT_THAT(program.complaints(), HasSubstr("interrupted: the files hold"));
  ASSERT_FALSE(text_of(csv).empty());
  EXPECT_EQ(text_of(csv).back(), '\n');
}

TEST(Progress, CtrlCEndsACheckOfAModelAtOnce) {
  const Scratch scratch;
  const std::string pipe = scratch.path("pipe.csv");
  ASSERT_EQ(mkfifo(pipe.c_str(), 0600), 0);
  Running program({"check-model", pipe, "--config", scene("panda_release_c1")});
  int end = -1;
  while (end < 0 && !program.ended()) {  // until it reads, and waits for more
    end = open(pipe.c_str(), O_WRONLY | O_NONBLOCK);
    usleep(10'000);
  }
  ASSERT_FALSE(program.ended());
  program.send(SIGINT);
  EXPECT_EQ(program.finish(), 130);
  close(end);
  EXPECT_EQ(program.complaints(), "dashpot check-model: interrupted\n");
}

/// If every write fails, each writer says so, with the name of the file.
TEST(FullDisk, IsAnErrorOfEveryWriter) {
  if (!std::filesystem::exists("/dev/full")) GTEST_SKIP() << "no /dev/full here";
  const Scratch scratch;
  const std::string log = scratch.path("a.lcm"), full = "/dev/full";
  const Words short_run = {"run", scene("panda_release_c1"), "--fast", "--duration"};
  ASSERT_EQ(run_program(joined(short_run, {"3", "--log", log})).status, 0);
  const Words region = {"--damping-ratio", "0.7", "--region", "--samples", "4"};
  for (const auto& [words, option] :
       {std::pair(joined(short_run, {"0.003", "--log", full}), "--log"),
        {joined(short_run, {"0.003", "--csv", full}), "--csv"},
        {joined(short_run, {"1", "--csv", full}), "--csv"},
        {Words{"export", log, "--mcap", full}, "--mcap"},
        {Words{"export", log, "--csv", full}, "--csv"},
        {joined(joined(of_panda("design", kTaskStiffness), region), {"--csv", full}), "--csv"},
        {joined(of_panda("audit", kTaskStiffness),
                {"--damping-factor", "2", "--samples", "10", "--csv", full}),
         "--csv"},
        {Words{"check-model", log, "--config", scene("panda_release_c1"), "--write", full},
         "--write"}}) {
    const Outcome outcome = run_program(words);
    EXPECT_NE(outcome.status, 0) << words[0] << " " << option;
    EXPECT_THAT(outcome.err, HasSubstr(std::string(option) + ": /dev/full: "));
    EXPECT_THAT(outcome.err, Not(HasSubstr("Success")));
  }
}

}  // namespace
}  // namespace dashpot::tests
