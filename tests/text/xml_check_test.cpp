// Which XML a parser may see.
#include <dashpot/tests/support/places.hpp>
#include <dashpot/text/xml_check.hpp>

#include <gtest/gtest.h>

#include <filesystem>
#include <fstream>
#include <iterator>
#include <ostream>
#include <stdexcept>
#include <string>

namespace dashpot::text {
namespace {

std::string repeat(const std::string& text, std::size_t times) {
  std::string result;
  for (std::size_t i = 0; i < times; ++i) result += text;
  return result;
}

std::string complaint(const std::string& text) {
  try {
    check_xml(text);
  } catch (const std::runtime_error& error) {
    return error.what();
  }
  return "passed";
}

TEST(XmlCheck, LetsEveryModelPass) {
  int models = 0;
  for (const auto& entry : std::filesystem::directory_iterator(DASHPOT_SOURCE_DIR "/sim/models")) {
    if (entry.path().extension() != ".urdf") continue;
    std::ifstream stream(entry.path(), std::ios::binary);
    EXPECT_EQ(complaint({std::istreambuf_iterator<char>(stream), {}}), "passed") << entry.path();
    ++models;
  }
  EXPECT_GT(models, 3);
}

TEST(XmlCheck, LetsPassWhatDescriptionsHold) {
  for (const std::string text :
       {"", "words", "<?xml version=\"1.0\" encoding='utf-8'?>\n<robot name = 'r' >\n</robot >\n",
        "\xef\xbb\xbf<?xml version='1.0'?><!DOCTYPE robot><a/>", "<a b='>' c=\"it's\" d='\"'/>",
        "<!-- <a> & \xff \x01 &#x -- ' --><a><!----></a>", "<a><![CDATA[<b> & ]] > \xff]]></a>",
        "<a>1 &lt; 2 &amp; &#65;&#x1F916; R&D</a>", "<a><b></b>text<b/><b c=''/></a>",
        "<xacro:arm name='caf\u00e9'/>", "<a/><b/>"}) {
    EXPECT_EQ(complaint(text), "passed") << text;
  }
}

struct Bad {
  const char* name;
  std::string text;
  const char* reason;
};

std::ostream& operator<<(std::ostream& out, const Bad& bad) {
  return out << bad.name;
}

class XmlCheckRefuses : public ::testing::TestWithParam<Bad> {};

TEST_P(XmlCheckRefuses, WithTheReason) {
  EXPECT_EQ(complaint(GetParam().text), GetParam().reason);
}

std::string name_of(const ::testing::TestParamInfo<Bad>& info) {
  return info.param.name;
}

const std::string kOpen = "<a b=\"";

INSTANTIATE_TEST_SUITE_P(
    Sizes, XmlCheckRefuses,
    ::testing::Values(
        Bad{"Nested", "\n" + repeat("<a>", 65) + repeat("</a>", 65),
            "line 2: elements are nested more than 64 deep"},
        Bad{"NestedAcrossLines", repeat("<a\n>", 100'000),
            "line 66: elements are nested more than 64 deep"},
        Bad{"Elements", repeat("<a/>", 200'001), "line 1: holds more than 200000 elements"},
        Bad{"Links", repeat("<link/>", 2001), "line 1: holds more than 2000 links"},
        Bad{"Joints", repeat("<joint/>", 2001), "line 1: holds more than 2000 joints"},
        Bad{"Attributes", "<a" + repeat(" b=''", 65) + "/>",
            "line 1: an element has more than 64 attributes"}),
    name_of);

TEST(XmlCheck, RefusesMoreThan16MiB) {
  EXPECT_EQ(complaint(std::string((16u << 20) + 1, ' ')), "larger than 16 MiB");
}

TEST(XmlCheck, LetsTheLargestPass) {
  EXPECT_EQ(complaint(repeat("<a>", 64) + repeat("</a>", 64)), "passed");
  EXPECT_EQ(complaint(repeat("<a/>", 200'000)), "passed");
  EXPECT_EQ(complaint(repeat("<link/><joint/>", 2000)), "passed");
  EXPECT_EQ(complaint("<a" + repeat(" b=''", 64) + "/>"), "passed");
  EXPECT_EQ(complaint(std::string(16u << 20, ' ')), "passed");
}

// Each would make some parser see elements where this one sees none, or read past the end.
INSTANTIATE_TEST_SUITE_P(
    Tricks, XmlCheckRefuses,
    ::testing::Values(
        Bad{"Unquoted", "<a b=c/>", "line 1: not XML: an attribute's value is not in quotes"},
        Bad{"TagInAValue", "<a b='<a>'/>", "line 1: not XML: an attribute's value does not end"},
        Bad{"OpenValue", "<a b='", "line 1: not XML: an attribute's value does not end"},
        Bad{"ReferencePastAQuote", kOpen + "&#x\"/><!-- 41;\"><a> -->",
            "line 1: holds a broken character reference"},
        Bad{"ReferencePastATag", "<a>&#x </a><b>41;</b>",
            "line 1: holds a broken character reference"},
        Bad{"LongReference", "<a>&#x00000041;</a>", "line 1: holds a broken character reference"},
        Bad{"ByteThatSwallowsAQuote", kOpen + "\xf0\"/>", "line 1: not UTF-8"},
        Bad{"ByteThatSwallowsTheEnd", "<a>\xf0", "line 1: not UTF-8"},
        Bad{"ByteInAName", "<a\xc3/>", "line 1: not UTF-8"},
        Bad{"ByteInADeclaration", "<?xml version=\"\xf0\"?>", "line 1: not UTF-8"},
        Bad{"Nul", std::string("<a>\0</a>", 8), "line 1: holds a control character"},
        Bad{"NulInAValue", kOpen + std::string("\0'/>", 4),
            "line 1: not XML: an attribute's value does not end"},
        Bad{"Escape", kOpen + "\033[2J\"/>", "line 1: holds a control character"},
        Bad{"TagInADeclaration", "<?pi <a><a> ?>", "line 1: holds a declaration that is not read"},
        Bad{"EndInADeclaration", "<?xml version='1>0'?>",
            "line 1: holds a declaration that is not read"},
        Bad{"OpenQuoteInADeclaration", "<?xml version='1.0?><a b='1'/>",
            "line 1: holds a declaration that is not read"},
        Bad{"Entities", "<!DOCTYPE a [<!ENTITY b 'c'>]><a/>",
            "line 1: holds a declaration that is not read"},
        Bad{"OpenDeclaration", "<!DOCTYPE a", "line 1: holds a declaration that is not read"},
        Bad{"OpenComment", "<!-- -- >", "line 1: not XML: '-->' is missing"},
        Bad{"OpenCdata", "<a><![CDATA[ ]] >", "line 1: not XML: ']]>' is missing"},
        Bad{"NotClosed", "<a><b>\n</b>", "line 2: <a> is not closed"},
        Bad{"WrongEnd", "<a><b></a></b>", "line 1: </a> closes <b>"},
        Bad{"LongerEnd", "<a></ab>", "line 1: </ab> closes <a>"},
        Bad{"EndOfNothing", "</a>", "line 1: </a> closes nothing"},
        Bad{"NoName", "< a/>", "line 1: not XML"}, Bad{"Digit", "<1/>", "line 1: not XML"},
        Bad{"OpenTag", "<a b='1'", "line 1: not XML"},
        Bad{"SlashInATag", "<a / b='1'>", "line 1: not XML"},
        Bad{"NoValue", "<a b/>", "line 1: not XML"}),
    name_of);

}  // namespace
}  // namespace dashpot::text
