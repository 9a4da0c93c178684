// The finder of cycles, on arrows that are made up.
#include <dashpot/tests/project/include_cycles.hpp>

#include <gtest/gtest.h>

namespace dashpot::tests {
namespace {

TEST(IncludeCycles, AreNotFoundWhereThereAreNone) {
  EXPECT_EQ(cycle_text({}), "");
  EXPECT_EQ(cycle_text({{"a", {"b", "c"}}, {"b", {"d"}}, {"c", {"d"}}, {"d", {}}}), "");
  EXPECT_EQ(cycle_text({{"c", {"b"}}, {"b", {"a"}}, {"d", {"a", "c"}}}), "");
}

TEST(IncludeCycles, AreFoundWithoutTheWayThere) {
  EXPECT_EQ(cycle_text({{"a", {"b"}}, {"b", {"c"}}, {"c", {"d"}}, {"d", {"b"}}}),
            "b -> c -> d -> b");
}

TEST(IncludeCycles, AreFoundBehindWhatWasVisitedBefore) {
  EXPECT_EQ(cycle_text({{"a", {"b"}}, {"b", {}}, {"c", {"b", "d"}}, {"d", {"c"}}}), "c -> d -> c");
}

TEST(IncludeCycles, MayBeOneNameLong) {
  EXPECT_EQ(cycle_text({{"a", {"a"}}}), "a -> a");
}

}  // namespace
}  // namespace dashpot::tests
