#pragma once
#include <dashpot/controller/dynamics.hpp>
#include <dashpot/python/src/convert.hpp>

#include <utility>

namespace dashpot::python {

/// A model with the kernel that computes its dynamics.
struct Robot {
  explicit Robot(controller::RobotModel one) : model(std::move(one)), kernel(model) {}

  /// Returns n finite values; throws std::invalid_argument for anything else.
  controller::JointVector joint_vector(const char* name, const Eigen::VectorXd& values) const;

  controller::RobotModel model;
  controller::DynamicsKernel kernel;
};

}  // namespace dashpot::python
