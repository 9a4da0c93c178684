// Drives controllers of several arms with hostile input for a given number of ticks and stops at
// the first torque that is not finite or above a limit:
//     controller_stress [TICKS [SEED]]
#include <dashpot/tests/support/hostile_ticks.hpp>
#include <dashpot/tests/support/random_robot.hpp>

#include <cstdio>
#include <cstdlib>
#include <map>
#include <string>
#include <vector>

namespace {

using namespace dashpot::controller;  // NOLINT(google-build-using-namespace)
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
      std::printf("%s, seed %llu, tick %ld: torque %s\n", robot.name.c_str(),
                  static_cast<unsigned long long>(seed), k, fault);
      return false;
    }
  }
  std::printf("%s, seed %llu: %ld ticks, every torque finite and within its limits\n",
              robot.name.c_str(), static_cast<unsigned long long>(seed), ticks);
  for (const auto& [status, count] : seen) std::printf("  %9ld  %s\n", count, to_text(status));
  return true;
}

}  // namespace

int main(int argc, char** argv) {
  const long ticks = argc > 1 ? std::atol(argv[1]) : 10'000'000;
  const std::uint64_t seed = argc > 2 ? std::strtoull(argv[2], nullptr, 10) : 1;
  const std::vector<Robot> all = robots();
  bool good = true;
  for (const Robot& robot : all) {
    good &= drive(robot, ticks / static_cast<long>(all.size()), seed);
  }
  return good ? 0 : 1;
}
