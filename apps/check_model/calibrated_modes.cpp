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

using controller::Config;
using controller::JointVector;
using controller::RobotDescription;
using controller::RobotModel;
using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;
using identification::ModelCheck;

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
    if (determined_payload(check)) attachment = check.attachment;
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
  const bool longer = std::isfinite(check.delay.deviation) && std::round(ticks) > delay;
  if (longer) delay = static_cast<int>(std::round(ticks));
  loop.delay_found = longer && check.delay.determined;
  loop.delay = delay;
  const analysis::SampledSpectrum spectrum = spectrum_of(found.model(), settings, q);
  loop.stable = spectrum.stable();
  const VectorXd values = values_of(spectrum.modes);
  const auto values_at = [&](const Found& arm) {
    return values_of(spectrum_of(arm.model(), settings, q).modes);
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
    J.col(static_cast<Index>(k)) = (values_at(found.moved(which[k], step)) - values) / step;
  }
  if (std::isfinite(check.delay.deviation)) {
    const int last = delay++;
    which.push_back(4 * n + 10);
    J.conservativeResize(Eigen::NoChange, J.cols() + 1);
    J.rightCols(1) = (values_at(found) - values) / settings.period;
    delay = last;
  }
  MatrixXd covariance = J * check.covariance(which, which) * J.transpose();
  // A rotor of which the records know nothing may be as large as the joint's inertia.
  for (std::size_t j = 0; j < check.joints.size(); ++j) {
    const auto i = static_cast<Index>(j);
    if (std::isfinite(check.joints[j].reflected_inertia.deviation) ||
        found.robot.options.reflected_inertia[i] > 0) {
      continue;
    }
    constexpr double kStep = 1e-4, kUnchanged = 0.05;
    const VectorXd there = values_at(found.moved(3 * n + 10 + i, kStep));
    const double inertia = controller::evaluate(found.model(), q, 0 * q).M(i, i);
    for (Index k = 0; k < values.size(); ++k) {
      const double change = inertia * std::abs(there[k] - values[k]) / kStep;
      if (change > kUnchanged * std::abs(values[k])) covariance(k, k) = kInfinity;
    }
  }
  for (Index i = 0; i + 1 < values.size(); i += 2) {
    loop.modes.push_back({values[i], std::sqrt(std::max(0.0, covariance(i, i))), values[i + 1],
                          std::sqrt(std::max(0.0, covariance(i + 1, i + 1)))});
  }
  return loop;
}

}  // namespace dashpot::apps
