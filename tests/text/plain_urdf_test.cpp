// The parts of a URDF that a parser of version 1.0 reads.
#include <dashpot/tests/support/dice.hpp>
#include <dashpot/text/plain_urdf.hpp>

#include <gmock/gmock.h>

#include <array>
#include <cmath>
#include <cstdio>
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

}  // namespace
}  // namespace dashpot::text
