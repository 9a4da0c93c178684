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

/// Of the closed loop that a configuration file has at q, rad/s, by falling frequency.
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

/// An arm that holds its tip gets another T: nothing moves but T, and the modes become those of an
/// arm that was configured with it.
TEST(RunWithCommands, MovesTheToolFrameOfAnArmAtRest) {
  const std::string url = own_url();
  Listener listener(url);
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
  Running run({"run", file, "--commands", "--lcm-url", url, "--duration", "60", "--json"});
  if (!listener.until([&] { return listener.states > 1000 && listener.modes_messages > 0; })) {
    GTEST_SKIP() << "multicast does not work on this machine: " << url;
  }
  const state_t start = listener.state;
  EXPECT_EQ(start.tool_quaternion[0], 1);
  double moved = 0, jump = 0;  // rad, N m
  const auto until = [&](const auto& done) {
    return listener.until([&] {
      for (std::size_t i = 0; i < 7; ++i) {
        const state_t& now = listener.state;
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
    listener.bus().publish(lcmtypes::kCommandChannel, &command);
  };
  const auto accepted = [&] {
    return until([&] { return listener.state.commands_accepted == sequence; });
  };
  command_t command = joint_command(start, 0, 0);
  command.tool_position[1] = 0.02;
  command.tool_position[2] = 0.1;
  command.tool_quaternion[0] = command.tool_quaternion[3] = std::sqrt(0.5);
  send(command, command_t::TOOL_FRAME);
  ASSERT_TRUE(accepted());
  ASSERT_TRUE(until([&] { return listener.state.tool_position[2] == 0.1; }));
  const std::int64_t there = listener.state.tick;
  ASSERT_TRUE(
      until([&] { return listener.modes.tick > there && listener.state.tick > there + 500; }));
  EXPECT_NEAR(listener.state.tool_quaternion[3], std::sqrt(0.5), 1e-12);
  EXPECT_NEAR(distance(listener.state.tip_position, start.tip_position), std::hypot(0.02, 0.1),
              1e-6);
  EXPECT_LT(distance(listener.state.tip_position, listener.state.reference_tip_position), 1e-6);
  EXPECT_LT(moved, 1e-6);
  EXPECT_LT(jump, 1e-3);
  const std::vector<double> wanted = frequencies(configured, listener.modes.joint_position);
  const std::vector<double> before = frequencies(file, listener.modes.joint_position);
  ASSERT_EQ(listener.modes.natural_frequency.size(), wanted.size());
  double changed_by = 0;
  for (std::size_t i = 0; i < wanted.size(); ++i) {
    EXPECT_NEAR(listener.modes.natural_frequency[i], wanted[i], 1e-9 * wanted[i]) << i;
    changed_by = std::max(changed_by, std::abs(before[i] / wanted[i] - 1));
  }
  EXPECT_GT(changed_by, 0.02);
  // A pose is one of the T told last: where that is already, nothing moves.
  std::copy_n(listener.state.tip_position, 3, command.tip_position);
  std::copy_n(listener.state.tip_quaternion, 4, command.tip_quaternion);
  send(command, command_t::TIP_POSE);
  ASSERT_TRUE(accepted());
  const std::int64_t posed = listener.state.tick;
  ASSERT_TRUE(until([&] { return listener.state.tick > posed + 500; }));
  EXPECT_LT(moved, 1e-6);
  EXPECT_LT(jump, 1e-3);
  // Or of the one that comes with it.
  std::copy_n(start.tip_position, 3, command.tip_position);
  std::copy_n(start.tip_quaternion, 4, command.tip_quaternion);
  command.tool_position[1] = command.tool_position[2] = 0;
  command.tool_quaternion[0] = 1;
  command.tool_quaternion[3] = 0;
  send(command, int{command_t::TOOL_FRAME} + int{command_t::TIP_POSE});
  ASSERT_TRUE(accepted());
  ASSERT_TRUE(until([&] { return listener.state.tool_position[2] == 0; }));
  const std::int64_t back = listener.state.tick;
  ASSERT_TRUE(until([&] { return listener.state.tick > back + 500; }));
  EXPECT_LT(moved, 1e-6);
  EXPECT_LT(jump, 1e-3);
  // A pose before its T, both within a tick or not, is one of the T before.
  command.tip_position[1] += 0.02;
  send(command, command_t::TIP_POSE);
  command.tool_position[2] = 0.15;
  send(command, command_t::TOOL_FRAME);
  ASSERT_TRUE(accepted());
  ASSERT_TRUE(until([&] { return listener.state.tool_position[2] == 0.15; }));
  const std::int64_t gone = listener.state.tick;
  ASSERT_TRUE(until([&] { return listener.state.tick > gone + 1500; }));
  double wanted_tip[3];  // 0.15 m along the third axis of the quaternion
  const auto& w = command.tip_quaternion;
  const double axis[3] = {2 * (w[1] * w[3] + w[0] * w[2]), 2 * (w[2] * w[3] - w[0] * w[1]),
                          1 - 2 * (w[1] * w[1] + w[2] * w[2])};
  for (int i = 0; i < 3; ++i) wanted_tip[i] = command.tip_position[i] + 0.15 * axis[i];
  EXPECT_LT(distance(listener.state.reference_tip_position, wanted_tip), 1e-9);
  EXPECT_LT(distance(listener.state.tip_position, wanted_tip), 1e-3);
  // What the scene does not allow is refused.
  command.tool_position[2] = 0.21;
  send(command, command_t::TOOL_FRAME);
  ASSERT_TRUE(until([&] { return listener.state.verdicts[state_t::OUT_OF_LIMITS] == 1; }));
  EXPECT_EQ(listener.state.tool_position[2], 0.15);
  run.send(SIGTERM);
  EXPECT_EQ(run.finish(), 0);
}

/// Where a scenario wants the tip is a place of the configuration's T, whatever was told since.
TEST(RunWithCommands, GoesWhereTheScenarioWantsTheTipLinkWithAnotherTool) {
  const std::string url = own_url();
  Listener listener(url);
  const Scratch scratch;
  const std::string file =
      changed(scratch, "panda_release_c2",
              {{"tip_displacement: [0, 2 cm, 0, 0, 0, 0]",
                "tip_displacement: [0, 0, 0, 0, 0, 0]\n  steps:\n    - at: 4 s\n      "
                "tip_displacement: [0, 3 cm, 0, 0, 0, 0]"},
               {"scenario:", "commands: {silence: 30 s, oldest: 20 s}\nscenario:"}});
  Running run({"run", file, "--commands", "--lcm-url", url, "--duration", "60", "--json"});
  if (!listener.until([&] { return listener.states > 100; })) {
    GTEST_SKIP() << "multicast does not work on this machine: " << url;
  }
  const state_t start = listener.state;
  command_t command = joint_command(start, 0, 1);
  command.parts = command_t::TOOL_FRAME;
  command.tool_position[2] = 0.1;
  command.tool_quaternion[0] = 1;
  listener.bus().publish(lcmtypes::kCommandChannel, &command);
  ASSERT_TRUE(listener.until([&] { return listener.state.tool_position[2] == 0.1; }));
  const auto y = [&] { return listener.state.reference_tip_position[1] - start.tip_position[1]; };
  EXPECT_TRUE(listener.until([&] { return std::abs(y() - 0.03) < 1e-9; })) << y();
  // The tool points downward, as far as the tip link does.
  EXPECT_NEAR(listener.state.reference_tip_position[2], start.tip_position[2] - 0.1, 1e-4);
  run.send(SIGTERM);
  EXPECT_EQ(run.finish(), 0);
}

}  // namespace
}  // namespace dashpot::tests
