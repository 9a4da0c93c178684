#pragma once
#include <dashpot/controller/plugin.h>
#include <dashpot/analysis/damping_target.hpp>
#include <dashpot/analysis/sampled_loop.hpp>
#include <dashpot/analysis/spectrum.hpp>
#include <dashpot/controller/dynamics.hpp>
#include <dashpot/python/src/convert.hpp>

#include <utility>

namespace dashpot::python {

/// Returns the entries of dashpot.Modes.
nb::dict modes_of(const analysis::Spectrum<>& spectrum);
/// Returns the entries of dashpot.SampledModes without gain margin and continuous modes.
nb::dict sampled_modes_of(const analysis::SampledSpectrum& sampled);

/// Returns the structure of a name; throws std::invalid_argument for another name.
analysis::DampingStructure structure_of(const std::string& name);

/// Each returns the latest result as a dict, or None before the first.
nb::object snapshot_of(dashpot_controller* controller);
nb::object modes_of(dashpot_controller* controller);
nb::object sampled_modes_of(dashpot_controller* controller);

/// Modes as modes_of returns them.
nb::dict to_dict(const dashpot_modes& found);

/// A model with the kernel that computes its dynamics.
struct Robot {
  explicit Robot(controller::RobotModel one) : model(std::move(one)), kernel(model) {}

  /// Returns n finite values; throws std::invalid_argument for anything else.
  controller::JointVector joint_vector(const char* name, const Eigen::VectorXd& values) const;

  controller::RobotModel model;
  controller::DynamicsKernel kernel;
};

}  // namespace dashpot::python
