// Applies the rules to every file of the source tree.
#include <dashpot/tests/project/markdown.hpp>
#include <dashpot/tests/project/rooms.hpp>
#include <dashpot/tests/project/rules.hpp>
#include <dashpot/tests/project/tree.hpp>
#include <dashpot/tests/support/places.hpp>

#include <gmock/gmock.h>

#include <algorithm>
#include <filesystem>
#include <map>
#include <string>

namespace dashpot::tests {
namespace {

namespace fs = std::filesystem;
using testing::Contains;
using testing::ElementsAre;
using testing::Field;
using testing::IsEmpty;
using testing::SizeIs;

TEST(Tree, IsRead) {
  EXPECT_THAT(files(), Contains(Field(&File::path, "CMakeLists.txt")));
  EXPECT_THAT(files(), Contains(Field(&File::path, "tests/project/tree_test.cpp")));
}

TEST(Tree, HoldsNoPathOfAMachineAndNoNoteOfUnfinishedWork) {
  std::vector<std::string> offences;
  for (const File& file : files()) {
    for (const std::string& word : forbidden_words(file.text)) {
      offences.push_back(file.path + ": " + word);
    }
  }
  EXPECT_THAT(offences, IsEmpty());
}

TEST(Tree, KeepsTestsWithThreadsWhereTheThreadSanitizerRuns) {
  EXPECT_THAT(paths_of([](const File& file) {
                return file.path.starts_with("tests/") &&
                       !file.path.starts_with("tests/threads/") &&
                       !file.path.starts_with("tests/stress/soak") && includes_threads(file.text);
              }),
              IsEmpty())
      << "Their place is tests/threads.";
}

TEST(Tree, StartsEveryHeaderWithPragmaOnce) {
  EXPECT_THAT(paths_of([](const File& file) {
                return file.has_end(".hpp") && !starts_with_pragma_once(file.text);
              }),
              IsEmpty());
}

TEST(Tree, GivesEveryHeaderOfALibraryANameOfItsOwn) {
  std::map<std::string, std::string> known;
  for (const File& file : files()) {
    if (!file.has_end(".hpp")) continue;
    const Room* room = room_of(file.path);
    if (room == nullptr || !room->is_of_library()) continue;
    const std::string name = fs::path(file.path).filename();
    const auto [at, is_new] = known.emplace(name, file.path);
    EXPECT_TRUE(is_new) << file.path << " and " << at->second;
  }
  EXPECT_GT(known.size(), 100U);
}

/// The text file of this path; null if there is none.
const File* find_file(const std::string& path) {
  const auto found = std::find_if(files().begin(), files().end(),
                                  [&](const File& file) { return file.path == path; });
  return found == files().end() ? nullptr : &*found;
}

/// Returns what is wrong with a link of a document; empty if it leads somewhere.
std::string offence(const File& from, const Link& link) {
  const fs::path path = link.path.empty()
                            ? fs::path(from.path)
                            : (fs::path(from.path).parent_path() / link.path).lexically_normal();
  if (!fs::exists(DASHPOT_SOURCE_DIR / path)) return "there is no " + path.string();
  if (link.heading.empty()) return "";
  const File* const to = find_file(path.string());
  if (to == nullptr) return path.string() + " has no headings";
  const std::vector<std::string> headings = anchors(to->text);
  return std::find(headings.begin(), headings.end(), link.heading) != headings.end()
             ? ""
             : path.string() + " has no heading #" + link.heading;
}

TEST(Documents, LinkOnlyToFilesAndHeadingsThatExist) {
  std::vector<std::string> offences;
  int links = 0;
  for (const File& file : files()) {
    if (!file.has_end(".md")) continue;
    for (const Link& link : relative_links(file.text)) {
      ++links;
      const std::string found = offence(file, link);
      if (!found.empty()) offences.push_back(file.path + ": " + found);
    }
  }
  EXPECT_THAT(offences, IsEmpty());
  EXPECT_GT(links, 50);
}

TEST(Rules, FindOffences) {
  const File here{"docs/a.md", "# One: x_y\n```\n# no\n```\n# B\n# B\n"};
  const std::vector<Link> links =
      relative_links("[a](no.md) `[b](c.md)` [d\ne](../README.md#no) [f](https://g.h)");
  ASSERT_EQ(links.size(), 2U);
  EXPECT_EQ(offence(here, links[0]), "there is no docs/no.md");
  EXPECT_EQ(offence(here, links[1]), "README.md has no heading #no");
  EXPECT_THAT(anchors(here.text), ElementsAre("one-x_y", "b", "b-1"));
  EXPECT_THAT(forbidden_words("see /" + std::string("home/ann")), SizeIs(1));
  EXPECT_TRUE(includes_threads("#pragma once\n # include <future>  // async\n"));
  EXPECT_FALSE(starts_with_pragma_once("// A comment.\n#pragma once\n"));
}

TEST(Documents, KeepTheReadmeShort) {
  const File* const readme = find_file("README.md");
  ASSERT_NE(readme, nullptr);
  EXPECT_LE(std::count(readme->text.begin(), readme->text.end(), '\n'), 150);
}

std::string text_of(const std::string& path) {
  const File* const file = find_file(path);
  return file == nullptr ? "" : file->text;
}

TEST(Documents, ListTheConstantsOfIdentificationWithTheirValues) {
  const std::vector<std::string> listed =
      tabled_constants(text_of("docs/constants.md"), "Identification");
  std::size_t count = 0;
  for (const File& file : files()) {
    if (!file.path.starts_with("identification/")) continue;
    for (const std::string& constant : named_constants(file.text)) {
      if (constant.starts_with("kNaN")) continue;
      EXPECT_THAT(listed, Contains(constant)) << file.path;
      ++count;
    }
  }
  EXPECT_GT(count, 150U);
}

TEST(Examples, TheProgramOfTheReadmeIsTheOneThatIsTested) {
  const std::string readme = text_of("README.md"), fence = "```cpp\n";
  const std::size_t begin = readme.find(fence);
  ASSERT_NE(begin, std::string::npos);
  const std::size_t code = begin + fence.size();
  EXPECT_EQ(readme.substr(code, readme.find("```", code) - code),
            text_of("examples/control_loop.cpp"));
}

TEST(Examples, AreListedEachInTheirReadme) {
  for (const File& file : files()) {
    const bool program = file.has_end(".cpp") || file.has_end(".c") || file.has_end(".py");
    if (!file.path.starts_with("examples/") || !program) continue;
    const std::string name = file.path.substr(file.path.find('/') + 1);
    EXPECT_THAT(text_of("examples/README.md"), testing::HasSubstr("\n| [" + name + "](" + name));
  }
}

}  // namespace
}  // namespace dashpot::tests
