#pragma once
// A Franka Panda arm under Cartesian impedance control, moving: mass matrix and Jacobian of the
// public model, by sums over its bodies. Plain and slow, and no code of the project.

#include <dashpot/analysis/system.hpp>

#include <Eigen/Cholesky>
#include <Eigen/Geometry>
#include <array>
#include <cmath>
#include <numbers>
#include <vector>

namespace dashpot::testing {

struct ArmModel {
  Eigen::MatrixXd mass;      ///< 7 x 7, kg m^2
  Eigen::MatrixXd jacobian;  ///< 6 x 7, of the hand's tool centre point in base axes, linear first
};

inline ArmModel panda(const Eigen::VectorXd& q) {
  struct Body {
    Eigen::Vector3d xyz, rpy;  ///< of the joint, in the axes of the body before
    double mass;
    Eigen::Vector3d com;
    std::array<double, 6> inertia;  ///< ixx, ixy, ixz, iyy, iyz, izz about the centre of mass
  };
  constexpr double kHalf = std::numbers::pi / 2;
  static const std::vector<Body> bodies = {
      {{0, 0, 0.333},
       {0, 0, 0},
       4.970684,
       {0.003875, 0.002081, -0.04762},
       {0.70337, -0.000139, 0.006772, 0.70661, 0.019169, 0.009117}},
      {{0, 0, 0},
       {-kHalf, 0, 0},
       0.646926,
       {-0.003141, -0.02872, 0.003495},
       {0.007962, -0.003925, 0.010254, 0.02811, 0.000704, 0.025995}},
      {{0, -0.316, 0},
       {kHalf, 0, 0},
       3.228604,
       {0.027518, 0.039252, -0.066502},
       {0.037242, -0.004761, -0.011396, 0.036155, -0.012805, 0.01083}},
      {{0.0825, 0, 0},
       {kHalf, 0, 0},
       3.587895,
       {-0.05317, 0.104419, 0.027454},
       {0.025853, 0.007796, -0.001332, 0.019552, 0.008641, 0.028323}},
      {{-0.0825, 0.384, 0},
       {-kHalf, 0, 0},
       1.225946,
       {-0.011953, 0.041065, -0.038437},
       {0.035549, -0.002117, -0.004037, 0.029474, 0.000229, 0.008627}},
      {{0, 0, 0},
       {kHalf, 0, 0},
       1.666555,
       {0.060149, -0.014117, -0.010517},
       {0.001964, 0.000109, -0.001158, 0.004354, 0.000341, 0.005433}},
      {{0.088, 0, 0},
       {kHalf, 0, 0},
       0.735522,
       {0.010517, -0.004252, 0.061597},
       {0.012516, -0.000428, -0.001196, 0.010027, -0.000741, 0.004815}},
      {{0, 0, 0.107}, {0, 0, -kHalf / 2}, 0.73, {-0.01, 0, 0.03}, {0.001, 0, 0, 0.0025, 0, 0.0017}},
  };
  const Eigen::Vector3d tip(0, 0, 0.1034);
  ArmModel arm{Eigen::MatrixXd::Zero(7, 7), Eigen::MatrixXd::Zero(6, 7)};
  Eigen::Isometry3d pose = Eigen::Isometry3d::Identity();
  std::vector<Eigen::Vector3d> axes, points;
  const auto jacobian_at = [&](const Eigen::Vector3d& point) {
    Eigen::MatrixXd J = Eigen::MatrixXd::Zero(6, 7);
    for (std::size_t k = 0; k < axes.size(); ++k) {
      const auto column = static_cast<Eigen::Index>(k);
      const Eigen::Vector3d lever = point - points[k];
      J.col(column).head<3>() = axes[k].cross(lever);
      J.col(column).tail<3>() = axes[k];
    }
    return J;
  };
  for (std::size_t i = 0; i < bodies.size(); ++i) {
    const Body& body = bodies[i];
    pose.translate(body.xyz);
    pose.rotate(Eigen::AngleAxisd(body.rpy.z(), Eigen::Vector3d::UnitZ()) *
                Eigen::AngleAxisd(body.rpy.x(), Eigen::Vector3d::UnitX()));
    if (i < 7) {  // the hand is fixed to the last link
      pose.rotate(Eigen::AngleAxisd(q[static_cast<Eigen::Index>(i)], Eigen::Vector3d::UnitZ()));
      axes.emplace_back(pose.linear().col(2));
      points.emplace_back(pose.translation());
    }
    const auto& I = body.inertia;
    Eigen::Matrix3d inertia;
    inertia << I[0], I[1], I[2], I[1], I[3], I[4], I[2], I[4], I[5];
    const Eigen::MatrixXd J = jacobian_at(pose * body.com);
    const Eigen::Matrix3d R = pose.linear();
    arm.mass += body.mass * J.topRows(3).transpose() * J.topRows(3) +
                J.bottomRows(3).transpose() * (R * inertia * R.transpose()) * J.bottomRows(3);
  }
  arm.mass = (0.5 * (arm.mass + arm.mass.transpose())).eval();
  arm.jacobian = jacobian_at(pose * tip);
  return arm;
}

/// K_C = diag(3000, 3000, 3000, 100, 100, 100) N/m and N m/rad, and C_C of damping ratio `ratio` on
/// unit masses as is often seen, 2 ratio sqrt(K_C); W = K_C^1/2 J and C = J' C_C J.
inline analysis::System<analysis::kMaxDof> panda_impedance(const Eigen::VectorXd& q, double ratio) {
  const ArmModel arm = panda(q);
  Eigen::VectorXd K_C(6);
  K_C << 3000, 3000, 3000, 100, 100, 100;
  const Eigen::VectorXd C_C = 2 * ratio * K_C.cwiseSqrt();
  analysis::System<analysis::kMaxDof> system(7);
  system.mass = arm.mass;
  const Eigen::MatrixXd CJ = C_C.cwiseSqrt().asDiagonal() * arm.jacobian;
  const Eigen::MatrixXd damping = CJ.transpose() * CJ;
  system.damping = 0.5 * (damping + damping.transpose());
  system.stiffness_factor = K_C.cwiseSqrt().asDiagonal() * arm.jacobian;
  const Eigen::MatrixXd stiffness = system.stiffness_factor.transpose() * system.stiffness_factor;
  system.stiffness = 0.5 * (stiffness + stiffness.transpose());
  return system;
}

/// Joint positions at time t (s): each joint swings by 0.5 rad about a usual pose, with periods of
/// 2 to 5 seconds.
inline Eigen::VectorXd swing(double t) {
  Eigen::VectorXd q(7);
  q << 0, -0.785398, 0, -2.356194, 0, 1.570796, 0.785398;
  for (Eigen::Index i = 0; i < 7; ++i) {
    const double period = 2 + 0.5 * static_cast<double>(i);
    q[i] += 0.5 * std::sin(2 * std::numbers::pi * t / period + static_cast<double>(i));
  }
  return q;
}

}  // namespace dashpot::testing
