#pragma once
// Runs the built program as a user would.

#include <dashpot/tests/support/places.hpp>
#include <dashpot/tests/support/scratch.hpp>

#include <fcntl.h>
#include <gtest/gtest.h>
#include <spawn.h>
#include <sys/wait.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <csignal>
#include <cstdarg>
#include <cstdio>
#include <stdexcept>
#include <string>
#include <vector>

namespace dashpot::tests {

using Words = std::vector<std::string>;

/// One list of words after the other.
inline Words joined(Words first, const Words& second) {
  first.insert(first.end(), second.begin(), second.end());
  return first;
}

/// Returns the text that printf prints.
[[gnu::format(printf, 1, 2)]] inline std::string printed(const char* format, ...) {
  std::array<char, 400> text{};
  va_list values;
  va_start(values, format);
  std::vsnprintf(text.data(), text.size(), format, values);
  va_end(values);
  return text.data();
}

/// `dashpot SUBCOMMAND` of a Panda, with `more` words.
inline Words of_panda(const std::string& subcommand, const Words& more) {
  return joined({subcommand, "--urdf", DASHPOT_SOURCE_DIR "/sim/models/panda.urdf", "--base",
                 "panda_link0", "--tip", "panda_hand_tcp"},
                more);
}

struct Outcome {
  int status = -1;  ///< as Running::finish has it
  std::string out;
  std::string err;
};

/// Where a program reads and writes: files of its own where none is named.
struct Files {
  std::string in = "/dev/null", out, err;
};

/// A `dashpot ARGUMENTS...` that runs beside the test.
class Running {
 public:
  explicit Running(const Words& arguments, Files files = {}) {
    Words words = joined({DASHPOT_PROGRAM}, arguments);
    std::vector<char*> argv(words.size() + 1, nullptr);
    std::transform(words.begin(), words.end(), argv.begin(),
                   [](std::string& word) { return word.data(); });
    if (files.out.empty()) files.out = out();
    if (files.err.empty()) files.err = err();
    posix_spawn_file_actions_t actions;
    posix_spawn_file_actions_init(&actions);
    posix_spawn_file_actions_addopen(&actions, STDIN_FILENO, files.in.c_str(), O_RDONLY, 0);
    constexpr int kWrite = O_RDWR | O_CREAT | O_NOCTTY;
    posix_spawn_file_actions_addopen(&actions, STDOUT_FILENO, files.out.c_str(), kWrite, 0600);
    posix_spawn_file_actions_addopen(&actions, STDERR_FILENO, files.err.c_str(), kWrite, 0600);
    posix_spawnattr_t attributes;
    posix_spawnattr_init(&attributes);
    sigset_t ignored_by_nohup;
    sigemptyset(&ignored_by_nohup);
    sigaddset(&ignored_by_nohup, SIGHUP);
    posix_spawnattr_setsigdefault(&attributes, &ignored_by_nohup);
    posix_spawnattr_setflags(&attributes, POSIX_SPAWN_SETSIGDEF);
    const int failure = posix_spawn(&child_, argv[0], &actions, &attributes, argv.data(), environ);
    posix_spawn_file_actions_destroy(&actions);
    posix_spawnattr_destroy(&attributes);
    if (failure != 0) throw std::runtime_error("cannot start " + words[0]);
  }
  Running(const Running&) = delete;
  Running& operator=(const Running&) = delete;
  ~Running() {
    if (child_ > 0) kill(child_, SIGKILL), waitpid(child_, nullptr, 0);
  }

  void send(int signal) const {
    if (child_ > 0) kill(child_, signal);
  }
  /// Whether it has ended; its exit status is kept.
  bool ended(int options = WNOHANG) {
    if (child_ > 0 && waitpid(child_, &status_, options) == child_) child_ = 0;
    return child_ == 0;
  }
  /// Waits for the end; the exit status, or 128 + signal if one ended the program.
  int finish() {
    ended(0);
    return WIFEXITED(status_) ? WEXITSTATUS(status_) : 128 + WTERMSIG(status_);
  }
  std::string out() const { return scratch_.path("out"); }
  std::string err() const { return scratch_.path("err"); }
  std::string output() const { return scratch_.read("out"); }
  std::string complaints() const { return scratch_.read("err"); }

 private:
  Scratch scratch_;
  pid_t child_ = 0;
  int status_ = 0;
};

/// Runs `dashpot ARGUMENTS...` with `input` on standard input; its standard output goes to the file
/// `sink` if one is named, and into the outcome otherwise.
inline Outcome run_program(const Words& arguments, const std::string& input = "",
                           const std::string& sink = "") {
  const Scratch scratch;
  Running program(arguments, {scratch.write("in", input), sink, ""});
  const int status = program.finish();
  return {status, sink.empty() ? program.output() : "", program.complaints()};
}

/// `dashpot analyze - OPTIONS...` with `text` on standard input.
inline Outcome analyze_text(const std::string& text, const Words& options = {}) {
  return run_program(joined({"analyze", "-"}, options), text);
}

inline std::string example(const std::string& name) {
  return std::string(DASHPOT_SOURCE_DIR) + "/apps/examples/" + name;
}
/// One of the project's scenes.
inline std::string scene(const std::string& name) {
  return std::string(DASHPOT_SOURCE_DIR) + "/sim/scenes/" + name + ".yaml";
}

/// Returns a bus of this process alone, so that tests may run side by side.
inline std::string own_url() {
  return "udpm://239.255.76.67:" + std::to_string(20000 + getpid() % 30000) + "?ttl=0";
}

inline auto count_lines(const std::string& text) {
  return std::count(text.begin(), text.end(), '\n');
}

/// Expects a refusal in one line that contains `text`, and no other output.
inline void expect_refusal(const Outcome& outcome, const std::string& text) {
  SCOPED_TRACE(text);
  EXPECT_EQ(outcome.status, 2);
  EXPECT_EQ(outcome.out, "");
  EXPECT_EQ(count_lines(outcome.err), 1) << outcome.err;
  EXPECT_TRUE(outcome.err.ends_with('\n'));
  EXPECT_NE(outcome.err.find(text), std::string::npos) << outcome.err;
}

/// Words that a command refuses, and a part of its message.
struct Refusal {
  Words words;
  std::string said;
};

/// Expects `dashpot COMMAND WORDS...` to refuse each in a line that begins with the command.
inline void expect_refusals(const Words& command, const std::vector<Refusal>& all) {
  for (const auto& [words, said] : all) {
    const Outcome outcome = run_program(joined(command, words));
    expect_refusal(outcome, said);
    EXPECT_TRUE(outcome.err.starts_with("dashpot " + command[0] + ": ")) << outcome.err;
  }
}

}  // namespace dashpot::tests
