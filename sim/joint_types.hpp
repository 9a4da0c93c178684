#pragma once
// Matrix types of the simulator: sizes are set at run time, storage is fixed, nothing allocates.
// Frames: B is the base link, T the tip. p_BT_B is the position of T in B, expressed in B's axes;
// R_BT turns T's axes into B's. Twists and wrenches have the linear part first, then the angular.

#include <dashpot/text/aligned_eigen.hpp>

namespace dashpot::sim {

/// The longest chain, and the largest mass-spring-damper system.
inline constexpr int kMaxJoints = 16;

/// n: one entry a joint, from base to tip; rad (m for a prismatic joint), rad/s, N m, ...
using JointVector = Eigen::Matrix<double, Eigen::Dynamic, 1, Eigen::ColMajor, kMaxJoints, 1>;
/// n x n
using JointMatrix =
    Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, Eigen::ColMajor, kMaxJoints, kMaxJoints>;
using Vector6 = Eigen::Matrix<double, 6, 1>;
using Matrix6 = Eigen::Matrix<double, 6, 6>;

/// Position of a frame in another in m, and its rotation matrix.
struct Pose {
  Eigen::Vector3d position = Eigen::Vector3d::Zero();
  Eigen::Matrix3d rotation = Eigen::Matrix3d::Identity();
};

}  // namespace dashpot::sim
