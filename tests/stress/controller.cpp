// Drives controllers of several arms with hostile input for a given number of ticks and stops at
// the first torque that is not finite or above a limit.
#include <dashpot/tests/stress/part.hpp>
#include <dashpot/tests/support/hostile_ticks.hpp>
#include <dashpot/tests/support/places.hpp>
#include <dashpot/tests/support/random_robot.hpp>

#include <cstdio>
#include <map>
#include <string>
#include <vector>

namespace {

using namespace dashpot::controller;  // NOLINT(google-build-using-namespace)
using dashpot::stress::Request;
using dashpot::testing::HostileTicks;

struct Robot {
  std::string name;
  RobotModel model;
};

std::vector<Robot> robots() {
  const std::string models = DASHPOT_SOURCE_DIR "/sim/models/";
  const auto chain = [](int n) {
    const std::string text = dashpot::testing::RandomRobot(static_cast<unsigned>(n)).chain(n, 0.2);
    return RobotModel::from_urdf_text(text, "link0", "tip");
  };
  return {{"panda", RobotModel::from_urdf_file(models + "panda.urdf", "panda_link0", "panda_hand")},
          {"ur5", RobotModel::from_urdf_file(models + "ur5.urdf", "base_link", "ee_link")},
          {"one joint", chain(1)},
          {"14 joints", chain(14)}};
}

/// Whether all went well.
bool drive(const Robot& robot, long ticks, std::uint64_t seed) {
  const Settings settings = HostileTicks::everything_on(robot.model);
  Controller controller(robot.model, settings);
  HostileTicks input(robot.model, settings, seed, 0.02);
  dashpot::testing::TorqueWatch watch(settings);
  std::map<Status, long> seen;
  JointVector torque;
  for (long k = 0; k < ticks; ++k) {
    input.next();
    if (input.releases()) controller.release();
    ++seen[controller.update(input.state, input.setpoint, torque)];
    if (const char* fault = watch.see(torque)) {
      std::printf("%s, seed %lu, tick %ld: torque %s\n", robot.name.c_str(), seed, k, fault);
      return false;
    }
  }
  std::printf("%s, seed %lu: %ld ticks, every torque finite and within its limits\n",
              robot.name.c_str(), seed, ticks);
  for (const auto& [status, count] : seen) std::printf("  %9ld  %s\n", count, to_text(status));
  return true;
}

bool drive_all(const Request& request) {
  const std::vector<Robot> all = robots();
  bool good = true;
  for (const Robot& robot : all) {
    good &= drive(robot, request.whole() / static_cast<long>(all.size()), request.seed);
  }
  return good;
}

const dashpot::stress::AddPart part({"controller",
                                     1,
                                     "Drive controllers of several arms with hostile input",
                                     "TICKS",
                                     {{10'000'000, 40'000}},
                                     drive_all,
                                     {"SEED"}});

}  // namespace
