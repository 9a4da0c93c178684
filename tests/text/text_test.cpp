// Text of others as a terminal shows it, files that are read, and numbers with units.
#include <dashpot/tests/support/scratch.hpp>
#include <dashpot/text/printable.hpp>
#include <dashpot/text/quantity.hpp>
#include <dashpot/text/read_file.hpp>

#include <gmock/gmock.h>
#include <sys/stat.h>

#include <cmath>
#include <numbers>
#include <stdexcept>
#include <string>
#include <string_view>

namespace dashpot::text {
namespace {

// Text of others as a terminal shows it.

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

// Which files are read, and what is said of others.

std::string refusal(const std::string& path, std::size_t most = 1u << 20) {
  try {
    read_file(path, most);
  } catch (const std::runtime_error& error) {
    return error.what();
  }
  return "read";
}

TEST(ReadFile, ReturnsEveryByte) {
  const tests::Scratch scratch;
  std::string text(200'000, 'x');
  text[100'000] = '\0';
  text[5] = '\n';
  EXPECT_EQ(read_file(scratch.write("a", text), text.size()), text);
  EXPECT_EQ(read_file(scratch.write("empty", ""), 1u << 20), "");
}

TEST(ReadFile, HasALimit) {
  const tests::Scratch scratch;
  EXPECT_EQ(refusal(scratch.write("a", std::string((1u << 20) + 1, 'x'))),
            "cannot be read: larger than 1 MiB");
  EXPECT_EQ(refusal(scratch.write("b", std::string(1u << 20, 'x'))), "read");
}

// A pipe without a writer would keep the caller waiting for ever, and /dev/zero never ends.
TEST(ReadFile, RefusesWhatIsNoFile) {
  const tests::Scratch scratch;
  const std::string pipe = scratch.path("pipe");
  ASSERT_EQ(mkfifo(pipe.c_str(), 0600), 0);
  EXPECT_EQ(refusal(pipe), "cannot be read: not a regular file");
  EXPECT_EQ(refusal("/dev/zero"), "cannot be read: not a regular file");
  EXPECT_EQ(refusal(scratch.path("")), "cannot be read: Is a directory");
  EXPECT_EQ(refusal(scratch.path("none")), "cannot be read: No such file or directory");
}

// Numbers with units: what they are worth in SI, and what is refused.

constexpr double kPi = std::numbers::pi;

struct Case {
  const char* text;
  const char* unit;
  double value;
};

TEST(Quantity, IsGivenInSi) {
  for (const Case& one : {Case{"0.001", "s", 0.001},
                          Case{"1 ms", "s", 0.001},
                          Case{"1ms", "s", 0.001},
                          Case{" 250 us ", "s", 0.00025},
                          Case{"1 kHz", "Hz", 1000},
                          Case{"180 deg", "rad", kPi},
                          Case{"-90 deg", "rad", -kPi / 2},
                          Case{"+2 mrad", "rad", 0.002},
                          Case{"60 rpm", "rad/s", 2 * kPi},
                          Case{"180 deg/s^2", "rad/s^2", kPi},
                          Case{"180 deg/s/s", "rad/s^2", kPi},
                          Case{"500 N/m", "N/m", 500},
                          Case{"5 N/mm", "N/m", 5000},
                          Case{"2 kN/m", "N/m", 2000},
                          Case{"20 Nm/rad", "N m/rad", 20},
                          Case{"20 N m / rad", "N m/rad", 20},
                          Case{"20 N*m/rad", "N m/rad", 20},
                          Case{"20 kg m^2/s^2/rad", "N m/rad", 20},
                          Case{"1 Nm/deg", "N m/rad", 180 / kPi},
                          Case{"3 Nms/rad", "N m s/rad", 3},
                          Case{"87 N m", "N m", 87},
                          Case{"8700 N cm", "N m", 87},
                          Case{"1000 Nm/s", "N m/s", 1000},
                          Case{"300 g", "kg", 0.3},
                          Case{"1e-2 kg m^2", "kg m^2", 0.01},
                          Case{"100 kg cm^2", "kg m^2", 0.01},
                          Case{"0.5", "", 0.5},
                          Case{"1e-400", "m", 0}}) {
    SCOPED_TRACE(one.text);
    EXPECT_NEAR(parse_quantity(one.text, one.unit), one.value, 4e-16 * std::abs(one.value));
  }
}

std::string complaint(const char* text, const char* unit) {
  try {
    const double value = parse_quantity(text, unit);
    return "none, but " + std::to_string(value);
  } catch (const std::invalid_argument& error) {
    return error.what();
  }
}

TEST(Quantity, RefusesAWrongUnit) {
  EXPECT_EQ(complaint("20 Nm", "N m/rad"), "has a wrong unit: '20 Nm'; N m/rad is wanted");
  EXPECT_EQ(complaint("1 kHz", "s"), "has a wrong unit: '1 kHz'; s is wanted");
  EXPECT_EQ(complaint("1 Hz", "rad/s"), "has a wrong unit: '1 Hz'; rad/s is wanted");
  EXPECT_EQ(complaint("30 deg", "m"), "has a wrong unit: '30 deg'; m is wanted");
  EXPECT_EQ(complaint("3 m^3", "m^2"), "has a wrong unit: '3 m^3'; m^2 is wanted");
  EXPECT_EQ(complaint("10 s", ""), "has a wrong unit: '10 s'; a number without unit is wanted");
}

TEST(Quantity, RefusesAnUnknownUnit) {
  EXPECT_EQ(complaint("3 lb", "kg"), "is not a number but '3 lb': unknown unit 'lb'");
  for (const char* unit : {"N/m s", "m^", "m^0", "m^-1", "m^22", "m*", "m/", "/s", "N//m", "m *",
                           "M", "1 m", "(m)", "m,", "sec"}) {
    EXPECT_EQ(complaint(("3 " + std::string(unit)).c_str(), "m"),
              "is not a number but '3 " + std::string(unit) + "': unknown unit '" + unit + "'");
  }
}

TEST(Quantity, RefusesWhatIsNoNumber) {
  for (const char* text : {"", " ", "fast", "m", "ms 1", "--1", "+-1", "0x", ","}) {
    EXPECT_THAT(complaint(text, "m"), ::testing::StartsWith("is not "));
  }
  EXPECT_EQ(complaint("fast", "m/s"), "is not a number but 'fast'");
  for (const char* text : {"nan", ".nan", ".NaN", "inf", "-inf", ".inf", "-.Inf", "1e999 m"}) {
    EXPECT_EQ(complaint(text, "m"), "is not finite: '" + std::string(text) + "'");
  }
  EXPECT_EQ(complaint("a text that is longer than what fits on a line", "m"),
            "is not a number but 'a text that is longer than what fits on ...'");
}

}  // namespace
}  // namespace dashpot::text
