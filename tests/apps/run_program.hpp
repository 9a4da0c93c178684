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
#include <cstdlib>
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

/// `dashpot SUBCOMMAND` of a Panda, with `more` words.
inline Words of_panda(const std::string& subcommand, const Words& more) {
  return joined({subcommand, "--urdf", DASHPOT_SOURCE_DIR "/sim/models/panda.urdf", "--base",
                 "panda_link0", "--tip", "panda_hand_tcp"},
                more);
}

struct Outcome {
  int status = -1;  ///< exit status; 128 + signal if one ended the program
  std::string out;
  std::string err;
};

/// Runs `dashpot ARGUMENTS...` with `input` on standard input; its standard output goes to the file
/// `sink` if one is named, and into the outcome otherwise.
inline Outcome run_program(const std::vector<std::string>& arguments, const std::string& input = "",
                           const std::string& sink = "") {
  const Scratch scratch;
  const std::string in = scratch.write("in", input);
  const std::string out = sink.empty() ? scratch.path("out") : sink;
  const std::string err = scratch.path("err");

  std::vector<std::string> words = {DASHPOT_PROGRAM};
  words.insert(words.end(), arguments.begin(), arguments.end());
  std::vector<char*> argv(words.size() + 1, nullptr);
  std::transform(words.begin(), words.end(), argv.begin(),
                 [](std::string& word) { return word.data(); });

  posix_spawn_file_actions_t files;
  posix_spawn_file_actions_init(&files);
  posix_spawn_file_actions_addopen(&files, STDIN_FILENO, in.c_str(), O_RDONLY, 0);
  posix_spawn_file_actions_addopen(&files, STDOUT_FILENO, out.c_str(), O_WRONLY | O_CREAT, 0600);
  posix_spawn_file_actions_addopen(&files, STDERR_FILENO, err.c_str(), O_WRONLY | O_CREAT, 0600);
  pid_t child = 0;
  const int failure = posix_spawn(&child, argv[0], &files, nullptr, argv.data(), environ);
  posix_spawn_file_actions_destroy(&files);
  if (failure != 0) throw std::runtime_error("cannot start " + words[0]);

  int wait_status = 0;
  waitpid(child, &wait_status, 0);
  Outcome outcome;
  outcome.status = WIFEXITED(wait_status) ? WEXITSTATUS(wait_status) : 128 + WTERMSIG(wait_status);
  if (sink.empty()) outcome.out = scratch.read("out");
  outcome.err = scratch.read("err");
  return outcome;
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

/// That the program said no, in one line that holds `text`, and nothing else.
inline void expect_refusal(const Outcome& outcome, const std::string& text) {
  SCOPED_TRACE(text);
  EXPECT_EQ(outcome.status, 2);
  EXPECT_EQ(outcome.out, "");
  EXPECT_EQ(count_lines(outcome.err), 1) << outcome.err;
  EXPECT_NE(outcome.err.find(text), std::string::npos) << outcome.err;
}

}  // namespace dashpot::tests
