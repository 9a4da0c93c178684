// Gains and goals on either side of every bound and tolerance.
#include <dashpot/controller/base/orientation.hpp>
#include <dashpot/controller/setpoint_check.hpp>

#include <gtest/gtest.h>

#include <Eigen/Geometry>
#include <cmath>
#include <functional>
#include <limits>
#include <string>
#include <vector>

namespace dashpot::controller {
namespace {

constexpr double kNoNumber = std::numeric_limits<double>::quiet_NaN();

Limits limits_of_two_joints() {
  Limits limits;
  limits.torque = JointVector::Constant(2, 10);
  limits.position_lower = JointVector::Constant(2, -1);
  limits.position_upper = JointVector::Constant(2, 2);
  return limits;
}

Setpoint good_setpoint(Mode mode) {
  Setpoint setpoint;
  setpoint.mode = mode;
  setpoint.joint_position = JointVector::Zero(2);
  setpoint.gains.joint_stiffness = 100 * JointMatrix::Identity(2, 2);
  setpoint.gains.joint_damping = JointMatrix::Identity(2, 2);
  setpoint.gains.task_stiffness.setIdentity();
  setpoint.gains.task_damping.setIdentity();
  setpoint.tip_pose.position.setZero();
  setpoint.gains.null_stiffness = setpoint.gains.null_damping = JointVector::Ones(2);
  return setpoint;
}

/// The name of the invalid member; empty if there is none.
std::string fault(const Setpoint& setpoint, bool known_gains = false,
                  const Limits& limits = limits_of_two_joints()) {
  const SetpointFault found = check_setpoint(setpoint, limits, known_gains);
  return found ? found.key : "";
}

/// A value of a set-point, its name in a complaint, a valid and an invalid number.
struct Edge {
  Mode mode;
  std::string key;
  std::function<void(Setpoint&, double)> set;
  double good, bad;
};

TEST(SetpointCheck, HasItsBoundsWhereItSaysSo) {
  using S = Setpoint;
  const Mode joint = Mode::kJoint, tip = Mode::kCartesian;
  const auto turned_by = [](Setpoint& s, double defect) {  // |R'R - I| = defect
    const Eigen::Quaterniond q = quaternion(Eigen::Vector3d(0.3, -0.5, 0.8));
    s.tip_pose.rotation = std::sqrt(1 + defect) * q.toRotationMatrix();
  };
  const std::vector<Edge> edges = {
      {joint, "joint_position", [](S& s, double x) { s.joint_position[1] = x; }, -1, -1.001},
      {joint, "joint_position", [](S& s, double x) { s.joint_position[1] = x; }, 2, 2.001},
      {tip, "joint_position", [](S& s, double x) { s.joint_position[0] = x; }, 2, 2.001},
      {joint, "joint_stiffness", [](S& s, double x) { s.gains.joint_stiffness(1, 1) = x; }, 1e9,
       1.001e9},
      {joint, "joint_damping", [](S& s, double x) { s.gains.joint_damping(0, 0) = x; }, 0, -1e-3},
      // Symmetric within 1e-9 of the largest entry, which is 100
      {joint, "joint_stiffness", [](S& s, double x) { s.gains.joint_stiffness(0, 1) += x; }, 0.9e-7,
       1.1e-7},
      {joint, "joint_stiffness", [](S& s, double x) { s.gains.joint_stiffness(1, 0) += x; }, 0.9e-7,
       1.1e-7},
      // Positive semidefinite within 1e-10 of it
      {joint, "joint_stiffness", [](S& s, double x) { s.gains.joint_stiffness(1, 1) = x; }, -0.9e-8,
       -1.1e-8},
      {joint, "joint_stiffness",  // the eigenvalues 100 +- x
       [](S& s, double x) { s.gains.joint_stiffness(0, 1) = s.gains.joint_stiffness(1, 0) = x; },
       99.999, 100.001},
      {tip, "task_stiffness", [](S& s, double x) { s.gains.task_stiffness(5, 5) = x; }, 0, -1e-3},
      {tip, "task_stiffness",
       [](S& s, double x) { s.gains.task_stiffness(5, 2) = s.gains.task_stiffness(2, 5) = x; },
       0.999, 1.001},
      {tip, "task_damping", [](S& s, double x) { s.gains.task_damping(4, 4) = x; }, 1e9, 1.001e9},
      {tip, "null_stiffness", [](S& s, double x) { s.gains.null_stiffness[1] = x; }, 0, -1e-9},
      {tip, "null_stiffness", [](S& s, double x) { s.gains.null_stiffness[0] = x; }, 1e9, 1.001e9},
      {tip, "null_damping", [](S& s, double x) { s.gains.null_damping[1] = x; }, 0, -1e-9},
      {joint, "joint_damping_ratio", [](S& s, double x) { s.gains.joint_damping_ratio = x; }, 2,
       2.001},
      {joint, "joint_damping_ratio", [](S& s, double x) { s.gains.joint_damping_ratio = x; }, 0,
       -1e-9},
      {tip, "task_damping_ratio", [](S& s, double x) { s.gains.task_damping_ratio = x; }, 2, 2.001},
      {tip, "task_damping_ratio", [](S& s, double x) { s.gains.task_damping_ratio = x; }, 0, -1e-9},
      {joint, "wrench", [](S& s, double x) { s.wrench[5] = x; }, 1e9, 1.001e9},
      {joint, "wrench", [](S& s, double x) { s.wrench[0] = x; }, -1e9, -1.001e9},
      {tip, "tip_pose.position", [](S& s, double x) { s.tip_pose.position.y() = x; }, -1e6,
       -1.001e6},
      {tip, "tip_pose.rotation", turned_by, 0.9e-6, 1.1e-6},
      {tip, "tip_pose.rotation", turned_by, -0.9e-6, -1.1e-6},
  };
  for (const Edge& edge : edges) {
    SCOPED_TRACE(edge.key + ": " + std::to_string(edge.bad));
    Setpoint setpoint = good_setpoint(edge.mode);
    ASSERT_EQ(fault(setpoint), "");
    edge.set(setpoint, edge.good);
    EXPECT_EQ(fault(setpoint), "");
    setpoint = good_setpoint(edge.mode);
    edge.set(setpoint, edge.bad);
    EXPECT_EQ(fault(setpoint), edge.key);
    const bool of_gains =
        edge.key.find("ness") != std::string::npos || edge.key.find("damping") != std::string::npos;
    EXPECT_EQ(fault(setpoint, true), of_gains ? "" : edge.key);
    setpoint = good_setpoint(edge.mode);
    edge.set(setpoint, kNoNumber);
    EXPECT_EQ(fault(setpoint), edge.key);
  }
}

TEST(SetpointCheck, AsksForEverySizeAndLooksAtThePoseInItsModeAlone) {
  const Mode joint = Mode::kJoint, tip = Mode::kCartesian;
  const struct {
    Mode mode;
    std::string key;
    void (*spoil)(Setpoint&);
  } cases[] = {
      {joint, "joint_position", [](Setpoint& s) { s.joint_position.resize(0); }},
      {joint, "joint_position", [](Setpoint& s) { s.joint_position.setZero(3); }},
      {tip, "", [](Setpoint& s) { s.joint_position.resize(0); }},
      {tip, "joint_position", [](Setpoint& s) { s.joint_position.setZero(1); }},
      {joint, "joint_stiffness", [](Setpoint& s) { s.gains.joint_stiffness.setIdentity(2, 3); }},
      {joint, "joint_stiffness", [](Setpoint& s) { s.gains.joint_stiffness.setIdentity(3, 2); }},
      {joint, "joint_damping", [](Setpoint& s) { s.gains.joint_damping.setIdentity(3, 3); }},
      {tip, "",
       [](Setpoint& s) { s.gains.null_stiffness.resize(0), s.gains.null_damping.resize(0); }},
      {tip, "null_stiffness", [](Setpoint& s) { s.gains.null_stiffness.setZero(1); }},
      {tip, "null_damping", [](Setpoint& s) { s.gains.null_damping.setZero(3); }},
      {tip, "frame", [](Setpoint& s) { s.gains.frame = static_cast<Frame>(2); }},
      {tip, "", [](Setpoint& s) { s.gains.frame = Frame::kTool; }},
      {joint, "", [](Setpoint& s) { s.tip_pose.position[0] = kNoNumber; }},
      {tip, "tip_pose.position", [](Setpoint& s) { s.tip_pose.position[0] = kNoNumber; }},
      {tip, "tip_pose.position", [](Setpoint& s) { s.tip_pose = Setpoint().tip_pose; }},
      {joint, "mode", [](Setpoint& s) { s.mode = static_cast<Mode>(2); }},
  };
  for (const auto& [mode, key, spoil] : cases) {
    Setpoint setpoint = good_setpoint(mode);
    spoil(setpoint);
    EXPECT_EQ(fault(setpoint), key);
  }
}

// The position of a joint without limits is bounded all the same.
TEST(SetpointCheck, BoundsThePositionOfAContinuousJoint) {
  Limits limits = limits_of_two_joints();
  limits.position_lower.setConstant(-std::numeric_limits<double>::infinity());
  limits.position_upper = -limits.position_lower;
  Setpoint setpoint = good_setpoint(Mode::kJoint);
  for (const double sign : {-1, 1}) {
    setpoint.joint_position[0] = sign * 1e6;
    EXPECT_EQ(fault(setpoint, false, limits), "");
    setpoint.joint_position[0] = sign * 1.001e6;
    EXPECT_EQ(fault(setpoint, false, limits), "joint_position");
  }
}

TEST(SameGains, SeesEveryDifference) {
  const Gains gains = good_setpoint(Mode::kJoint).gains;
  EXPECT_TRUE(same_gains(gains, gains));
  const std::vector<std::function<void(Gains&)>> changes = {
      [](Gains& g) { g.frame = Frame::kTool; },
      [](Gains& g) { g.directions[4] = false; },
      [](Gains& g) { g.joint_stiffness(0, 1) = 1e-9; },
      [](Gains& g) { g.joint_damping(1, 0) = 1e-9; },
      [](Gains& g) { g.joint_stiffness.setIdentity(1, 2); },
      [](Gains& g) { g.joint_damping.setIdentity(2, 1); },
      [](Gains& g) { g.joint_damping_ratio = 0.5; },
      [](Gains& g) { g.task_stiffness(5, 0) = 1e-9; },
      [](Gains& g) { g.task_damping(0, 5) = 1e-9; },
      [](Gains& g) { g.task_damping_ratio = 0.5; },
      [](Gains& g) { g.null_stiffness[1] = 2; },
      [](Gains& g) { g.null_damping[0] = 2; },
      [](Gains& g) { g.null_damping.setOnes(3); },
  };
  for (std::size_t i = 0; i < changes.size(); ++i) {
    Gains other = gains;
    changes[i](other);
    EXPECT_FALSE(same_gains(gains, other)) << i;
    EXPECT_FALSE(same_gains(other, gains)) << i;
  }
}

}  // namespace
}  // namespace dashpot::controller
