// docs/first-hour.md: each command works, and prints what the page shows.
#include <dashpot/tests/apps/run_program.hpp>
#include <dashpot/tests/apps/scene_run.hpp>
#include <dashpot/tests/support/scratch.hpp>

#include <gmock/gmock.h>

#include <filesystem>
#include <sstream>
#include <string>
#include <vector>

namespace dashpot::tests {
namespace {

struct Block {
  std::string kind;  ///< what stands behind the fence
  std::vector<std::string> lines;
};

std::vector<Block> blocks_of(const std::string& text) {
  std::vector<Block> blocks;
  bool inside = false;
  std::istringstream stream(text);
  for (std::string line; std::getline(stream, line);) {
    if (line.starts_with("```")) {
      inside = !inside;
      if (inside) blocks.push_back({line.substr(3), {}});
    } else if (inside) {
      blocks.back().lines.push_back(line);
    }
  }
  return blocks;
}

/// The words of a command line, with those in single quotes as one.
Words words_of(const std::string& line) {
  Words words;
  std::string word;
  bool quoted = false;
  for (const char c : line + " ") {
    if (c == '\'') {
      quoted = !quoted;
    } else if (c == ' ' && !quoted) {
      if (!word.empty()) words.push_back(word);
      word.clear();
    } else {
      word += c;
    }
  }
  return words;
}

TEST(FirstHour, CommandsPrintWhatThePageShows) {
  const Scratch scratch;
  std::filesystem::create_directory_symlink(DASHPOT_SOURCE_DIR "/sim", scratch.path("sim"));
  const auto here = [&](std::string word) {  // files of the page are in the scratch directory
    for (const char* ending : {".yaml", ".log", ".csv", ".urdf"}) {
      if (word.ends_with(ending)) return scratch.path(word);
    }
    return word;
  };
  int commands = 0;
  for (const Block& block : blocks_of(text_of(DASHPOT_SOURCE_DIR "/docs/first-hour.md"))) {
    if (block.kind == "yaml") {
      std::string text;
      for (const std::string& line : block.lines) text += line + "\n";
      scratch.write(block.lines.at(0).substr(2), text);
      continue;
    }
    ASSERT_EQ(block.kind, "console");
    Words words = words_of(block.lines.at(0));
    ASSERT_EQ(words.at(0) + words.at(1), "$dashpot");
    words.erase(words.begin(), words.begin() + 2);
    for (std::string& word : words) word = here(word);
    const Outcome outcome = run_program(words);
    EXPECT_EQ(outcome.status, 0) << block.lines[0] << "\n" << outcome.err;
    for (std::size_t i = 1; i < block.lines.size(); ++i) {
      if (block.lines[i] == "...") continue;
      EXPECT_THAT(outcome.out, ::testing::HasSubstr(block.lines[i] + "\n")) << block.lines[0];
    }
    ++commands;
  }
  EXPECT_GE(commands, 9);
}

}  // namespace
}  // namespace dashpot::tests
