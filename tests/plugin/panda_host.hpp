#pragma once
// The plugin, loaded at run time by a host without Dashpot's headers for C++, and its Panda.

#include <dashpot/controller/plugin.h>
#include <dashpot/controller/dynamics.hpp>
#include <dashpot/tests/plugin/config_file.hpp>
#include <dashpot/tests/support/places.hpp>

#include <dlfcn.h>
#include <gtest/gtest.h>

#include <Eigen/Cholesky>
#include <memory>
#include <stdexcept>
#include <string>
#include <vector>

namespace dashpot::tests {

inline void* plugin_library() {
  static void* const library = dlopen(DASHPOT_PLUGIN, RTLD_NOW | RTLD_LOCAL);
  if (library == nullptr) throw std::runtime_error(dlerror());
  return library;
}

using PluginInterface = const dashpot_plugin* (*)(uint32_t);

inline PluginInterface plugin_interface() {
  void* const symbol = dlsym(plugin_library(), "dashpot_plugin_interface");
  if (symbol == nullptr) throw std::runtime_error(dlerror());
  return reinterpret_cast<PluginInterface>(symbol);
}

inline const dashpot_plugin& plugin() {
  static const dashpot_plugin& functions = *plugin_interface()(DASHPOT_PLUGIN_VERSION);
  return functions;
}

struct Destroy {
  void operator()(dashpot_controller* controller) const { plugin().destroy(controller); }
};
using Handle = std::unique_ptr<dashpot_controller, Destroy>;

/// Returns a struct with only its size set.
template <class Struct>
Struct sized() {
  Struct result{};
  result.struct_size = sizeof result;
  return result;
}

/// Gains of an arm of seven joints, all of them NULL.
inline dashpot_gains panda_gains() {
  auto gains = sized<dashpot_gains>();
  gains.joints = 7;
  return gains;
}

/// A controller configured by `text`, which is null if the plugin refuses.
inline Handle create(const std::string& text) {
  const Scratch scratch;
  return Handle(plugin().create(scratch.write("arm.yaml", text).c_str()));
}

/// A host's data of one arm: its state, and the targets of the C structs' pointers.
struct Host {
  explicit Host(Handle handle, const std::vector<double>& start)
      : controller(std::move(handle)),
        position(start),
        velocity(start.size()),
        torque(start.size()) {}

  std::uint32_t n() const { return static_cast<std::uint32_t>(position.size()); }
  dashpot_state state() const {
    return {sizeof(dashpot_state), n(), time, position.data(), velocity.data(), nullptr};
  }
  dashpot_output output() { return {sizeof(dashpot_output), n(), torque.data()}; }
  /// One tick, a millisecond after the last.
  std::int32_t tick(const dashpot_setpoint* setpoint = nullptr) {
    time += 1'000'000;
    const dashpot_state now = state();
    dashpot_output out = output();
    return plugin().update(controller.get(), &now, setpoint, &out);
  }
  dashpot_setpoint joint_setpoint(const std::vector<double>& goal,
                                  std::int64_t when = DASHPOT_ON_ARRIVAL) const {
    return {sizeof(dashpot_setpoint),
            n(),
            when,
            DASHPOT_MODE_JOINT,
            goal.data(),
            nullptr,
            nullptr,
            nullptr};
  }
  dashpot_snapshot snapshot() const {
    auto result = sized<dashpot_snapshot>();
    EXPECT_EQ(plugin().read_snapshot(controller.get(), &result), DASHPOT_OK);
    return result;
  }
  dashpot_modes modes() const {
    auto result = sized<dashpot_modes>();
    EXPECT_EQ(plugin().read_modes(controller.get(), &result), DASHPOT_OK);
    return result;
  }

  Handle controller;
  std::int64_t time = 1'000'000'000'000;
  std::vector<double> position;
  std::vector<double> velocity;
  std::vector<double> torque;
};

/// Away from limits and singularities.
inline const std::vector<double>& panda_posture() {
  static const std::vector<double> posture = {0, -0.785, 0, -2.356, 0, 1.571, 0.785};
  return posture;
}

inline constexpr const char* kCartesian = "control: {mode: cartesian}\n";

inline controller::JointVector joint_vector(const std::vector<double>& values) {
  return Eigen::Map<const Eigen::VectorXd>(values.data(), static_cast<Eigen::Index>(values.size()));
}

/// Moves the arm of `model` for one period under the host's torque.
inline void simulate(const controller::RobotModel& model, Host& host, double period = 0.001) {
  const controller::JointVector q = joint_vector(host.position);
  const controller::JointVector qd = joint_vector(host.velocity);
  const auto robot = controller::evaluate(model, q, qd);
  const Eigen::VectorXd force = joint_vector(host.torque) - robot.coriolis - robot.gravity;
  const Eigen::MatrixXd M = robot.M;
  const Eigen::VectorXd velocity = qd + period * M.llt().solve(force);
  Eigen::Map<Eigen::VectorXd>(host.velocity.data(), velocity.size()) = velocity;
  Eigen::Map<Eigen::VectorXd>(host.position.data(), velocity.size()) = q + period * velocity;
}

/// Ticks with this set-point, after each of which the arm moves; all must succeed.
inline void run_simulated(const controller::RobotModel& model, Host& host, int ticks,
                          const dashpot_setpoint* setpoint = nullptr) {
  for (int tick = 0; tick < ticks; ++tick) {
    ASSERT_EQ(host.tick(setpoint), DASHPOT_OK) << "tick " << tick;
    simulate(model, host);
  }
}

/// A Panda whose joints start with their gravity torque.
inline Host panda_host(const std::string& settings = "") {
  Host host(create(panda() + settings), panda_posture());
  const auto model = load(panda() + settings).model;
  const controller::JointVector q = joint_vector(panda_posture());
  const Eigen::VectorXd gravity =
      controller::evaluate(model, q, controller::JointVector::Zero(7)).gravity;
  EXPECT_EQ(plugin().reset(host.controller.get(), gravity.data()), DASHPOT_OK);
  return host;
}

}  // namespace dashpot::tests
