// Commands to a running loop, with a controller that only records them.
#include <dashpot/apps/loop/loop_goal.hpp>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <Eigen/Geometry>
#include <algorithm>
#include <functional>
#include <limits>
#include <string>
#include <vector>

namespace dashpot::apps {
namespace {

using ::testing::ElementsAre;
using ::testing::IsEmpty;

/// Refuses what `refused` names.
class Notes : public LoopController {
 public:
  std::vector<std::string> calls;
  std::string refused, warned;
  std::function<void()> meanwhile;  ///< called while a payload is judged

  std::int32_t update(std::int64_t, const JointVector&, const JointVector&,
                      const controller::Setpoint*, JointVector&) noexcept override {
    return DASHPOT_OK;
  }
  void stop() noexcept override {}
  bool needs_brakes() const noexcept override { return false; }
  const dashpot_snapshot& snapshot() noexcept override { return snapshot_; }
  const dashpot_modes* new_modes() noexcept override { return nullptr; }
  std::int32_t start(const JointVector&, std::string&) override { return DASHPOT_OK; }
  std::int32_t set_gains(const controller::Gains& gains, std::string& reason) override {
    return note("gains " + number(gains.task_damping_ratio), reason);
  }
  std::int32_t set_payload(const controller::Payload& payload, const controller::Pose& tool,
                           const controller::Gains* gains, std::string& reason) override {
    if (meanwhile) meanwhile();
    const std::string with = gains ? " with " + number(gains->task_damping_ratio) : "";
    const std::string at = tool.position.isZero(0) ? "" : " at " + number(tool.position.z());
    return note("payload " + number(payload.mass) + at + with, reason);
  }
  std::int32_t limit_tip_speed(const controller::TipSpeed& speed, std::string& reason) override {
    return note("speed " + number(speed.linear), reason);
  }
  std::int32_t check(const controller::Setpoint&, const JointVector&, std::string&) override {
    return DASHPOT_OK;
  }
  std::int32_t release() override {
    calls.emplace_back("release");
    return DASHPOT_OK;
  }

 private:
  static std::string number(double value) {
    std::string text = std::to_string(value);
    return text.substr(0, text.find('.') + 2);
  }
  std::int32_t note(const std::string& call, std::string& reason) {
    calls.push_back(call);
    const bool fails = !refused.empty() && call.starts_with(refused);
    reason = fails ? "no " + call : warned;
    return fails ? DASHPOT_UNSTABLE_GAINS : DASHPOT_OK;
  }
  dashpot_snapshot snapshot_{};
};

class Goal : public ::testing::Test {
 protected:
  Goal() { setpoint.gains.task_damping_ratio = 0.7; }
  static std::function<void(controller::Gains&)> ratio(double value) {
    return [value](controller::Gains& gains) { gains.task_damping_ratio = value; };
  }

