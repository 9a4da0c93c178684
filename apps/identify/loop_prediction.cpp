#include <dashpot/analysis/sampled_loop.hpp>
#include <dashpot/analysis/spectrum.hpp>
#include <dashpot/apps/identify/loop_prediction.hpp>
#include <dashpot/apps/report/modes.hpp>
#include <dashpot/controller/dynamics.hpp>
#include <dashpot/controller/input_error.hpp>
#include <dashpot/controller/posture_loop.hpp>

#include <yaml-cpp/yaml.h>

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <fstream>
#include <limits>
#include <stdexcept>
#include <utility>

namespace dashpot::apps {

using analysis::Complex;

namespace {

JointVector sum_of(const JointVector& before, const VectorXd& added, Index n) {
  JointVector sum = before.size() > 0 ? before : JointVector(JointVector::Zero(n));
  if (added.size() > 0) sum += added;
  return sum;
}

/// Returns the joint friction in the robot's file and configuration.
JointVector joint_friction(const controller::Config& config) {
  return config.model.joint_values(&controller::Joint::viscous_friction);
}

controller::RobotDescription corrected(const controller::Config& config,
                                       const ModelCorrection& correction) {
  controller::RobotDescription robot = config.robot;
  const Index n = config.model.dof();
  controller::ModelOptions& options = robot.options;
  options.payload.mass += correction.payload;
  options.payload.center += correction.center;
  options.payload.inertia.diagonal() += correction.inertia;
  options.reflected_inertia = sum_of(options.reflected_inertia, correction.reflected_inertia, n);
  options.viscous_friction = sum_of(joint_friction(config), correction.friction, n);
  if (correction.gear_stiffness.size() > 0) options.gear_stiffness += correction.gear_stiffness;
  return robot;
}

}  // namespace

LoopPrediction::LoopPrediction(const std::string& config,
                               const std::vector<MotionChannel>& channels)
    : path_(config), config_(controller::load_config(config)) {
  const int n = dof();
  for (const MotionChannel& channel : channels) {
    const std::string& name = channel.name;
    const auto digit = name.find_first_of("0123456789");
    int joint = 0;
    if (digit != std::string::npos && name.size() - digit < 4)
      joint = std::stoi(name.substr(digit));
    joint_.push_back(joint - 1);
  }
  std::vector<Index> sorted = joint_;
  std::sort(sorted.begin(), sorted.end());
  bool named = sorted.size() == static_cast<std::size_t>(n);
  for (std::size_t i = 0; named && i < sorted.size(); ++i)
    named = sorted[i] == static_cast<Index>(i);
  if (!named && channels.size() == static_cast<std::size_t>(n)) {
    for (std::size_t i = 0; i < joint_.size(); ++i) joint_[i] = static_cast<Index>(i);
    named = true;
  }
  const bool positions = std::all_of(
      channels.begin(), channels.end(),
      [](const MotionChannel& channel) { return channel.unit == "rad" || channel.unit == "m"; });
  if (!named || !positions) {
    throw InputError("--against", "needs the positions of all " + std::to_string(n) +
                                      " joints (--channels), to know the posture");
  }
}

std::vector<PredictedMode> LoopPrediction::predict_with_delay(const JointVector& q,
                                                              const ModelCorrection& correction,
                                                              int delay) const {
  const controller::Settings& settings = config_.settings;
  controller::RobotDescription rigid = config_.robot;  // the model in the controller's law
  rigid.options.gear_stiffness.resize(0);
  const bool elastic = config_.model.elastic_joints() > 0;
  controller::PostureLoop believed(elastic ? rigid.model() : config_.model, settings);
  analysis::System<> system = believed.at(q, settings.initial.gains, settings.initial.mode).system;
  const controller::RobotModel model = corrected(config_, correction).model();
  controller::LoopTiming timing = controller::timing_of(settings);
  timing.delay = delay;
  const controller::SampledArm arm(model, timing);
  const auto at = controller::evaluate(model, q, JointVector::Zero(q.size()));
  system.mass = at.M;
  system.damping.diagonal() += arm.friction() - joint_friction(config_);
  const controller::PassivePart outside = controller::passive_part(
      at.J, settings.environment, controller::JointMatrix::Zero(q.size(), q.size()));
  const controller::Impedance springs(settings.initial, static_cast<int>(q.size()));
  analysis::SampledLoop sampled =
      arm.at(q, &outside, controller::integral_stiffness(at, springs, timing.integral_time));
  if (!timing.ideal_gravity && (correction.payload != 0 || !correction.center.isZero(0))) {
    const MatrixXd added =  // weight without compensation
        sampled.gravity_gradient -
        controller::gravity_gradient(controller::DynamicsKernel(config_.model), q);
    system.stiffness += (added + added.transpose()) / 2;
    system.stiffness_factor.resize(0, q.size());
  }
  const analysis::Gears& gears = arm.gears();
  if (gears.any()) gears.extend(outside, system);
  sampled = with_gears(sampled);
  const auto spectrum = analysis::analyze(system);
  const auto modes = analysis::sample_loop(system, spectrum, sampled).modes;
  std::vector<PredictedMode> predicted;
  for (std::size_t i = 0; i < modes.size(); ++i) {
    PredictedMode mode;
    mode.natural_frequency = modes[i].natural_frequency;
    mode.damping_ratio = modes[i].damping_ratio;
    const auto& shape = spectrum.modes[static_cast<int>(i)].shapes[0];
    mode.shape.resize(static_cast<Index>(joint_.size()));
    for (std::size_t c = 0; c < joint_.size(); ++c) {
      mode.shape[static_cast<Index>(c)] =
          shape[gears.any() ? gears.measured(joint_[c]) : joint_[c]];
    }
    predicted.push_back(std::move(mode));
  }
  return predicted;
}

std::vector<PredictedMode> LoopPrediction::predict(const VectorXd& rest,
                                                   const ModelCorrection& correction) const {
  JointVector q(rest.size());
  for (std::size_t c = 0; c < joint_.size(); ++c) q[joint_[c]] = rest[static_cast<Index>(c)];
  const double delay = std::max(0.0, config_.settings.analysis.sampled.delay + correction.delay);
  const int ticks = static_cast<int>(std::floor(delay));
  std::vector<PredictedMode> modes = predict_with_delay(q, correction, ticks);
  const double share = delay - ticks;
  if (share > 0) {  // between two ticks: linear interpolation
    const std::vector<PredictedMode> later = predict_with_delay(q, correction, ticks + 1);
    for (std::size_t i = 0; i < modes.size() && i < later.size(); ++i) {
      modes[i].natural_frequency +=
          share * (later[i].natural_frequency - modes[i].natural_frequency);
      modes[i].damping_ratio += share * (later[i].damping_ratio - modes[i].damping_ratio);
    }
  }
  return modes;
}

void LoopPrediction::write(const std::string& path, const ModelCorrection& correction) const {
  YAML::Node document = YAML::LoadFile(path_);
  YAML::Node robot = document["robot"];
  const controller::ModelOptions options = corrected(config_, correction).options;
  namespace fs = std::filesystem;
  robot["urdf"] =
      fs::relative(config_.robot.urdf, fs::absolute(path).parent_path()).generic_string();
  const auto list = [](const JointVector& values) {
    YAML::Node node(YAML::NodeType::Sequence);
    node.SetStyle(YAML::EmitterStyle::Flow);
    for (const double value : values) {
      if (std::isfinite(value)) {
        node.push_back(value);
      } else {
        node.push_back("none");  // rigid gears
      }
    }
    return node;
  };
  if (correction.reflected_inertia.size() > 0) {
    robot["reflected_inertia"] = list(options.reflected_inertia);
  }
  if (correction.friction.size() > 0) robot["viscous_friction"] = list(options.viscous_friction);
  if (correction.gear_stiffness.size() > 0) robot["gear_stiffness"] = list(options.gear_stiffness);
  if (correction.payload != 0) robot["payload"]["mass"] = options.payload.mass;
  if (!correction.center.isZero(0)) robot["payload"]["center"] = list(options.payload.center);
  if (!correction.inertia.isZero(0)) {
    YAML::Node rows(YAML::NodeType::Sequence);
    for (const auto& row : options.payload.inertia.rowwise()) rows.push_back(list(row.transpose()));
    robot["payload"]["inertia"] = rows;
  }
  if (correction.delay != 0) {
    const double delay = config_.settings.analysis.sampled.delay + correction.delay;
    document["analysis"]["sampled"]["delay"] = std::lround(std::max(0.0, delay));
  }
  YAML::Emitter emitter;
  emitter.SetDoublePrecision(12);
  emitter << document;
  std::ofstream file(path);
  file << emitter.c_str() << '\n';
  file.close();
  if (!file) throw InputError("--output", path + ": cannot be written");
}

namespace {

double likeness(const Eigen::VectorXcd& u, const Eigen::VectorXcd& v) {
  return std::norm(u.dot(v)) / std::max(1e-300, u.squaredNorm() * v.squaredNorm());
}

/// The eigenvalue of an underdamped mode; for other modes a point of equal size on the real axis.
Complex eigenvalue(double frequency, double ratio) {
  return frequency * Complex(-ratio, std::sqrt(std::max(0.0, 1 - ratio * ratio)));
}

/// The distance between a measured and a predicted mode; infinite if they cannot be the same.
double unlikeness(const MeasuredMode& measured, const PredictedMode& predicted, double alike) {
  const Complex a = eigenvalue(measured.natural_frequency, measured.damping_ratio);
  const Complex b = eigenvalue(predicted.natural_frequency, predicted.damping_ratio);
  const double distance = std::abs(a - b) / std::max(std::abs(a), std::abs(b));
  if (distance > 0.4 || alike < 0.5) return std::numeric_limits<double>::infinity();
  return distance + (1 - alike);
}

constexpr double kFarthest = 0.9;  // above the largest finite unlikeness

}  // namespace

void match(const std::vector<MeasuredMode>& measured, std::vector<PredictedMode>& predicted) {
  const auto rows = static_cast<Eigen::Index>(predicted.size());
  Eigen::MatrixXd alike(rows, static_cast<Eigen::Index>(measured.size()));
  Eigen::MatrixXd apart = alike;
  for (Eigen::Index i = 0; i < rows; ++i) {
    for (Eigen::Index k = 0; k < alike.cols(); ++k) {
      const MeasuredMode& mode = measured[static_cast<std::size_t>(k)];
      const PredictedMode& other = predicted[static_cast<std::size_t>(i)];
      alike(i, k) = likeness(mode.shape, other.shape);
      apart(i, k) = unlikeness(mode, other, alike(i, k));
    }
  }
  const std::vector<int> partner = nearest_pairs(apart, kFarthest);
  for (std::size_t i = 0; i < predicted.size(); ++i) {
    predicted[i].measured = partner[i];
    if (partner[i] >= 0) predicted[i].likeness = alike(static_cast<Eigen::Index>(i), partner[i]);
  }
}

void put_in_order(const std::vector<PredictedMode>& others, std::vector<PredictedMode>& modes) {
  if (others.size() != modes.size()) return;
  const auto count = static_cast<Eigen::Index>(modes.size());
  Eigen::MatrixXd apart(count, count);
  for (Eigen::Index i = 0; i < count; ++i) {
    for (Eigen::Index k = 0; k < count; ++k) {
      apart(i, k) = 1 - likeness(others[static_cast<std::size_t>(k)].shape,
                                 modes[static_cast<std::size_t>(i)].shape);
    }
  }
  const std::vector<int> place = nearest_pairs(apart, 2);
  if (std::find(place.begin(), place.end(), -1) != place.end()) return;  // shapes have NaN
  std::vector<PredictedMode> ordered(modes.size());
  for (std::size_t i = 0; i < modes.size(); ++i) {
    ordered[static_cast<std::size_t>(place[i])] = std::move(modes[i]);
  }
  modes = std::move(ordered);
}

}  // namespace dashpot::apps
