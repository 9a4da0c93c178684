// The robot's dynamics, and its closed loop with springs and dampers.

#include <dashpot/controller/config.hpp>
#include <dashpot/controller/default_settings.hpp>
#include <dashpot/controller/drives.hpp>
#include <dashpot/controller/posture.hpp>
#include <dashpot/controller/posture_loop.hpp>
#include <dashpot/controller/rotors.hpp>
#include <dashpot/controller/setpoint_check.hpp>
#include <dashpot/controller/settings_check.hpp>
#include <dashpot/python/src/shared.hpp>

#include <array>
#include <cmath>
#include <string_view>

namespace dashpot::python {

using controller::DynamicsResult;
using controller::Gains;
using controller::Joint;
using controller::JointVector;
using controller::Settings;

JointVector Robot::joint_vector(const char* name, const Eigen::VectorXd& values) const {
  if (values.size() != model.dof()) {
    throw std::invalid_argument(std::string(name) + ": has " + std::to_string(values.size()) +
                                " entries, the robot has " + std::to_string(model.dof()) +
                                " joints");
  }
  for (Eigen::Index i = 0; i < values.size(); ++i) {
    if (std::isfinite(values[i])) continue;
    throw std::invalid_argument(std::string(name) + ": entry " + std::to_string(i + 1) +
                                " is not a finite number");
  }
  return values;
}

namespace {

DynamicsResult dynamics(const Robot& robot, const Eigen::VectorXd& q, const OptionalVector& qd) {
  DynamicsResult result;
  const JointVector position = robot.joint_vector("q", q);
  const JointVector rest = JointVector::Zero(robot.model.dof());
  robot.kernel.evaluate(position, qd ? robot.joint_vector("qd", *qd) : rest, result);
  return result;
}

Eigen::MatrixXd tip_pose(const Robot& robot, const Eigen::VectorXd& q) {
  const DynamicsResult at = dynamics(robot, q, {});
  Eigen::MatrixXd T_BT = Eigen::MatrixXd::Identity(4, 4);
  T_BT.topLeftCorner(3, 3) = at.R_BT;
  T_BT.topRightCorner(3, 1) = at.p_BT_B;
  return T_BT;
}

analysis::System<> closed_loop_at(const Robot& robot, const JointVector& q, Gains gains,
                                  controller::Mode mode, const OptionalVector& wrench,
                                  controller::Load load, const std::string& projector,
                                  const OptionalVector& weights) {
  const controller::SetpointFault fault = check_gains(gains, mode, robot.model.dof());
  if (fault) throw std::invalid_argument(std::string(fault.key) + " " + fault.reason);
  gains.null_projector = controller::null_projector_of(projector);
  Settings settings = controller::default_settings(robot.model);
  settings.task_terms.load = load;
  if (weights) settings.null_weights = robot.joint_vector("null_weights", *weights);
  settings.limits.gain_margin = 1;  // no loop is given for which a ratio could be lowered
  return controller::PostureLoop(robot.model, settings)
      .at(q, gains, mode, wrench.value_or(Eigen::VectorXd(Eigen::VectorXd::Zero(6))))
      .system;
}

nb::dict closed_loop(const Robot& robot, const Eigen::VectorXd& q, const Gains& gains,
                     bool cartesian, const OptionalVector& wrench, int load, double soft_frequency,
                     const std::string& projector, const OptionalVector& weights) {
  analysis::System<> system;
  analysis::Spectrum<> spectrum;
  {
    const nb::gil_scoped_release release;
    if (wrench && (wrench->size() != 6 || !wrench->allFinite())) {
      throw std::invalid_argument("external_wrench: six finite numbers are wanted");
    }
    const auto mode = cartesian ? controller::Mode::kCartesian : controller::Mode::kJoint;
    system = closed_loop_at(robot, robot.joint_vector("q", q), gains, mode, wrench,
                            static_cast<controller::Load>(load), projector, weights);
    analysis::SpectrumOptions options;
    options.soft_frequency = soft_frequency;
    spectrum = analysis::analyze(system, options);
  }
  nb::dict result;
  result["mass"] = to_array(system.mass);
  result["damping"] = to_array(system.damping);
  result["stiffness"] = to_array(system.stiffness);
  result["modes"] = modes_of(spectrum);
  return result;
}

/// The robot of a URDF's text, with the key `robot` of another text, as in a configuration.
Robot make_robot(const std::string& urdf, const std::string& text) {
  static constexpr std::array<std::string_view, 1> kKeys = {"robot"};
  const text::YamlNode document = text::parse_made_yaml(text);
  return Robot(controller::read_robot({document, "", kKeys}, "", urdf).model());
}

/// The gains under the key `gains` of a text, as in a configuration.
Gains make_gains(const Robot& robot, const std::string& text) {
  static constexpr std::array<std::string_view, 1> kKeys = {"gains"};
  const text::YamlNode document = text::parse_made_yaml(text);
  return controller::read_gains({document, "", kKeys}, robot.model);
}

nb::dict published_drives() {
  nb::dict all;
  for (const controller::Drives& drives : controller::published_drives()) {
    nb::dict one;
    one["reflected_inertia"] = to_array(drives.values(drives.reflected_inertia));
    one["viscous_friction"] = to_array(drives.values(drives.viscous_friction));
    one["coulomb_friction"] = to_array(drives.values(drives.coulomb_friction));
    one["source"] = std::string(drives.source);
    one["doubt"] = std::string(drives.doubt);
    all[nb::cast(std::string(drives.name))] = one;
  }
  return all;
}

nb::dict joint_properties(const Robot& robot) {
  const auto values = [&](double Joint::*property) {
    return to_array(robot.model.joint_values(property));
  };
  nb::dict result;
  result["lower"] = values(&Joint::lower);
  result["upper"] = values(&Joint::upper);
  result["velocity"] = values(&Joint::velocity);
  result["effort"] = values(&Joint::effort);
  result["viscous_friction"] = values(&Joint::viscous_friction);
  result["coulomb_friction"] = values(&Joint::coulomb_friction);
  result["reflected_inertia"] = values(&Joint::reflected_inertia);
  result["acceleration"] = values(&Joint::acceleration);
  result["deceleration"] = values(&Joint::deceleration);
  result["jerk"] = values(&Joint::jerk);
  result["gear_stiffness"] = values(&Joint::gear_stiffness);
  result["gear_damping"] = values(&Joint::gear_damping);
  return result;
}

}  // namespace

void add_robot(nb::module_& m) {
  using Vector = Eigen::VectorXd;
  m.def("published_drives", &published_drives);
  m.def(
      "has_own_friction",
      [](const std::string& drives) { return controller::has_own_friction(drives); },
      nb::arg("drives"));
  m.def(
      "read_urdf", [](const std::string& path) { return controller::read_urdf_file(path); },
      nb::arg("path"));
  nb::class_<Robot>(m, "Robot", "controller::RobotModel with its DynamicsKernel")
      .def(nb::new_(&make_robot), nb::arg("urdf"), nb::arg("text"))
      .def_prop_ro("name", [](const Robot& robot) { return robot.model.name(); })
      .def("joint_names",
           [](const Robot& robot) {
             return to_list(robot.model.joints(), [](const Joint& joint) { return joint.name; });
           })
      .def("joint_properties", &joint_properties)
      .def("outside_limits",
           [](const Robot& robot, const Vector& q) {
             return controller::outside_limits(robot.model, robot.joint_vector("q", q));
           })
      .def("default_posture",
           [](const Robot& robot) { return to_array(controller::default_posture(robot.model)); })
      .def("warnings", [](const Robot& robot) { return robot.model.warnings(); })
      .def("missing_rotors",
           [](const Robot& robot) { return controller::missing_rotors_text(robot.model); })
      .def("pose", &tip_pose)
      .def("mass",
           [](const Robot& robot, const Vector& q) { return to_array(dynamics(robot, q, {}).M); })
      .def("gravity", [](const Robot& robot,
                         const Vector& q) { return to_array(dynamics(robot, q, {}).gravity); })
      .def("jacobian",
           [](const Robot& robot, const Vector& q) { return to_array(dynamics(robot, q, {}).J); })
      .def("coriolis", [](const Robot& robot, const Vector& q,
                          const Vector& qd) { return to_array(dynamics(robot, q, qd).coriolis); })
      .def("jacobian_dot_qd", [](const Robot& robot, const Vector& q, const Vector& qd) {
        return to_array(dynamics(robot, q, qd).Jdot_qd);
      });
  nb::class_<Gains>(m, "Gains", "controller::Gains")
      .def(nb::new_(&make_gains), nb::arg("robot"), nb::arg("text"))
      .def("doubts", [](const Gains& gains, const Robot& robot) {
        return controller::doubtful_gains(robot.model, gains);
      });
  m.def("closed_loop", &closed_loop, nb::arg("robot"), nb::arg("q"), nb::arg("gains"),
        nb::arg("cartesian"), nb::arg("external_wrench").none(), nb::arg("load"),
        nb::arg("soft_frequency"), nb::arg("projector"), nb::arg("weights").none());
}

}  // namespace dashpot::python
