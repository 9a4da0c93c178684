// Numbers with units: what they are worth in SI, and what is refused.
#include <dashpot/text/quantity.hpp>

#include <gmock/gmock.h>

#include <cmath>
#include <numbers>
#include <stdexcept>

namespace dashpot::text {
namespace {

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
