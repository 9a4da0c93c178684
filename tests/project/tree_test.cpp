// Applies the rules to every file of the source tree.
#include <dashpot/tests/project/rules.hpp>
#include <dashpot/tests/project/tree.hpp>

#include <gmock/gmock.h>

namespace dashpot::tests {
namespace {

using testing::Contains;
using testing::Field;
using testing::IsEmpty;

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

}  // namespace
}  // namespace dashpot::tests
