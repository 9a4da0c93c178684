// Applies the rules to every file of the source tree.
#include <dashpot/tests/project/markdown.hpp>
#include <dashpot/tests/project/rules.hpp>

#include <gmock/gmock.h>

#include <algorithm>
#include <filesystem>
#include <fstream>

namespace dashpot::tests {
namespace {

namespace fs = std::filesystem;
using testing::Contains;
using testing::Field;
using testing::IsEmpty;

struct File {
  std::string path;  ///< from the top of the tree, "analysis/types.hpp"
  std::string text;

  std::string directory() const { return path.substr(0, path.find('/')); }
  bool is_source() const { return has_end(".hpp") || has_end(".cpp") || has_end(".h"); }
  bool has_end(std::string_view end) const { return path.ends_with(end); }
};

bool is_hidden_or_built(const std::string& name) {
  return (name.starts_with(".") && name != ".ci") || name.starts_with("build");
}

/// All text files but those of hidden directories and of the build.
const std::vector<File>& files() {
  static const std::vector<File> all = [] {
    std::vector<File> found;
    const fs::path root = DASHPOT_SOURCE_DIR;
    for (auto entry = fs::recursive_directory_iterator(root); entry != end(entry); ++entry) {
      if (entry->is_directory() && entry.depth() == 0 &&
          is_hidden_or_built(entry->path().filename().string())) {
        entry.disable_recursion_pending();
      }
      if (!entry->is_regular_file()) continue;
      std::ifstream stream(entry->path(), std::ios::binary);
      std::string text(std::istreambuf_iterator<char>(stream), {});
      if (text.find('\0') != std::string::npos) continue;
      found.push_back({entry->path().lexically_relative(root).string(), std::move(text)});
    }
    return found;
  }();
  return all;
}

TEST(Tree, IsRead) {
  EXPECT_THAT(files(), Contains(Field(&File::path, "CMakeLists.txt")));
  EXPECT_THAT(files(), Contains(Field(&File::path, "tests/project/tree_test.cpp")));
}

TEST(Tree, IncludesOnlyWhatTheLayersAllow) {
  std::vector<std::string> offences;
  for (const File& file : files()) {
    if (!file.is_source()) continue;
    for (const std::string& line : forbidden_includes(file.directory(), file.text)) {
      offences.push_back(file.path + ": " + line);
    }
  }
  EXPECT_THAT(offences, IsEmpty());
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
  std::vector<std::string> offences;
  for (const File& file : files()) {
    if (file.path.starts_with("tests/") && !file.path.starts_with("tests/threads/") &&
        includes_threads(file.text)) {
      offences.push_back(file.path);
    }
  }
  EXPECT_THAT(offences, IsEmpty()) << "Their place is tests/threads.";
}

TEST(Tree, StartsEveryHeaderWithPragmaOnce) {
  std::vector<std::string> offences;
  for (const File& file : files()) {
    if (file.has_end(".hpp") && !starts_with_pragma_once(file.text)) offences.push_back(file.path);
  }
  EXPECT_THAT(offences, IsEmpty());
}

/// The file of this path; null if there is none, or it is no text.
const File* find_file(const std::string& path) {
  const auto found = std::find_if(files().begin(), files().end(),
                                  [&](const File& file) { return file.path == path; });
  return found == files().end() ? nullptr : &*found;
}

/// What is wrong with a link of a document; empty if it leads somewhere.
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

TEST(Documents, KeepTheReadmeShort) {
  const File* const readme = find_file("README.md");
  ASSERT_NE(readme, nullptr);
  EXPECT_LE(std::count(readme->text.begin(), readme->text.end(), '\n'), 150);
}

}  // namespace
}  // namespace dashpot::tests
