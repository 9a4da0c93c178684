// The parts of a URDF that a parser of version 1.0 reads.
#include <dashpot/tests/support/dice.hpp>
#include <dashpot/tests/support/places.hpp>
#include <dashpot/text/plain_urdf.hpp>
#include <dashpot/text/xml_check.hpp>

#include <gmock/gmock.h>

#include <array>
#include <cmath>
#include <cstdio>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <limits>
#include <stdexcept>
#include <string>

namespace dashpot::text {
namespace {

using ::testing::HasSubstr;
using ::testing::Not;

std::string plain(const std::string& text) {
  return plain_urdf(text, "arm.urdf").text;
}

std::string complaint_of_urdf(const std::string& text) {
  try {
    plain_urdf(text, "arm.urdf");
  } catch (const std::runtime_error& error) {
    return error.what();
  }
  return "read";
}

std::string with_origin(const std::string& version, const std::string& origin) {
  return "<robot name='r' version='" + version + "'><joint name='j' type='fixed'>" + origin +
         "</joint></robot>";
}

std::string with_limit(const std::string& limit, const std::string& version = "1.2") {
  return "<robot name='r' version='" + version + "'><joint name='j'>" + limit + "</joint></robot>";
}

TEST(PlainUrdf, KeepsWhatAChainNeedsAndNoMore) {
  EXPECT_EQ(
      plain("\xef\xbb\xbf<?xml version='1.0'?><!-- c --><robot version=\"1.2\" name='r'>"
            "<material name='m'><link name='no'/></material><gazebo><joint/></gazebo>"
            "<link name=\"a'b\"><visual><geometry><mesh scale='1 1 1 1'/></geometry></visual>"
            "<inertial><origin xyz='1 2 3'><x/></origin><mass value='1'/><inertia ixx='1'/>"
            "<density/></inertial><collision><inertial/></collision></link>"
            "<joint name='j' type='fixed'><parent link='a'/><child link='b'/>"
            "<axis xyz='1 0 0'/><dynamics damping='1'/><mimic joint='k'/>"
            "<safety_controller/><calibration><limit/></calibration></joint></robot>"
            "<robot name='second'/>"),
      "<?xml version=\"1.0\" encoding=\"UTF-8\"?>\n"
      "<robot name=\"r\">\n<link name=\"a'b\">\n<inertial>\n<origin xyz=\"1 2 3\"></origin>\n"
      "<mass value=\"1\"/>\n<inertia ixx=\"1\"/></inertial></link>\n"
      "<joint name=\"j\" type=\"fixed\">\n<parent link=\"a\"/>\n<child link=\"b\"/>\n"
      "<axis xyz=\"1 0 0\"/>\n<dynamics damping=\"1\"/>\n<mimic joint=\"k\"/></joint></robot>");
}

TEST(PlainUrdf, KeepsQuotesAndLeavesOutWhatIsBesideTheRobot) {
  EXPECT_EQ(plain("<a><link name='no'/></a><robot name='a\"b'/><b><joint name='no'/></b>"),
            "<?xml version=\"1.0\" encoding=\"UTF-8\"?>\n<robot name='a\"b'/>");
}

TEST(PlainUrdf, TakesRoundedQuaternionsForUnitOnes) {
  EXPECT_EQ(plain(with_origin("1.1", "<origin quat_xyzw='0 0 0.6009 0.8012'/>")),
            plain(with_origin("1.1", "<origin quat_xyzw='0 0 0.6 0.8'/>")));
}

TEST(PlainUrdf, LeavesToTheParserWhatIsNoRobot) {
  for (const std::string text : {"", "words", "<model/>", "<a/><b/>"}) {
    EXPECT_EQ(plain(text), text);
  }
}

/// Rz(yaw) Ry(pitch) Rx(roll), row by row.
std::array<double, 9> rotation_of(double roll, double pitch, double yaw) {
  const double cr = std::cos(roll), sr = std::sin(roll), cp = std::cos(pitch), sp = std::sin(pitch),
               cy = std::cos(yaw), sy = std::sin(yaw);
  return {cy * cp,
          cy * sp * sr - sy * cr,
          cy * sp * cr + sy * sr,
          sy * cp,
          sy * sp * sr + cy * cr,
          sy * sp * cr - cy * sr,
          -sp,
          cp * sr,
          cp * cr};
}

TEST(PlainUrdf, TurnsQuaternionsIntoAnglesExactly) {
  testing::Dice dice(4711);
  for (int round = 0; round < 2000; ++round) {
    std::array<double, 4> q{};
    for (double& entry : q) entry = dice.uniform(-1, 1);
    if (round % 4 == 0) q = {q[0], q[3] + 1e-9 * q[1], -q[0], q[3]};  // near pitch of 90 degrees
    if (round % 7 == 0) q[static_cast<std::size_t>(round / 7 % 4)] = 0;
    const double norm = std::hypot(std::hypot(q[0], q[1]), std::hypot(q[2], q[3]));
    if (norm < 1e-3) continue;
    for (double& entry : q) entry /= norm;
    const auto [x, y, z, w] = q;
    std::array<char, 200> origin{};
    std::snprintf(origin.data(), origin.size(), "<origin quat_xyzw='%.17g %.17g\t%.17g  %.17g '/>",
                  x, y, z, w);
    const std::string text = plain(with_origin("1.1", origin.data()));
    double roll = 0, pitch = 0, yaw = 0;
    const std::size_t at = text.find("rpy=\"");
    ASSERT_NE(at, std::string::npos) << text;
    ASSERT_EQ(std::sscanf(text.c_str() + at, "rpy=\"%lf %lf %lf\"", &roll, &pitch, &yaw), 3);
    const std::array<double, 9> want = {
        1 - 2 * (y * y + z * z), 2 * (x * y - z * w),     2 * (x * z + y * w),
        2 * (x * y + z * w),     1 - 2 * (x * x + z * z), 2 * (y * z - x * w),
        2 * (x * z - y * w),     2 * (y * z + x * w),     1 - 2 * (x * x + y * y)};
    const std::array<double, 9> found = rotation_of(roll, pitch, yaw);
    for (std::size_t i = 0; i < 9; ++i) {
      ASSERT_NEAR(found[i], want[i], 4e-15) << "round " << round << ", seed 4711: " << text;
    }
  }
}

TEST(PlainUrdf, ReadsLimitsOfVersion12) {
  const PlainUrdf read = plain_urdf(
      with_limit("<limit effort='1' acceleration=' 15' jerk='+7.5e3'/><limit jerk='1'/>"), "");
  ASSERT_EQ(read.limits.size(), 1u);
  const MotionLimits& limits = read.limits.at("j");
  EXPECT_EQ(limits.acceleration, 15);
  EXPECT_EQ(limits.deceleration, std::numeric_limits<double>::infinity());
  EXPECT_EQ(limits.jerk, 7500);
  EXPECT_TRUE(plain_urdf(with_limit("<limit effort='1'/>"), "").limits.empty());
  EXPECT_TRUE(plain_urdf(with_limit("<limit effort='1'/><limit jerk='1'/>"), "").limits.empty())
      << "parsers take the first";
  EXPECT_TRUE(plain_urdf(with_limit("<limit jerk='-1'/>", "1.1"), "").limits.empty());
}

TEST(PlainUrdf, SaysWhatIsWrong) {
  const std::string turned = "<origin quat_xyzw='0 0 0 1'/>";
  for (const std::string version : {"1", "1.0"}) {
    EXPECT_THAT(complaint_of_urdf(with_origin(version, turned)),
                HasSubstr("joint 'j': quat_xyzw: belongs to URDF 1.1"));
  }
  EXPECT_EQ(complaint_of_urdf(with_origin("1.1", turned)), "read");
  EXPECT_EQ(complaint_of_urdf(with_origin("1.2", turned)), "read");
  for (const std::string version : {"", "1.3", "2.0", "1.1.1", "one"}) {
    EXPECT_EQ(complaint_of_urdf(with_origin(version, "")),
              "is a URDF of version '" + version + "'; 1.0, 1.1 and 1.2 are read");
  }
  for (const auto& [origin, reason] :
       {std::pair("<origin rpy='0 0 0' quat_xyzw='0 0 0 1'/>", "has rpy and quat_xyzw"),
        {"<origin quat_xyzw='0 0 1'/>", "four finite numbers"},
        {"<origin quat_xyzw='0 0 0 1 0'/>", "four finite numbers"},
        {"<origin quat_xyzw='0 0 0 nan'/>", "four finite numbers"},
        {"<origin quat_xyzw='0 0 0 1x'/>", "four finite numbers"},
        {"<origin quat_xyzw='0 0 0 0'/>", "is not of length 1"},
        {"<origin quat_xyzw='0 0 0 1.1'/>", "is not of length 1"}}) {
    EXPECT_THAT(complaint_of_urdf(with_origin("1.1", origin)), HasSubstr(reason)) << origin;
  }
  for (const std::string value : {"0", "-1", "inf", "1 2", ""}) {
    EXPECT_EQ(complaint_of_urdf(with_limit("<limit deceleration='" + value + "'/>")),
              "joint 'j': limit deceleration: a positive number is wanted");
  }
}

TEST(PlainUrdf, NamesOtherFormatsWithTheWayOn) {
  EXPECT_THAT(complaint_of_urdf("<mujoco model='a'/>"), HasSubstr("dashpot.Robot.from_mujoco("));
  EXPECT_THAT(complaint_of_urdf("<sdf version='1.7'><model/></sdf>"), HasSubstr("is SDF"));
  EXPECT_THAT(complaint_of_urdf("<xacro:a/>"), HasSubstr("xacro arm.urdf > robot.urdf"));
  EXPECT_EQ(complaint_of_urdf("<robot name='r'><mujoco/><sdf/></robot>"), "read");
}

// Which XML a parser may see.

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
