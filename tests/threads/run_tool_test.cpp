// `dashpot run` with commands that give the arm another tool.
#include <dashpot/analysis/spectrum.hpp>
#include <dashpot/controller/config.hpp>
#include <dashpot/controller/posture_loop.hpp>
#include <dashpot/tests/apps/scene_run.hpp>
#include <dashpot/tests/threads/live_run.hpp>

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

namespace dashpot::tests {
namespace {

/// Returns the frequencies of a configuration's closed loop at q, rad/s, by falling frequency.
std::vector<double> frequencies(const std::string& path, const std::vector<double>& q) {
  const controller::Config config = controller::load_config(path);
  controller::PostureLoop loop(config.model, config.settings);
  analysis::System<controller::kMaxJoints> system;
  const controller::Setpoint& initial = config.settings.initial;
  EXPECT_EQ(loop.closed_loop(Eigen::Map<const Eigen::VectorXd>(q.data(), 7), initial.gains,
                             initial.mode, system),
            controller::Status::kOk);
  analysis::SpectrumSolver<controller::kMaxJoints> solver;
  analysis::Spectrum<controller::kMaxJoints> spectrum;
  EXPECT_EQ(solver.solve(system, spectrum), analysis::Status::kOk);
  std::vector<double> result;
  for (const auto& mode : spectrum.modes) result.push_back(mode.natural_frequency);
  return result;
}

double distance(const double (&a)[3], const double (&b)[3]) {
  return std::hypot(a[0] - b[0], a[1] - b[1], a[2] - b[2]);
}

/// An arm that holds its tip gets another T: nothing moves but T, and the modes become the modes of
/// an arm that was configured with it.
TEST(RunWithCommands, MovesTheToolFrameOfAnArmAtRest) {
  const Scratch scratch, with_tool;
  std::vector<std::pair<std::string, std::string>> changes = {
      {"tip_displacement: [0, 2 cm", "tip_displacement: [0, 0"},
      {"stiffness: 0 Nm/rad\n    damping: 0 Nms/rad",
       "stiffness: 10 Nm/rad\n    damping: 5 Nms/rad"},
      {"scenario:", "commands: {silence: 30 s, oldest: 20 s, tool_distance: 0.2 m}\nscenario:"}};
  const std::string file = changed(scratch, "panda_release_c2", changes);
  changes.emplace_back("  viscous",
                       "  tool: {position: [0, 2 cm, 10 cm], rpy: [0, 0, 90 deg]}\n  viscous");
  const std::string configured = changed(with_tool, "panda_release_c2", changes);
  LiveRun live(file);
  if (!live.until([&] { return live.states > 600 && live.modes_messages > 0; })) {
    GTEST_SKIP() << kNoMulticast;
  }
  const state_t start = live.state;
  EXPECT_EQ(start.tool_quaternion[0], 1);
  double moved = 0, jump = 0;  // rad, N m
  const auto until = [&](const auto& done) {
    return live.until([&] {
      for (std::size_t i = 0; i < 7; ++i) {
        const state_t& now = live.state;
        moved = std::max(moved, std::abs(now.joint_position[i] - start.joint_position[i]));
        jump = std::max(jump, std::abs(now.joint_torque[i] - start.joint_torque[i]));
      }
      return done();
    });
  };
  std::int64_t sequence = 0;
  const auto send = [&](command_t command, std::int32_t parts) {
    command.parts = parts;
    command.sequence = ++sequence;
    command.utime = utime();
    live.publish(command);
  };
  const auto accepted = [&] {
    return until([&] { return live.state.commands_accepted == sequence; });
  };
  command_t command = joint_command(start, 0, 0);
  command.tool_position[1] = 0.02;
  command.tool_position[2] = 0.1;
  command.tool_quaternion[0] = command.tool_quaternion[3] = std::sqrt(0.5);
  send(command, command_t::TOOL_FRAME);
  ASSERT_TRUE(accepted());
  ASSERT_TRUE(until([&] { return live.state.tool_position[2] == 0.1; }));
  const std::int64_t there = live.state.tick;
  ASSERT_TRUE(until([&] { return live.modes.tick > there && live.state.tick > there + 200; }));
  EXPECT_NEAR(live.state.tool_quaternion[3], std::sqrt(0.5), 1e-12);
  EXPECT_NEAR(distance(live.state.tip_position, start.tip_position), std::hypot(0.02, 0.1), 1e-6);
  EXPECT_LT(distance(live.state.tip_position, live.state.reference_tip_position), 1e-6);
  EXPECT_LT(moved, 1e-6);
  EXPECT_LT(jump, 1e-3);
  const std::vector<double> wanted = frequencies(configured, live.modes.joint_position);
  const std::vector<double> before = frequencies(file, live.modes.joint_position);
  ASSERT_EQ(live.modes.natural_frequency.size(), wanted.size());
  double changed_by = 0;
  for (std::size_t i = 0; i < wanted.size(); ++i) {
    EXPECT_NEAR(live.modes.natural_frequency[i], wanted[i], 1e-9 * wanted[i]) << i;
    changed_by = std::max(changed_by, std::abs(before[i] / wanted[i] - 1));
  }
  EXPECT_GT(changed_by, 0.02);
  std::copy_n(start.tip_position, 3, command.tip_position);
  std::copy_n(start.tip_quaternion, 4, command.tip_quaternion);
  // A pose is one of the T that comes with it: nothing moves where that was at first.
  command.tool_position[1] = command.tool_position[2] = 0;
  command.tool_quaternion[0] = 1;
  command.tool_quaternion[3] = 0;
  send(command, int{command_t::TOOL_FRAME} + int{command_t::TIP_POSE});
  ASSERT_TRUE(accepted());
  ASSERT_TRUE(until([&] { return live.state.tool_position[2] == 0; }));
  const std::int64_t back = live.state.tick;
  ASSERT_TRUE(until([&] { return live.state.tick > back + 200; }));
  EXPECT_LT(moved, 1e-6);
  EXPECT_LT(jump, 1e-3);
  // A pose before its T, both within a tick or not, is one of the T before.
  command.tip_position[1] += 0.02;
  send(command, command_t::TIP_POSE);
  command.tool_position[2] = 0.15;
  send(command, command_t::TOOL_FRAME);
  ASSERT_TRUE(accepted());
  ASSERT_TRUE(until([&] { return live.state.tool_position[2] == 0.15; }));
  double wanted_tip[3];  // 0.15 m along the third axis of the quaternion
  const auto& w = command.tip_quaternion;
  const double axis[3] = {2 * (w[1] * w[3] + w[0] * w[2]), 2 * (w[2] * w[3] - w[0] * w[1]),
                          1 - 2 * (w[1] * w[1] + w[2] * w[2])};
  for (int i = 0; i < 3; ++i) wanted_tip[i] = command.tip_position[i] + 0.15 * axis[i];
  EXPECT_TRUE(until([&] {
    return distance(live.state.reference_tip_position, wanted_tip) < 1e-9 &&
           distance(live.state.tip_position, wanted_tip) < 1e-3;
  }));
  // Commands that the scene does not allow are refused.
  command.tool_position[2] = 0.21;
  send(command, command_t::TOOL_FRAME);
  ASSERT_TRUE(until([&] { return live.state.verdicts[state_t::OUT_OF_LIMITS] == 1; }));
  EXPECT_EQ(live.state.tool_position[2], 0.15);
  live.end();
}

/// A scenario's tip targets refer to the configuration's T, also after commands have changed T.
TEST(RunWithCommands, GoesWhereTheScenarioWantsTheTipLinkWithAnotherTool) {
  const Scratch scratch;
  const std::string file =
      changed(scratch, "panda_release_c2",
              {{"tip_displacement: [0, 2 cm, 0, 0, 0, 0]",
                "tip_displacement: [0, 0, 0, 0, 0, 0]\n  steps:\n    - at: 2 s\n      "
                "tip_displacement: [0, 3 cm, 0, 0, 0, 0]"},
               {"scenario:", "commands: {silence: 30 s, oldest: 20 s}\nscenario:"}});
  LiveRun live(file);
  if (!live.heard()) GTEST_SKIP() << kNoMulticast;
  const state_t start = live.state;
  command_t command = joint_command(start, 0, 1);
  command.parts = command_t::TOOL_FRAME;
  command.tool_position[2] = 0.1;
  command.tool_quaternion[0] = 1;
  live.publish(command);
  ASSERT_TRUE(live.until([&] { return live.state.tool_position[2] == 0.1; }));
  const auto y = [&] { return live.state.reference_tip_position[1] - start.tip_position[1]; };
  EXPECT_TRUE(live.until([&] { return std::abs(y() - 0.03) < 1e-9; })) << y();
  // The tool points downward, as far as the tip link does.
  EXPECT_NEAR(live.state.reference_tip_position[2], start.tip_position[2] - 0.1, 1e-4);
  live.end();
}

}  // namespace
}  // namespace dashpot::tests
