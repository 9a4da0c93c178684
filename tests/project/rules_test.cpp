// The rules themselves: each must let good text pass and catch bad text.
#include <dashpot/tests/project/rules.hpp>

#include <gmock/gmock.h>

namespace dashpot::tests {
namespace {

using testing::ElementsAre;
using testing::IsEmpty;

TEST(WordRules, FindPathsOfAMachineAndNotesOfUnfinishedWork) {
  using namespace std::string_literals;  // in halves, so that this file passes the rule itself
  EXPECT_THAT(forbidden_words("see /"s + "home/ann/arm.urdf"), ElementsAre("/"s + "home/"));
  EXPECT_THAT(forbidden_words("// TO"s + "DO: units, FIX" + "ME"),
              ElementsAre("TO"s + "DO", "FIX"s + "ME"));
  EXPECT_THAT(forbidden_words("a framework/of homes, done at /usr/share/work"), IsEmpty());
}

TEST(ThreadRules, FindTheHeadersThatStartThreads) {
  EXPECT_TRUE(includes_threads("#include <thread>\n"));
  EXPECT_TRUE(includes_threads("#pragma once\n # include <future>  // async\n"));
  EXPECT_TRUE(includes_threads("#include <vector>\n\n#include <pthread.h>\n"));
  EXPECT_FALSE(includes_threads("// #include <thread>\n#include <dashpot/tests/thread>\n"));
}

TEST(DocumentRules, FindTheRoomsThatATableDescribes) {
  EXPECT_THAT(
      described_rooms("# House\n| `other` | no room |\n\n## Rooms\n\n| folder | what belongs "
                      "in it |\n|---|---|\n| `a/base` | types |\n| `a/b c` | `x`, y |\n"
                      "| `a/empty` |  |\n\n## Next\n| `late` | no room |\n"),
      ElementsAre("a/base", "a/b c"));
  EXPECT_THAT(described_rooms("| `a/base` | types |\n"), IsEmpty());
}

TEST(ConstantRules, FindConstantsInSourcesAndTables) {
  EXPECT_THAT(named_constants("constexpr double kA = 1e-3, kBc = 2;  // why\n  static constexpr\n"
                              "Index kD =\n 4; const double kE = 5; x = kA;"),
              ElementsAre("kA = 1e-3", "kBc = 2"));
  EXPECT_THAT(tabled_constants("## One\n| `kA` | 1 | a |\n## Two\n| name | value |\n|---|---|\n"
                               "| `kB`, `kC` | 2, 1 / 3 | b, c |\n## Three\n| `kD` | 4 | d |\n",
                               "Two"),
              ElementsAre("kB = 2", "kC = 1 / 3"));
}

TEST(HeaderRules, AskForPragmaOnceInTheFirstLine) {
  EXPECT_TRUE(starts_with_pragma_once("#pragma once\n#include <vector>\n"));
  EXPECT_FALSE(starts_with_pragma_once("// A comment.\n#pragma once\n"));
  EXPECT_FALSE(starts_with_pragma_once(""));
}

}  // namespace
}  // namespace dashpot::tests
