#include <dashpot/analysis/sampled_loop.hpp>
#include <dashpot/analysis/spectrum.hpp>
#include <dashpot/apps/check_model/calibrated_modes.hpp>
#include <dashpot/apps/check_model/written_arm.hpp>
#include <dashpot/controller/attachment.hpp>
#include <dashpot/controller/posture_loop.hpp>

#include <algorithm>
#include <cmath>

namespace dashpot::apps {
namespace {

using controller::Config;
using controller::JointVector;
using controller::RobotDescription;
using controller::RobotModel;
using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;
using identification::ModelCheck;

analysis::SampledSpectrum spectrum_of(const RobotModel& model, const controller::Settings& settings,
                                      const JointVector& q) {
  controller::PostureLoop loop(model, settings);
  const controller::LoopAt at = loop.at(q, settings.initial.gains, settings.initial.mode);
  return analysis::sample_loop(at.system, analysis::analyze(at.system), at.sampled);
}

/// Frequencies and ratios, one after the other.
VectorXd values_of(const std::vector<analysis::SampledMode>& modes) {
  VectorXd values(2 * static_cast<Index>(modes.size()));
  for (std::size_t i = 0; i < modes.size(); ++i) {
    values[2 * static_cast<Index>(i)] = modes[i].natural_frequency;
    values[2 * static_cast<Index>(i) + 1] = modes[i].damping_ratio;
  }
  return values;
}

/// The model with parameter i of ModelCheck::covariance larger by `step`.
RobotModel moved(const RobotDescription& robot, Index i, double step) {
  RobotDescription other = robot;
  const RobotModel model = robot.model();
  const Index n = model.dof(), body = 3 * n, rotors = body + 10;
  if (i < body) {
    other.options.viscous_friction = model.joint_values(&controller::Joint::viscous_friction);
    other.options.viscous_friction[i / 3] += step;
    return other.model();
  }
  if (i >= rotors) {
    other.options.reflected_inertia = model.joint_values(&controller::Joint::reflected_inertia);
    other.options.torque_loop_inertia_ratio.resize(0);
    other.options.reflected_inertia[i - rotors] += step;
    return other.model();
  }
  controller::Attachment attachment = model.attachment();
  if (i == body) attachment.mass += step;
  if (i > body) attachment.first_moment[i - body - 1] += step;
  return model.with(attachment);
}

}  // namespace

RobotDescription calibrated_robot(const Config& config, const ModelCheck& check) {
  RobotDescription robot = config.robot;
  controller::ModelOptions& options = robot.options;
  options.viscous_friction = determined(config, check, ArmFigure::kViscousFriction);
  options.coulomb_friction = determined(config, check, ArmFigure::kCoulombFriction);
  options.reflected_inertia = determined(config, check, ArmFigure::kReflectedInertia);
  options.torque_loop_inertia_ratio.resize(0);  // contained in the determined inertias
  if (check.gravity) options.gravity = *check.gravity;
  if (const auto payload = determined_payload(check)) {
    options.payload.mass = payload->mass;
    options.payload.center = payload->center;
  }
  return robot;
}

CalibratedLoop calibrated_loop(const Config& config, const ModelCheck& check,
                               const JointVector& q) {
  const RobotDescription robot = calibrated_robot(config, check);
  controller::Settings settings = config.settings;
  // The zero-order hold delays the torque by half a period.
  const double ticks = check.delay.value / settings.period - 0.5;
  CalibratedLoop loop;
  int& delay = settings.analysis.sampled.delay;
  loop.delay_found = check.delay.determined && std::round(ticks) > delay;
  if (loop.delay_found) delay = static_cast<int>(std::round(ticks));
  loop.delay = delay;
  const analysis::SampledSpectrum spectrum = spectrum_of(robot.model(), settings, q);
  loop.stable = spectrum.stable();
  const VectorXd values = values_of(spectrum.modes);
  const Index n = config.model.dof();
  std::vector<Index> which;
  for (Index j = 0; j < n; ++j) which.push_back(3 * j + 2);
  for (Index i = 0; i < 4; ++i) which.push_back(3 * n + i);
  for (Index j = 0; j < n; ++j) which.push_back(3 * n + 10 + j);
  std::erase_if(which, [&](Index i) { return !(check.covariance(i, i) > 0); });
  MatrixXd J(values.size(), static_cast<Index>(which.size()));
  for (std::size_t k = 0; k < which.size(); ++k) {
    // The deviation of the parameter, but within the range where the modes are linear in it.
    const double step = std::min(1e-4, 0.1 * std::sqrt(check.covariance(which[k], which[k])));
    const VectorXd there = values_of(spectrum_of(moved(robot, which[k], step), settings, q).modes);
    J.col(static_cast<Index>(k)) = (there - values) / step;
  }
  const MatrixXd covariance = J * check.covariance(which, which) * J.transpose();
  for (Index i = 0; i + 1 < values.size(); i += 2) {
    loop.modes.push_back({values[i], std::sqrt(std::max(0.0, covariance(i, i))), values[i + 1],
                          std::sqrt(std::max(0.0, covariance(i + 1, i + 1)))});
  }
  return loop;
}

}  // namespace dashpot::apps
