#pragma once
// A Panda with its controller, for tests of what the controller does when something is wrong.

#include <dashpot/tests/support/arms.hpp>
#include <dashpot/tests/support/simulated_arm.hpp>
#include <dashpot/tests/support/special_values.hpp>

#include <gtest/gtest.h>

#include <memory>

namespace dashpot::testing {

using controller::JointVector;
using controller::RobotModel;
using controller::Settings;
using controller::Snapshot;
using controller::Status;

class Safety : public ::testing::Test {
 protected:
  Safety() : model(arm_model(arms()[0])), settings(quiet_settings(model)) { make(); }
  void make() { arm = std::make_unique<SimulatedArm>(model, settings, panda_ready()); }
  void run(double seconds) {
    for (int k = 0; k < static_cast<int>(seconds / settings.period); ++k) {
      ASSERT_EQ(arm->step(), Status::kOk) << to_text(arm->controller.snapshot().status);
    }
  }
  Status tick() {  // no motion
    return arm->controller.update(arm->state, arm->setpoint, arm->torque);
  }
  /// A tick one period later, with a fresh set-point.
  Status next() {
    arm->state.time += 1'000'000;
    if (arm->fresh) arm->setpoint.time = arm->state.time;
    return tick();
  }
  JointVector gravity() const {
    return controller::evaluate(model, arm->state.position, arm->state.velocity).gravity;
  }
  const Snapshot& snapshot() const { return arm->controller.snapshot(); }

  RobotModel model;
  Settings settings;
  std::unique_ptr<SimulatedArm> arm;
};

}  // namespace dashpot::testing
