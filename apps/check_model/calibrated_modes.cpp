#include <dashpot/analysis/sampled_loop.hpp>
#include <dashpot/analysis/spectrum.hpp>
#include <dashpot/apps/check_model/calibrated_modes.hpp>
#include <dashpot/apps/check_model/written_arm.hpp>
#include <dashpot/controller/attachment.hpp>
#include <dashpot/controller/dynamics.hpp>
#include <dashpot/controller/posture_loop.hpp>

#include <algorithm>
#include <cmath>
#include <limits>

namespace dashpot::apps {
namespace {

using controller::RobotDescription;
using controller::RobotModel;
using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

constexpr double kMostDelay = controller::Analysis::Sampled::kMostDelay;
constexpr double kInfinity = std::numeric_limits<double>::infinity();

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

/// The arm with every parameter as the records have it, however uncertain. A rotor or viscous
/// friction that the configuration has stays unless they contradict it.
struct Found {
  RobotDescription robot;
  controller::Attachment attachment;

  Found(const Config& config, const ModelCheck& check)
      : robot(calibrated_robot(config, check)), attachment(robot.model().attachment()) {
    if (std::isfinite(check.payload.mass.deviation)) attachment = check.attachment;
    for (std::size_t j = 0; j < check.joints.size(); ++j) {
      const auto fill = [j](const identification::Estimate& one, JointVector& values) {
        double& value = values[static_cast<Index>(j)];
        if (value == 0 && std::isfinite(one.deviation)) value = std::max(0.0, one.value);
      };
      fill(check.joints[j].reflected_inertia, robot.options.reflected_inertia);
      fill(check.joints[j].viscous_friction, robot.options.viscous_friction);
    }
  }
  RobotModel model() const { return robot.model().with(attachment); }
  /// With parameter i of ModelCheck::covariance larger by `step`.
  Found moved(Index i, double step) const {
    Found other = *this;
    const Index body = 3 * robot.options.viscous_friction.size(), rotors = body + 10;
    if (i < body) {
      other.robot.options.viscous_friction[i / 3] += step;
    } else if (i < rotors) {
      identification::add_to_body(other.attachment, i - body, step);
    } else {
      other.robot.options.reflected_inertia[i - rotors] += step;
    }
    return other;
  }
};

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
  const Found found(config, check);
  controller::Settings settings = config.settings;
  // The zero-order hold delays the torque by half a period.
  const double ticks = check.delay.value / settings.period - 0.5;
  CalibratedLoop loop;
  int& delay = settings.analysis.sampled.delay;
  const double found_ticks = std::min(kMostDelay, std::round(ticks));
  if (std::isfinite(check.delay.deviation) && found_ticks > delay) {
    delay = static_cast<int>(found_ticks);
    loop.delay_found = check.delay.determined && std::round(ticks) <= kMostDelay;
  }
  loop.delay = delay;
  const analysis::SampledSpectrum spectrum = spectrum_of(found.model(), settings, q);
  loop.stable = spectrum.stable();
  const VectorXd values = values_of(spectrum.modes);
  const auto change_by = [&](const Found& arm, double step) {
    const VectorXd there = values_of(spectrum_of(arm.model(), settings, q).modes);
    if (there.size() != values.size())
      return VectorXd(VectorXd::Constant(values.size(), kInfinity));
    return VectorXd((there - values) / step);
  };
  const Index n = config.model.dof();
  std::vector<Index> which;
  for (Index j = 0; j < n; ++j) which.push_back(3 * j + 2);
  for (Index i = 3 * n; i < 4 * n + 10; ++i) which.push_back(i);  // payload and rotors
  std::erase_if(which, [&](Index i) { return !(check.covariance(i, i) > 0); });
  MatrixXd J(values.size(), static_cast<Index>(which.size()));
  for (std::size_t k = 0; k < which.size(); ++k) {
    // The deviation of the parameter, but within the range where the modes are linear in it.
    const double step = std::min(1e-4, 0.1 * std::sqrt(check.covariance(which[k], which[k])));
    J.col(static_cast<Index>(k)) = change_by(found.moved(which[k], step), step);
  }
  if (std::isfinite(check.delay.deviation)) {
    const int last = delay++;
    which.push_back(4 * n + 10);
    J.conservativeResize(Eigen::NoChange, J.cols() + 1);
    J.rightCols(1) = change_by(found, settings.period);
    delay = last;
  }
  MatrixXd covariance = J * check.covariance(which, which) * J.transpose();
  // A rotor of which the records know nothing may be as large as the joint's inertia, and viscous
  // friction may stop it within a tenth of a second.
  constexpr double kStep = 1e-4, kUnchanged = 0.05, kRate = 10;  // 1/s
  const auto doubt = [&](const identification::Estimate& one, double known, Index i, double size) {
    if (std::isfinite(one.deviation) || known > 0) return;
    const VectorXd change = size * change_by(found.moved(i, kStep), kStep);
    for (Index k = 0; k < values.size(); ++k) {
      if (!(std::abs(change[k]) <= kUnchanged * std::abs(values[k]))) covariance(k, k) = kInfinity;
    }
  };
  const controller::ModelOptions& options = found.robot.options;
  const controller::JointMatrix M = controller::evaluate(found.model(), q, 0 * q).M;
  for (Index j = 0; j < n; ++j) {
    const identification::JointCheck& joint = check.joints[static_cast<std::size_t>(j)];
    doubt(joint.reflected_inertia, options.reflected_inertia[j], 3 * n + 10 + j, M(j, j));
    doubt(joint.viscous_friction, options.viscous_friction[j], 3 * j + 2, kRate * M(j, j));
  }
  const auto deviation = [&covariance](Index i) {
    return std::isfinite(covariance(i, i)) ? std::sqrt(std::max(0.0, covariance(i, i))) : kInfinity;
  };
  for (Index i = 0; i + 1 < values.size(); i += 2) {
    loop.modes.push_back({values[i], deviation(i), values[i + 1], deviation(i + 1)});
  }
  return loop;
}

}  // namespace dashpot::apps
