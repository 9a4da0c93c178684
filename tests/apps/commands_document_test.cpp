// docs/command-line.md lists what the program has: every subcommand, and every option of each.
#include <dashpot/tests/apps/run_program.hpp>
#include <dashpot/tests/apps/scene_run.hpp>
#include <dashpot/tests/support/scratch.hpp>

#include <gmock/gmock.h>

#include <array>
#include <cstdio>
#include <filesystem>
#include <map>
#include <memory>
#include <regex>
#include <set>
#include <sstream>
#include <string>
#include <vector>

namespace dashpot::tests {
namespace {

/// All that the groups of `pattern` find in `text`.
std::vector<std::string> found_in(const std::string& text, const std::string& pattern) {
  const std::regex regex(pattern);
  std::vector<std::string> found;
  for (std::sregex_iterator i(text.begin(), text.end(), regex), end; i != end; ++i) {
    found.push_back((*i)[1]);
  }
  return found;
}

/// Lines that begin with `pattern`, whose group is what they are called by.
std::vector<std::string> lines_in(const std::string& text, const std::string& pattern) {
  std::vector<std::string> found;
  std::istringstream lines(text);
  const std::regex regex(pattern);
  std::smatch match;
  for (std::string line; std::getline(lines, line);) {
    if (std::regex_search(line, match, regex, std::regex_constants::match_continuous)) {
      found.push_back(match[1]);
    }
  }
  return found;
}

/// The subcommands with all their names: "audit, modes".
std::vector<std::string> subcommands() {
  std::string help = run_program({"--help"}).out;
  help.erase(0, help.find("Subcommands:"));
  return lines_in(help, "  ([a-z][a-z-]*(, [a-z-]+)*)  ");
}

/// The options of a subcommand, each with all its names: "--damping,--task-damping".
std::vector<std::string> options_of(const std::string& subcommand) {
  return lines_in(run_program({subcommand, "--help"}).out, "  (--[a-z][a-z,-]*)");
}

/// The text of the sections by the subcommands in their headings.
std::map<std::string, std::string> sections() {
  std::map<std::string, std::string> result;
  std::istringstream lines(text_of(DASHPOT_SOURCE_DIR "/docs/command-line.md"));
  std::vector<std::string> names;
  for (std::string line; std::getline(lines, line);) {
    if (line.starts_with("## ")) names = found_in(line, "dashpot ([a-z-]+)");
    for (const std::string& name : names) result[name] += line + "\n";
  }
  return result;
}

std::set<std::string> options_in(const std::string& text) {
  const std::vector<std::string> found = found_in(text, "(--[a-z]+(-[a-z]+)*)");
  return {found.begin(), found.end()};
}

TEST(Help, HasNoLineOfMoreThanAHundredColumns) {
  for (const std::string& names : subcommands()) {
    const std::string help = run_program({names.substr(0, names.find(',')), "--help"}).out;
    EXPECT_THAT(lines_in(help, "(.{101,})"), ::testing::IsEmpty()) << names;
    EXPECT_THAT(help, ::testing::HasSubstr("Print this help message and exit"));
  }
}

TEST(Completion, NamesSubcommandsAndTheirOptions) {
  const auto completed = [](const std::string& words) {
    const std::string command = std::string("bash -c '. ") + DASHPOT_SOURCE_DIR +
                                "/apps/completion.bash; COMP_WORDS=(" + DASHPOT_PROGRAM + " " +
                                words +
                                "); COMP_CWORD=$((${#COMP_WORDS[@]} - 1)); _dashpot; "
                                "echo -n \"${COMPREPLY[@]}\"'";
    const std::unique_ptr<std::FILE, int (*)(std::FILE*)> pipe(popen(command.c_str(), "r"), pclose);
    std::array<char, 200> text{};
    text[std::fread(text.data(), 1, text.size() - 1, pipe.get())] = 0;
    return std::string(text.data());
  };
  EXPECT_EQ(completed("i"), "inspect identify");
  EXPECT_EQ(completed("identify --c"), "--channels --columns --calibrate");
  EXPECT_EQ(completed("identify recor"), "");  // files are left to bash
}

TEST(CommandsDocument, ListsEverySubcommand) {
  const std::string text = text_of(DASHPOT_SOURCE_DIR "/docs/command-line.md");
  const std::vector<std::string> rows = lines_in(text, R"(\| \[`([a-z-]+)`\]\(#dashpot-)");
  std::vector<std::string> first;
  for (const std::string& names : subcommands()) {
    first.push_back(names.substr(0, names.find(',')));
    for (const std::string& name : found_in(names, "([a-z-]+)")) {
      EXPECT_THAT(text, ::testing::HasSubstr("`" + name + "`"));
    }
  }
  EXPECT_GT(first.size(), 10U);
  EXPECT_THAT(rows, ::testing::UnorderedElementsAreArray(first));
}

TEST(CommandsDocument, HasEveryOptionOfEverySubcommand) {
  const auto told = sections();
  for (const std::string& names : subcommands()) {
    const std::string subcommand = names.substr(0, names.find(','));
    ASSERT_TRUE(told.contains(subcommand)) << subcommand;
    const std::set<std::string> in_text = options_in(told.at(subcommand));
    std::set<std::string> known;
    for (const std::string& option : options_of(subcommand)) {
      const std::set<std::string> all = options_in(option);
      known.insert(all.begin(), all.end());
      if (option == "--help") continue;
      EXPECT_TRUE(std::any_of(all.begin(), all.end(),
                              [&](const auto& name) { return in_text.contains(name); }))
          << "dashpot " << subcommand << " " << option << " is not in docs/command-line.md";
    }
    EXPECT_GT(known.size(), 1U) << subcommand;
    for (const std::string& row : lines_in(told.at(subcommand), R"(\| (`--.*?) \|)")) {
      for (const std::string& name : options_in(row)) {
        EXPECT_TRUE(known.contains(name))
            << "docs/command-line.md: dashpot " << subcommand << " has no " << name;
      }
    }
  }
}

// docs/first-hour.md: each command works, and prints what the page shows.

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
