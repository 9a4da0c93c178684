// The input as a URDF, for the controller and for the simulator: from its first link to its last.
#include <dashpot/controller/dynamics.hpp>
#include <dashpot/controller/robot_model.hpp>
#include <dashpot/sim/arm.hpp>
#include <dashpot/tests/fuzz/fuzz_input.hpp>

#include <console_bridge/console.h>

#include <string>

namespace {

using namespace dashpot;  // NOLINT(google-build-using-namespace)

std::string name_after(const std::string& text, std::size_t at) {
  const std::size_t begin = text.find("name=\"", at);
  if (at == std::string::npos || begin == std::string::npos) return "";
  return text.substr(begin + 6, text.find('"', begin + 6) - begin - 6);
}

void control(const std::string& text, const std::string& base, const std::string& tip) try {
  const auto model = controller::RobotModel::from_urdf_text(text, base, tip);
  const controller::JointVector rest = controller::JointVector::Constant(model.dof(), 0.1);
  controller::evaluate(model, rest, rest);
} catch (const controller::InvalidModel&) {
}

void simulate(const std::string& text, const std::string& base, const std::string& tip) try {
  const sim::Robot robot = sim::Robot::from_text(text, base, tip);
  sim::Arm arm(robot);
  sim::StateVector y = sim::StateVector::Constant(2 * robot.dof() + sim::kWorkChannels, 0.1);
  sim::StateVector y_dot = y;
  arm.begin_segment(0);
  arm.rates(y, y_dot);
} catch (const sim::InvalidRobot&) {
} catch (const sim::InvalidScene&) {
}

}  // namespace

int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  console_bridge::noOutputHandler();
  std::string text(size, '\0');
  std::copy_n(data, size, text.begin());
  const std::string base = name_after(text, text.find("<link"));
  const std::string tip = name_after(text, text.rfind("<link"));
  control(text, base, tip);
  simulate(text, base, tip);
  return 0;
}
