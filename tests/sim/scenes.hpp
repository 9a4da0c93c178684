#pragma once
// Small mechanisms with known answers.

#include <dashpot/sim/arm.hpp>
#include <dashpot/sim/plant.hpp>
#include <dashpot/tests/support/linear_system.hpp>
#include <dashpot/tests/support/refusal.hpp>

#include <functional>
#include <ostream>
#include <string>

namespace dashpot::sim {

inline std::string name_of(Method method) {
  const char* const names[] = {"SemiImplicitEuler", "RungeKutta4", "DormandPrince8",
                               "ImplicitMidpoint", "Rosenbrock"};
  return names[static_cast<int>(method)];
}
inline void PrintTo(Method method, std::ostream* out) {
  *out << name_of(method);
}

}  // namespace dashpot::sim

namespace dashpot::testing {

inline const Eigen::MatrixXd kOne = Eigen::MatrixXd::Ones(1, 1),
                             kZero = Eigen::MatrixXd::Zero(1, 1);

inline sim::JointVector joints(std::initializer_list<double> values) {
  sim::JointVector v(static_cast<Eigen::Index>(values.size()));
  Eigen::Index i = 0;
  for (const double value : values) v[i++] = value;
  return v;
}

/// A mass of 2 kg that slides along z, with position limits 0 and 10 m.
inline sim::Robot slider(const Eigen::Vector3d& gravity, double viscous = 0, double coulomb = 0) {
  sim::RobotParameters parameters;
  parameters.gravity = gravity;
  parameters.viscous_friction = joints({viscous});
  parameters.coulomb_friction = joints({coulomb});
  return sim::Robot::from_text(
      "<robot name='slider'><link name='a'/><link name='b'><inertial><mass value='2'/>"
      "<inertia ixx='0.1' iyy='0.1' izz='0.1' ixy='0' ixz='0' iyz='0'/></inertial></link>"
      "<joint name='j' type='prismatic'><parent link='a'/><child link='b'/><axis xyz='0 0 1'/>"
      "<limit lower='0' upper='10' effort='0' velocity='0'/></joint></robot>",
      "a", "b", parameters);
}

/// Bars of 1.5 kg and length 0.8 m on hinges about y, one after the other, hanging along -z at 0.
/// Each has its mass in its middle and a moment of 0.08 kg m^2 about it.
inline sim::Robot pendulum(
    int bars, const std::function<void(sim::RobotParameters&)>& change = [](auto&) {}) {
  std::string text = "<robot name='pendulum'><link name='link0'/>";
  for (int i = 1; i <= bars; ++i) {
    const std::string number = std::to_string(i), before = std::to_string(i - 1);
    text += "<joint name='joint" + number + "' type='continuous'><parent link='link" + before +
            "'/><child link='link" + number + "'/><origin xyz='0 0 " + (i > 1 ? "-0.8" : "0") +
            "'/><axis xyz='0 -1 0'/></joint><link name='link" + number +
            "'><inertial><origin xyz='0 0 -0.4'/><mass value='1.5'/><inertia ixx='0.08' "
            "iyy='0.08' izz='0' ixy='0' ixz='0' iyz='0'/></inertial></link>";
  }
  sim::RobotParameters parameters;
  change(parameters);
  return sim::Robot::from_text(text + "</robot>", "link0", "link" + std::to_string(bars),
                               parameters);
}

/// Returns the InvalidScene message for `make`.
template <class Make>
std::string refusal_of(const Make& make) {
  return refusal<sim::InvalidScene>(make);
}

/// Three masses that drift together (the first example of Kao and Saldarriaga, 2021).
struct Chain3 {
  Eigen::Matrix3d M{{8, 0, 0}, {0, 2, 0}, {0, 0, 5}};
  Eigen::Matrix3d C{{25, -15, -10}, {-15, 35, -20}, {-10, -20, 30}};
  Eigen::Matrix3d K{{3600, -1200, -2400}, {-1200, 2700, -1500}, {-2400, -1500, 3900}};
};

/// Every step of `h` seconds is one period, with one step of the method in it.
inline sim::PlantOptions fixed_steps(sim::Method method, double h) {
  sim::PlantOptions options;
  options.period = h;
  options.integrator.method = method;
  options.integrator.max_step = h;
  return options;
}

/// Near the limit of what rounding allows.
inline sim::PlantOptions precise(double period) {
  sim::PlantOptions options;
  options.period = period;
  options.integrator.method = sim::Method::kDormandPrince8;
  options.integrator.adaptive = true;
  options.integrator.absolute_tolerance = 1e-13;
  options.integrator.relative_tolerance = 1e-13;
  return options;
}

inline sim::Status run(sim::Plant& plant, int ticks) {
  const sim::JointVector zero = sim::JointVector::Zero(plant.position().size());
  for (int i = 0; i < ticks; ++i) {
    if (const sim::Status status = plant.step(zero); status != sim::Status::kOk) return status;
  }
  return sim::Status::kOk;
}

inline constexpr sim::Method kMethods[] = {
    sim::Method::kSemiImplicitEuler, sim::Method::kRungeKutta4, sim::Method::kDormandPrince8,
    sim::Method::kImplicitMidpoint, sim::Method::kRosenbrock};

}  // namespace dashpot::testing
