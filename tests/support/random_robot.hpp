#pragma once
// URDFs of serial chains with random geometry and inertias, for tests and benchmarks.

#include <dashpot/tests/support/dice.hpp>

#include <Eigen/Core>
#include <Eigen/Geometry>
#include <cmath>
#include <cstdio>
#include <string>

namespace dashpot::testing {

/// Writes numbers so that they read back exactly.
inline std::string exact(double value) {
  char text[32];
  std::snprintf(text, sizeof(text), "%.17g", value);
  return text;
}

inline std::string exact(const Eigen::Vector3d& v) {
  return exact(v.x()) + " " + exact(v.y()) + " " + exact(v.z());
}

inline std::string inertial(double mass, const Eigen::Vector3d& center, const Eigen::Matrix3d& I,
                            const Eigen::Vector3d& rpy = Eigen::Vector3d::Zero()) {
  return "<inertial><origin xyz='" + exact(center) + "' rpy='" + exact(rpy) + "'/><mass value='" +
         exact(mass) + "'/><inertia ixx='" + exact(I(0, 0)) + "' ixy='" + exact(I(0, 1)) +
         "' ixz='" + exact(I(0, 2)) + "' iyy='" + exact(I(1, 1)) + "' iyz='" + exact(I(1, 2)) +
         "' izz='" + exact(I(2, 2)) + "'/></inertial>";
}

struct RandomRobot : Dice {
  using Dice::Dice;

  Eigen::Vector3d vector(double size) {
    return {uniform(-size, size), uniform(-size, size), uniform(-size, size)};
  }
  Eigen::Vector3d direction() { return Eigen::Vector3d(matrix(3, 1)).normalized(); }
  /// About the centre of mass, that a body of this mass and size can have.
  Eigen::Matrix3d inertia(double mass, double size) {
    const Eigen::Matrix3d R = Eigen::AngleAxisd(uniform(0, 3), direction()).toRotationMatrix();
    const Eigen::Vector3d second =
        mass * size * size * Eigen::Vector3d(uniform(0.1, 1), uniform(0.1, 1), uniform(0.1, 1));
    const Eigen::Vector3d moments(second.y() + second.z(), second.x() + second.z(),
                                  second.x() + second.y());
    const Eigen::Matrix3d I = R * moments.asDiagonal() * R.transpose();
    return 0.5 * (I + I.transpose());
  }
  std::string joint(const std::string& name, const std::string& type, const std::string& parent,
                    const std::string& child) {
    return "<joint name='" + name + "' type='" + type + "'><parent link='" + parent +
           "'/><child link='" + child + "'/><origin xyz='" + exact(vector(0.3)) + "' rpy='" +
           exact(vector(3)) + "'/><axis xyz='" + exact(direction()) +
           "'/><limit lower='-2' upper='2' effort='50' velocity='3'/></joint>\n";
  }
  std::string link(const std::string& name) {
    const double mass = uniform(0.2, 3);
    return "<link name='" + name + "'>" +
           inertial(mass, vector(0.1), inertia(mass, 0.1), vector(3)) + "</link>\n";
  }

  /// Links link0 to link<n>, joints joint1 to joint<n>; the share of prismatic joints is as given.
  /// The last link is followed by a fixed joint and the massive link "tip".
  std::string chain(int n, double prismatic) {
    std::string text = "<robot name='random'>\n" + link("link0");
    for (int i = 1; i <= n; ++i) {
      const std::string number = std::to_string(i);
      const double kind = uniform(0, 1);
      const char* type = kind < prismatic ? "prismatic" : kind < 0.9 ? "revolute" : "continuous";
      text += joint("joint" + number, type, "link" + std::to_string(i - 1), "link" + number);
      text += link("link" + number);
    }
    return text + joint("fixed", "fixed", "link" + std::to_string(n), "tip") + link("tip") +
           "</robot>\n";
  }
};

}  // namespace dashpot::testing
