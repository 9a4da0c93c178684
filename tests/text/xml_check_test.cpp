// Which XML a parser may see.
#include <dashpot/tests/support/places.hpp>
#include <dashpot/text/xml_check.hpp>

#include <gtest/gtest.h>

#include <filesystem>
#include <fstream>
#include <iterator>
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

TEST(XmlCheck, NamesTheReasonOfARefusal) {
  struct Bad {
    std::string text;
    const char* reason;
  };
  const std::string open = "<a b=\"";
  const Bad all[] = {
      {std::string((16u << 20) + 1, ' '), "larger than 16 MiB"},

      {"\n" + repeat("<a>", 65) + repeat("</a>", 65),
       "line 2: elements are nested more than 64 deep"},
      {repeat("<a\n>", 100'000), "line 66: elements are nested more than 64 deep"},
      {repeat("<a/>", 200'001), "line 1: holds more than 200000 elements"},
      {repeat("<link/>", 2001), "line 1: holds more than 2000 links"},
      {repeat("<joint/>", 2001), "line 1: holds more than 2000 joints"},
      {"<a" + repeat(" b=''", 65) + "/>", "line 1: an element has more than 64 attributes"},
      // Each would make some parser see elements where this one sees none, or read past the end.

      {"<a b=c/>", "line 1: not XML: an attribute's value is not in quotes"},
      {"<a b='<a>'/>", "line 1: not XML: an attribute's value does not end"},
      {"<a b='", "line 1: not XML: an attribute's value does not end"},
      {open + "&#x\"/><!-- 41;\"><a> -->", "line 1: holds a broken character reference"},
      {"<a>&#x </a><b>41;</b>", "line 1: holds a broken character reference"},
      {"<a>&#x00000041;</a>", "line 1: holds a broken character reference"},
      {open + "\xf0\"/>", "line 1: not UTF-8"},
      {"<a>\xf0", "line 1: not UTF-8"},
      {"<a\xc3/>", "line 1: not UTF-8"},
      {"<?xml version=\"\xf0\"?>", "line 1: not UTF-8"},
      {std::string("<a>\0</a>", 8), "line 1: holds a control character"},
      {open + std::string("\0'/>", 4), "line 1: not XML: an attribute's value does not end"},
      {open + "\033[2J\"/>", "line 1: holds a control character"},
      {"<?pi <a><a> ?>", "line 1: holds a declaration that is not read"},
      {"<?xml version='1>0'?>", "line 1: holds a declaration that is not read"},
      {"<?xml version='1.0?><a b='1'/>", "line 1: holds a declaration that is not read"},
      {"<!DOCTYPE a [<!ENTITY b 'c'>]><a/>", "line 1: holds a declaration that is not read"},
      {"<!DOCTYPE a", "line 1: holds a declaration that is not read"},
      {"<!-- -- >", "line 1: not XML: '-->' is missing"},
      {"<a><![CDATA[ ]] >", "line 1: not XML: ']]>' is missing"},
      {"<a><b>\n</b>", "line 2: <a> is not closed"},
      {"<a><b></a></b>", "line 1: </a> closes <b>"},
      {"<a></ab>", "line 1: </ab> closes <a>"},
      {"</a>", "line 1: </a> closes nothing"},
      {"< a/>", "line 1: not XML"},
      {"<1/>", "line 1: not XML"},
      {"<a b='1'", "line 1: not XML"},
      {"<a / b='1'>", "line 1: not XML"},
      {"<a b/>", "line 1: not XML"}};
  for (const Bad& bad : all) EXPECT_EQ(complaint(bad.text), bad.reason) << bad.text.substr(0, 80);
}

TEST(XmlCheck, LetsTheLargestPass) {
  EXPECT_EQ(complaint(repeat("<a>", 64) + repeat("</a>", 64)), "passed");
  EXPECT_EQ(complaint(repeat("<a/>", 200'000)), "passed");
  EXPECT_EQ(complaint(repeat("<link/><joint/>", 2000)), "passed");
  EXPECT_EQ(complaint("<a" + repeat(" b=''", 64) + "/>"), "passed");
  EXPECT_EQ(complaint(std::string(16u << 20, ' ')), "passed");
}

}  // namespace
}  // namespace dashpot::text
