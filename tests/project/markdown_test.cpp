// The reading of Markdown text that the tests of the documents rely on.
#include <dashpot/tests/project/markdown.hpp>

#include <gmock/gmock.h>

namespace dashpot::tests {
namespace {

using testing::AllOf;
using testing::ElementsAre;
using testing::Field;
using testing::IsEmpty;

auto is_link(const std::string& path, const std::string& heading) {
  return AllOf(Field(&Link::path, path), Field(&Link::heading, heading));
}

TEST(MarkdownLinks, AreFoundWithTheirHeadings) {
  EXPECT_THAT(relative_links("a [b](c.md), ![d](e/f.svg)\n[g\nh](../i.md#j-k) [l](#m)"),
              ElementsAre(is_link("c.md", ""), is_link("e/f.svg", ""), is_link("../i.md", "j-k"),
                          is_link("", "m")));
}

TEST(MarkdownLinks, LeaveOutCodeAndOtherPlaces) {
  EXPECT_THAT(relative_links("`[a](b.md)` [c](https://example.org/d.md) [e](mailto:f)\n"
                             "```\n[g](h.md)\n```\n  ```cpp\n[i](j.md)\n  ```\n"),
              IsEmpty());
  EXPECT_THAT(relative_links("```\n[a](b.md)\n```\n[c](d.md)"), ElementsAre(is_link("d.md", "")));
}

TEST(MarkdownAnchors, AreThoseOfGitHub) {
  EXPECT_THAT(anchors("# Who can: reach_it?\ntext\n## dashpot run --fast\n#no\n### `K` (4)\n"),
              ElementsAre("who-can-reach_it", "dashpot-run---fast", "k-4"));
}

TEST(MarkdownAnchors, CountHeadingsThatComeAgainAndLeaveOutCode) {
  EXPECT_THAT(anchors("# A\n```\n# B\n```\n## A\n# A\n"), ElementsAre("a", "a-1", "a-2"));
}

}  // namespace
}  // namespace dashpot::tests
