#include <dashpot/lcmtypes/plugin_samples.hpp>

namespace dashpot::lcmtypes {
namespace {

using RowMajor3 = Eigen::Matrix<double, 3, 3, Eigen::RowMajor>;

controller::JointVector vector(const double* from, std::uint32_t n) noexcept {
  return Eigen::Map<const Eigen::VectorXd>(from, n);
}

controller::Pose pose(const double* position, const double* rotation) noexcept {
  return {Eigen::Map<const Eigen::Vector3d>(position), Eigen::Map<const RowMajor3>(rotation)};
}

}  // namespace

void fill(const dashpot_snapshot& from, controller::Snapshot& to) noexcept {
  const std::uint32_t n = from.joints;
  to.time = from.time;
  to.tick = from.tick;
  to.restarts = from.restarts;
  to.status = static_cast<controller::Status>(from.status);
  to.fault = static_cast<controller::Status>(from.fault);
  to.mode = static_cast<controller::Mode>(from.mode);
  to.position = vector(from.position, n);
  to.velocity = vector(from.velocity, n);
  to.torque = vector(from.torque, n);
  to.law_torque = vector(from.law_torque, n);
  to.reference_position = vector(from.reference_joint_position, n);
  to.joint_error = to.reference_position - to.position;
  to.tip = pose(from.tip_position, from.tip_rotation);
  to.reference_tip = pose(from.reference_tip_position, from.reference_tip_rotation);
  to.tip_error = Eigen::Map<const controller::Vector6>(from.tip_error);
  to.tip_wrench = Eigen::Map<const controller::Vector6>(from.tip_wrench);
  to.joint_damping_ratio = from.joint_damping_ratio;
  to.task_damping_ratio = from.task_damping_ratio;
  to.damping_level = from.damping_level;
  to.payload = {from.payload_mass, Eigen::Map<const Eigen::Vector3d>(from.payload_center),
                Eigen::Map<const RowMajor3>(from.payload_inertia)};
  to.tool = pose(from.tool_position, from.tool_rotation);
}

void fill(const dashpot_modes& from, ModesSample& to) noexcept {
  controller::Vibration& vibration = to.vibration;
  vibration.time = from.time;
  vibration.tick = from.tick;
  vibration.position = vector(from.position, from.joints);
  vibration.status = static_cast<analysis::Status>(from.status);
  vibration.origin = static_cast<analysis::SpectrumOrigin>(from.origin);
  vibration.zero_modes = static_cast<int>(from.zero_modes);
  vibration.count = static_cast<int>(from.count);
  for (std::uint32_t i = 0; i < from.count; ++i) {
    const dashpot_mode& mode = from.modes[i];
    controller::VibrationMode& result = vibration.modes[i];
    for (std::size_t k = 0; k < 2; ++k) {
      result.eigenvalues[k] = {mode.eigenvalues[k][0], mode.eigenvalues[k][1]};
    }
    result.label = mode.label;
    result.natural_frequency = mode.natural_frequency;
    result.damping_ratio = mode.damping_ratio;
    result.damped_frequency = mode.damped_frequency;
    result.kind = static_cast<analysis::ModeKind>(mode.kind);
    result.shape.resize(from.joints);
    result.shape.real() = vector(mode.shape_real, from.joints);
    result.shape.imag() = vector(mode.shape_imag, from.joints);
    result.error_bound = mode.eigenvalue_bound;
    result.natural_frequency_bound = mode.natural_frequency_bound;
    result.damping_ratio_bound = mode.damping_ratio_bound;
  }
}

void fill(const dashpot_sampled_modes& from, SampledModesSample& to) noexcept {
  controller::SampledVibration& vibration = to.vibration;
  vibration.time = from.time;
  vibration.tick = from.tick;
  vibration.position = vector(from.position, from.joints);
  vibration.status = static_cast<analysis::Status>(from.status);
  vibration.spectral_radius = from.spectral_radius;
  vibration.gain_margin = from.gain_margin;
  vibration.assumes = from.assumes;
  vibration.count = static_cast<int>(from.count);
  for (std::uint32_t i = 0; i < from.count; ++i) {
    const dashpot_sampled_mode& mode = from.modes[i];
    vibration.modes[i] = {static_cast<analysis::ModeKind>(mode.kind),
                          mode.continuous_frequency,
                          mode.continuous_ratio,
                          mode.natural_frequency,
                          mode.damping_ratio,
                          mode.damped_frequency};
  }
}

}  // namespace dashpot::lcmtypes
