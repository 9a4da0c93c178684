#pragma once
// Arms of a few links in a row, simple enough to tell their numbers by hand.

#include <dashpot/controller/robot_model.hpp>

#include <Eigen/Core>
#include <string>
#include <vector>

namespace dashpot::testing {

/// Links of half a metre and 1 kg along x, one behind the other, by joints of these URDF types
/// about (or along) z: from -3 to 3 rad (m) unless continuous, 2 rad/s, 50 N m, Coulomb friction
/// 0.5 N m.
inline controller::RobotModel chain_of(const std::vector<std::string>& types,
                                       const controller::ModelOptions& options = {}) {
  std::string text = "<robot name='chain'><link name='link0'/>";
  for (std::size_t i = 1; i <= types.size(); ++i) {
    const std::string number = std::to_string(i), before = std::to_string(i - 1);
    const std::string range = types[i - 1] == "continuous" ? "" : " lower='-3' upper='3'";
    text +=
        "<link name='link" + number + "'><inertial><origin xyz='0.25 0 0'/><mass value='1'/>" +
        "<inertia ixx='0.01' ixy='0' ixz='0' iyy='0.02' iyz='0' izz='0.02'/></inertial></link>" +
        "<joint name='joint" + number + "' type='" + types[i - 1] + "'><parent link='link" +
        before + "'/><child link='link" + number + "'/><origin xyz='" + (i > 1 ? "0.5" : "0") +
        " 0 0'/><axis xyz='0 0 1'/><limit effort='50' velocity='2'" + range +
        "/><dynamics friction='0.5'/></joint>";
  }
  return controller::RobotModel::from_urdf_text(text + "</robot>", "link0",
                                                "link" + std::to_string(types.size()), options);
}

/// Inertia of a link of a chain about its joint, kg m^2.
inline constexpr double kLinkInertia = 0.02 + 0.25 * 0.25;

/// One link on a joint without friction, in weightlessness unless told otherwise.
inline controller::RobotModel one_link(controller::ModelOptions options = {},
                                       double gravity_along_x = 0) {
  options.gravity = {gravity_along_x, 0, 0};
  if (options.coulomb_friction.size() == 0) options.coulomb_friction = Eigen::VectorXd::Zero(1);
  options.viscous_friction = Eigen::VectorXd::Zero(1);
  return chain_of({"continuous"}, options);
}

}  // namespace dashpot::testing
