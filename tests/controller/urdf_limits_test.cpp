// Descriptions that are large, deep or long: read in time that grows with them, or refused.
#include <dashpot/controller/dynamics.hpp>
#include <dashpot/controller/robot_model.hpp>
#include <dashpot/tests/support/count_allocations.hpp>
#include <dashpot/tests/support/scratch.hpp>

#include <gmock/gmock.h>
#include <sys/stat.h>

#include <string>

namespace dashpot::controller {
namespace {

using ::testing::HasSubstr;

template <class Read>
std::string refusal_of(const Read& read) {
  try {
    read();
  } catch (const InvalidModel& error) {
    return error.what();
  }
  return "read";
}

std::string refusal(const std::string& text) {
  return refusal_of([&] { RobotModel::from_urdf_text(text, "link0", "link1", {}, "arm.urdf"); });
}

std::string refusal_of_file(const std::string& path) {
  return refusal_of([&] { RobotModel::from_urdf_file(path, "link0", "link1"); });
}

/// A hinge from link0 to link1, on which a chain of this many more links hangs. Names are too long
/// for strings to hold without allocating.
std::string long_chain(int links, const std::string& more = "") {
  const std::string tail = "_of_a_chain_that_is_very_long";
  const auto link = [&tail](int i) {
    return "link" + std::to_string(i) + (i > 1 ? tail : std::string());
  };
  std::string text = "<robot name='chain'><link name='link0'/>";
  for (int i = 1; i <= links + 1; ++i) {
    text += "<link name='" + link(i) + "'><inertial><mass value='1'/><inertia ixx='1' ixy='0' " +
            "ixz='0' iyy='1' iyz='0' izz='1'/></inertial></link><joint name='joint" +
            std::to_string(i) + tail + "' type='" + (i == 1 ? "continuous" : "fixed") +
            "'><parent link='" + link(i - 1) + "'/><child link='" + link(i) +
            "'/><origin xyz='0 0.001 0'/></joint>";
  }
  return text + more + "</robot>";
}

TEST(UrdfLimits, RefuseWhatCouldOverflowTheStack) {
  std::string text;
  for (int i = 0; i < 100'000; ++i) text += "<a>";
  for (int i = 0; i < 100'000; ++i) text += "</a>";
  const std::string said = "arm.urdf: line 1: elements are nested more than 64 deep";
  EXPECT_EQ(refusal("<robot name='r'>" + text + "</robot>"), said);
  EXPECT_EQ(refusal(long_chain(1, text)), said);
  EXPECT_EQ(refusal(long_chain(2500)), "arm.urdf: line 1: holds more than 2000 links");
}

TEST(UrdfLimits, CountEveryLinkOfALongChain) {
  const int links = 1900;
  const RobotModel model = RobotModel::from_urdf_text(long_chain(links), "link0", "link1");
  ASSERT_EQ(model.dof(), 1);
  // Link 1 + i is at y = i mm, from the hinge's axis, which is x; all have 1 kg and 1 kg m^2.
  const double expected = (links + 1) + 1e-6 * links * (links + 1) * (2 * links + 1) / 6;
  const double found = evaluate(model, JointVector::Zero(1), JointVector::Zero(1)).M(0, 0);
  EXPECT_NEAR(found, expected, 1e-9 * expected);
}

TEST(UrdfLimits, ReadALongChainInTimeThatGrowsWithIt) {
  if (!DASHPOT_COUNTS_ALLOCATIONS) GTEST_SKIP() << "sanitizers count for themselves";
  const auto allocations = [](int links) {
    const std::string text = long_chain(links);
    return testing::allocations_of([&] { RobotModel::from_urdf_text(text, "link0", "link1"); });
  };
  const int some = allocations(400), more = allocations(1600);
  EXPECT_GT(some, 400);
  EXPECT_LT(more, 5 * some);
}

TEST(UrdfLimits, KeepMessagesShort) {
  const std::string name(300'000, 'x');
  EXPECT_LT(
      refusal("<robot name='r'><link name='link0'/><joint name='" + name + "'/></robot>").size(),
      3000u);
  std::string numbers;
  for (int i = 0; i < 300'000; ++i) numbers += "1 ";
  const std::string said = refusal(long_chain(
      1, "<joint name='j' type='continuous'><parent link='link1'/><child link='x'/><axis xyz='" +
             numbers + "'/></joint>"));
  EXPECT_THAT(said, HasSubstr("arm.urdf: "));
  EXPECT_LT(said.size(), 3000u);
}

TEST(UrdfLimits, RefuseFilesThatNeverEndOrKeepWaiting) {
  const tests::Scratch scratch;
  const std::string pipe = scratch.path("pipe.urdf");
  ASSERT_EQ(mkfifo(pipe.c_str(), 0600), 0);
  EXPECT_EQ(refusal_of_file(pipe), pipe + ": cannot be read: not a regular file");
  EXPECT_EQ(refusal_of_file("/dev/zero"), "/dev/zero: cannot be read: not a regular file");
  const std::string large = scratch.write("large.urdf", std::string((16u << 20) + 1, ' '));
  EXPECT_EQ(refusal_of_file(large), large + ": cannot be read: larger than 16 MiB");
  const std::string empty = scratch.write("empty.urdf", "");
  EXPECT_THAT(refusal_of_file(empty), HasSubstr("empty.urdf: "));
}

TEST(UrdfLimits, ShowWhatSteersATerminalAsEscapes) {
  const std::string said = refusal(
      "<robot name='r'><link name='link0'/><link name='link1'/><joint name='a&#27;[2J"
      "\u009b&#10;b' type='floating'><parent link='link0'/><child link='link1'/></joint>"
      "</robot>");
  EXPECT_EQ(said, "arm.urdf: joint 'a\\x1b[2J\\u009b b': floating joints are not supported");
}

}  // namespace
}  // namespace dashpot::controller