  Notes notes;
  LoopGoal goal{notes, 100};
  controller::Setpoint setpoint;
  std::string reason;
};

TEST_F(Goal, RefusesChangesUntilTheLoopHasBegun) {
  LoopGoal::Change all{ratio(0.5), controller::Payload{2}, {}, controller::TipSpeed{.linear = 0.1}};
  EXPECT_EQ(goal.change(all, reason), DASHPOT_NOTHING_YET);
  EXPECT_EQ(reason, "the loop has not begun");
  goal.release();
  EXPECT_THAT(notes.calls, IsEmpty());
  goal.begin(setpoint, {});
  EXPECT_EQ(goal.change(all, reason), DASHPOT_OK);
  goal.release();
  EXPECT_THAT(notes.calls, ElementsAre("speed 0.1", "payload 2.0 with 0.5", "release"));
}

TEST_F(Goal, HasGainsAndPayloadJudgedTogether) {
  goal.begin(setpoint, {});
  EXPECT_EQ(goal.change({ratio(0.7), controller::Payload{2}, {}, {}}, reason), DASHPOT_OK);
  EXPECT_EQ(goal.change({ratio(0.6), {}, {}, {}}, reason), DASHPOT_OK);
  EXPECT_EQ(goal.change({ratio(0.6), {}, {}, {}}, reason), DASHPOT_OK);  // nothing is new
  EXPECT_THAT(notes.calls, ElementsAre("payload 2.0", "gains 0.6"));
}

TEST_F(Goal, LeavesAllAsItWasIfSomethingIsRefused) {
  goal.begin(setpoint, {});
  ASSERT_EQ(goal.change({{}, {}, {}, controller::TipSpeed{.linear = 0.3}}, reason), DASHPOT_OK);
  notes.calls.clear();
  notes.refused = "payload";
  LoopGoal::Change all{ratio(0.5), controller::Payload{2}, {}, controller::TipSpeed{.linear = 0.1}};
  EXPECT_EQ(goal.change(all, reason), DASHPOT_UNSTABLE_GAINS);
  EXPECT_EQ(reason, "no payload 2.0 with 0.5");
  EXPECT_THAT(notes.calls, ElementsAre("speed 0.1", "payload 2.0 with 0.5", "speed 0.3"));
  // The refused gains are not active: the old gains change nothing, the new ones do.
  notes.calls.clear();
  notes.refused = "";
  EXPECT_EQ(goal.change({ratio(0.7), {}, {}, {}}, reason), DASHPOT_OK);
  EXPECT_EQ(goal.change({ratio(0.5), {}, {}, {}}, reason), DASHPOT_OK);
  EXPECT_THAT(notes.calls, ElementsAre("gains 0.5"));
  // If the speed is refused, nothing else is tried.
  notes.calls.clear();
  notes.refused = "speed";
  EXPECT_EQ(goal.change({ratio(0.4), controller::Payload{1}, {}, controller::TipSpeed{.linear = 9}},
                        reason),
            DASHPOT_UNSTABLE_GAINS);
  EXPECT_THAT(notes.calls, ElementsAre("speed 9.0"));
}

TEST_F(Goal, WarnsOfWhatIsTakenNevertheless) {
  goal.begin(setpoint, {});
  notes.warned = "little margin";
  ::testing::internal::CaptureStderr();
  EXPECT_EQ(goal.change({ratio(0.5), {}, {}, {}}, reason), DASHPOT_OK);
  EXPECT_EQ(::testing::internal::GetCapturedStderr(), "warning: little margin\n");
}

/// T so far along the z axis of the tip link.
controller::Pose tool_at(double z) {
  controller::Pose tool;
  tool.position.z() = z;
  return tool;
}

TEST_F(Goal, TellsToolAndPayloadEachWithTheOther) {
  goal.begin(setpoint, controller::Attachment(controller::Payload{1}, tool_at(0.1)));
  EXPECT_EQ(goal.change({{}, {}, tool_at(0.2), {}}, reason), DASHPOT_OK);
  EXPECT_EQ(goal.change({ratio(0.5), controller::Payload{3}, {}, {}}, reason), DASHPOT_OK);
  notes.refused = "payload";
  EXPECT_EQ(goal.change({{}, controller::Payload{4}, tool_at(0.3), {}}, reason),
            DASHPOT_UNSTABLE_GAINS);
  EXPECT_EQ(goal.latest_tool().position.z(), 0.2);
  notes.refused = "";
  EXPECT_EQ(goal.change({{}, {}, tool_at(0.4), {}}, reason), DASHPOT_OK);
  EXPECT_EQ(goal.latest_tool().position.z(), 0.4);
  EXPECT_THAT(notes.calls, ElementsAre("payload 1.0 at 0.2", "payload 3.0 at 0.2 with 0.5",
                                       "payload 4.0 at 0.3", "payload 3.0 at 0.4"));
}

/// A tick gives the controller a pose of the T that an earlier tick has taken up. So it gives none
/// while a new T may or may not have been taken up.
TEST_F(Goal, HoldsTheSamePlaceOnTheTipLinkWithANewTool) {
  setpoint.tip_pose.position << 0.5, 0, 0.4;
  setpoint.tip_pose.rotation = Eigen::AngleAxisd(0.5, Eigen::Vector3d::UnitX()).matrix();
  goal.begin(setpoint, controller::Attachment({}, tool_at(0.1)));
  std::int64_t time = 0;
  const auto tick = [&] {
    const controller::Setpoint* told = goal.told(++time);
    goal.note_status(DASHPOT_OK);
    return told;
  };
  ASSERT_NE(tick(), nullptr);
  notes.meanwhile = [&] {
    EXPECT_EQ(tick(), nullptr);
    EXPECT_EQ(goal.tool().position.z(), 0.1);
  };
  ASSERT_EQ(goal.change({{}, {}, tool_at(0.3), {}}, reason), DASHPOT_OK);
  EXPECT_EQ(tick(), nullptr);
  const controller::Setpoint* told = tick();
  ASSERT_NE(told, nullptr);
  EXPECT_EQ(told->time, time);  // read again
  const Eigen::Vector3d moved =
      setpoint.tip_pose.position + 0.2 * setpoint.tip_pose.rotation.col(2);
  EXPECT_LT((told->tip_pose.position - moved).norm(), 1e-15);
  EXPECT_EQ(goal.tool().position.z(), 0.3);
  // A refused tool has no effect, and a rejected pose restores the previous one, of this T.
  notes.refused = "payload";
  notes.meanwhile = nullptr;
  ASSERT_NE(goal.change({{}, {}, tool_at(0.7), {}}, reason), DASHPOT_OK);
  EXPECT_EQ(tick(), nullptr);
  EXPECT_LT((tick()->tip_pose.position - moved).norm(), 1e-15);
  controller::Setpoint far = *told;
  far.tip_pose.position.x() = 100;
  goal.hold(far);
  notes.refused = "";
  ASSERT_EQ(goal.change({{}, {}, tool_at(0.1), {}}, reason), DASHPOT_OK);
  EXPECT_EQ(tick(), nullptr);
  told = goal.told(++time);
  EXPECT_NEAR(told->tip_pose.position.x(), 100, 1e-12);
  goal.note_status(DASHPOT_SETPOINT_REJECTED);
  EXPECT_LT((tick()->tip_pose.position - setpoint.tip_pose.position).norm(), 1e-15);
  // A payload alone does not delay the set-point.
  ASSERT_EQ(goal.change({{}, controller::Payload{1}, {}, {}}, reason), DASHPOT_OK);
  EXPECT_NE(tick(), nullptr);
}

TEST_F(Goal, GoesWhereItWasToldWhileAToolWasJudged) {
  goal.begin(setpoint, {});
  controller::Setpoint next = setpoint;
  next.tip_pose.position << 0.3, 0.2, 0.1;
  goal.told(1);
  goal.note_status(DASHPOT_OK);
  notes.meanwhile = [&] {
    goal.hold(next);
    EXPECT_EQ(goal.told(2), nullptr);
    goal.note_status(DASHPOT_OK);
  };
  ASSERT_EQ(goal.change({{}, {}, tool_at(0.1), {}}, reason), DASHPOT_OK);
  EXPECT_EQ(goal.told(3), nullptr);
  goal.note_status(DASHPOT_OK);
  const controller::Setpoint* told = goal.told(4);
  ASSERT_NE(told, nullptr);
  EXPECT_EQ(told->time, 4);
  EXPECT_LT((told->tip_pose.position - Eigen::Vector3d(0.3, 0.2, 0.2)).norm(), 1e-15);
}

}  // namespace
}  // namespace dashpot::apps
