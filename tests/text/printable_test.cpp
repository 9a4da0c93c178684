// Text of others as a terminal shows it.
#include <dashpot/text/printable.hpp>

#include <gtest/gtest.h>

#include <string>
#include <string_view>

namespace dashpot::text {
namespace {

TEST(Printable, LeavesOrdinaryTextAlone) {
  for (const std::string text : {"", "arm.yaml: mass: is missing",
                                 "caf\u00e9 \u0394q \u2265 \u03c0", "\U0001F916", "a\\b", " ~"}) {
    EXPECT_EQ(printable(text), text);
  }
}

TEST(Printable, EscapesWhatSteersATerminal) {
  EXPECT_EQ(printable("\033[2J\033]0;title\a"), "\\x1b[2J\\x1b]0;title\\x07");
  EXPECT_EQ(printable(std::string("a\0b\x7f", 4)), "a\\x00b\\x7f");
  EXPECT_EQ(printable("\u0080 \u009b31m \u009f"), "\\u0080 \\u009b31m \\u009f");
  EXPECT_EQ(printable("a\r\n\tb"), "a\\x0d\\x0a\\x09b");
}

TEST(Printable, KeepsWhatItIsToldTo) {
  EXPECT_EQ(printable("a\n\rb\033", "\n"), "a\n\\x0db\\x1b");
}

TEST(Printable, ShowsWhatHidesOrReversesLetters) {
  EXPECT_EQ(printable("\u202egpj.\u202c"), "\\u202egpj.\\u202c");
  EXPECT_EQ(printable("a\u2028b\u2066c\u200bd\ufeff\u00ad"),
            "a\\u2028b\\u2066c\\u200bd\\ufeff\\u00ad");
  EXPECT_EQ(printable("\U000E0041"), "\\ue0041");
  EXPECT_EQ(printable("\u00a0\u200a\u2010\u2027\u202f\u2070"),
            "\u00a0\u200a\u2010\u2027\u202f\u2070")
      << "their neighbours";
}

TEST(Printable, EscapesBytesThatAreNotUtf8) {
  EXPECT_EQ(printable("\xff\xfe"), "\\xff\\xfe");
  EXPECT_EQ(printable("\x9b"), "\\x9b") << "a C1 control character of Latin-1";
  EXPECT_EQ(printable("\xc3"), "\\xc3") << "cut off";
  EXPECT_EQ(printable("\xe2\x82"), "\\xe2\\x82") << "cut off";
  EXPECT_EQ(printable(std::string_view("\u20ac").substr(0, 2)), "\\xe2\\x82") << "cut off";
  EXPECT_EQ(printable("\xc3(\xa9"), "\\xc3(\\xa9");
  EXPECT_EQ(printable("\xc0\x9b"), "\\xc0\\x9b") << "overlong";
  EXPECT_EQ(printable("\xe0\x80\x9b"), "\\xe0\\x80\\x9b") << "overlong";
  EXPECT_EQ(printable("\xf0\x80\x80\x9b"), "\\xf0\\x80\\x80\\x9b") << "overlong";
  EXPECT_EQ(printable("\xe0\x9f\xbf"), "\\xe0\\x9f\\xbf") << "just overlong";
  EXPECT_EQ(printable("\xf0\x8f\xbf\xbf"), "\\xf0\\x8f\\xbf\\xbf") << "just overlong";
  EXPECT_EQ(printable("\xed\xa0\x80"), "\\xed\\xa0\\x80") << "a surrogate";
  EXPECT_EQ(printable("\xf4\x90\x80\x80"), "\\xf4\\x90\\x80\\x80") << "above U+10FFFF";
}

TEST(Printable, IsPrintableItself) {
  std::string all;
  for (int c = 0; c < 256; ++c) all += static_cast<char>(c);
  const std::string shown = printable(all + all);
  EXPECT_EQ(printable(shown), shown);
  for (const char c : shown) EXPECT_TRUE(c >= 0x20 && c < 0x7f) << int{c};
}

}  // namespace
}  // namespace dashpot::text
