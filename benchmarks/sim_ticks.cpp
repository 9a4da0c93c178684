// Periods of a simulated Panda with one effect beyond gravity and rigid bodies, which
// instruction_count.sh counts.
//     sim_ticks KIND TICKS
#include <dashpot/sim/arm.hpp>
#include <dashpot/sim/plant.hpp>
#include <dashpot/tests/support/places.hpp>

#include <cstdio>
#include <cstdlib>
#include <functional>
#include <map>
#include <string>

namespace {

using namespace dashpot::sim;  // NOLINT(google-build-using-namespace)

struct Kind {
  RobotParameters parameters;
  ArmOptions arm;
  PlantOptions plant;
};

/// The effect of each kind; its values do not matter.
const std::map<std::string, std::function<void(Kind&)>>& kinds() {
  static const std::map<std::string, std::function<void(Kind&)>> all = {
      {"bare", [](Kind&) {}},
      {"viscous", [](Kind& k) { k.parameters.viscous_friction.setConstant(7, 0.5); }},
      {"coulomb", [](Kind& k) { k.parameters.coulomb_friction.setConstant(7, 0.1); }},
      {"stops",
       [](Kind& k) {
         k.arm.stops = Contact{2000, 20};
       }},
      {"wall", [](Kind& k) { k.arm.wall = Wall{}; }},
      {"wrench",
       [](Kind& k) {
         k.arm.wrenches = {{0, 1e9, Vector6::Ones()}};
       }},
      {"limit", [](Kind& k) { k.plant.torque_limit.setConstant(7, 80); }},
      {"delay", [](Kind& k) { k.plant.delay = 1; }},
      {"cutoff", [](Kind& k) { k.plant.torque_cutoff = 100; }},
      {"noise", [](Kind& k) { k.plant.position_noise.setConstant(7, 1e-6); }},
      {"counts", [](Kind& k) { k.plant.position_resolution.setConstant(7, 1e-6); }},
      {"differences", [](Kind& k) { k.plant.difference_velocity = true; }}};
  return all;
}

}  // namespace

int main(int argc, char** argv) {
  if (argc != 3 || !kinds().contains(argv[1])) {
    for (const auto& [name, unused] : kinds()) std::printf("%s\n", name.c_str());
    return argc == 1 ? 0 : 2;
  }
  Kind kind;
  kind.parameters.viscous_friction = JointVector::Zero(7);
  kind.parameters.coulomb_friction = JointVector::Zero(7);
  kinds().at(argv[1])(kind);
  Arm arm(Robot::from_file(DASHPOT_SOURCE_DIR "/sim/models/panda.urdf", "panda_link0",
                           "panda_hand_tcp", kind.parameters),
          kind.arm);
  JointVector q(7);
  q << 0, -0.785, 0, -2.356, 0, 1.571, 0.785;
  Plant plant(arm, kind.plant, q);
  const JointVector torque = JointVector::LinSpaced(7, -1, 1);
  for (int i = 0; i < std::atoi(argv[2]); ++i) {
    if (plant.step(torque) != Status::kOk) return 1;
  }
  return 0;
}
