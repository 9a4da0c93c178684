// Applies the rules to every file of the source tree.
#include <dashpot/tests/project/rules.hpp>

#include <gmock/gmock.h>

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

std::string text_of(std::string_view path) {
  const auto at = std::find_if(files().begin(), files().end(),
                               [&](const File& file) { return file.path == path; });
  return at == files().end() ? "" : at->text;
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
    if (file.directory() != "examples" || !program) continue;
    const std::string name = file.path.substr(file.path.find('/') + 1);
    EXPECT_THAT(text_of("examples/README.md"), testing::HasSubstr("\n| [" + name + "](" + name));
  }
}

}  // namespace
}  // namespace dashpot::tests
