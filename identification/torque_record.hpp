#pragma once
#include <dashpot/controller/robot_types.hpp>

#include <Eigen/Core>

#include <cstdint>

namespace dashpot::identification {

/// A recorded motion of an arm, with the torques of its joints, in the model's order and signs.
struct TorqueRecord {
  Eigen::VectorXd time;      ///< N, s, strictly rising; need not be evenly spaced
  Eigen::MatrixXd position;  ///< n x N, rad; NaN where a sample is missing
  Eigen::MatrixXd torque;    ///< n x N, N m; NaN where a sample is missing
};

/// The part of the model's torques that a record contains.
enum class TorqueKind : std::uint8_t {
  kWhole,           ///< all: measured, or commanded to an arm without compensation of its own
  kWithoutGravity,  ///< all but gravity, which the robot adds by itself
  kExternal,        ///< only the part that the robot's own model does not explain
};

}  // namespace dashpot::identification
