#include <dashpot/analysis/sampled_loop.hpp>
#include <dashpot/analysis/spectrum.hpp>
#include <dashpot/apps/identify/loop_prediction.hpp>
#include <dashpot/controller/dynamics.hpp>
#include <dashpot/controller/input_error.hpp>
#include <dashpot/controller/posture_loop.hpp>
#include <dashpot/controller/vibration/sampled_analysis.hpp>

#include <yaml-cpp/yaml.h>
#include <Eigen/Cholesky>
#include <algorithm>
#include <array>
#include <cmath>
#include <filesystem>
#include <fstream>
#include <limits>
#include <stdexcept>

namespace dashpot::apps {
namespace {

using analysis::Complex;
using analysis::MeasuredMode;
using controller::InputError;
using controller::JointVector;
using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

JointVector sum_of(const JointVector& before, const VectorXd& added, Index n) {
  JointVector sum = before.size() > 0 ? before : JointVector(JointVector::Zero(n));
  if (added.size() > 0) sum += added;
  return sum;
}

/// What the robot's file and configuration say of its joints.
JointVector joint_friction(const controller::Config& config) {
  return config.model.joint_values(&controller::Joint::viscous_friction);
}

controller::RobotDescription corrected(const controller::Config& config,
                                       const ModelCorrection& correction) {
  controller::RobotDescription robot = config.robot;
  const Index n = config.model.dof();
  controller::ModelOptions& options = robot.options;
  options.payload.mass += correction.payload;
  options.reflected_inertia = sum_of(options.reflected_inertia, correction.reflected_inertia, n);
  options.viscous_friction = sum_of(joint_friction(config), correction.friction, n);
  return robot;
}

double likeness(const Eigen::VectorXcd& u, const Eigen::VectorXcd& v) {
  return std::norm(u.dot(v)) / std::max(1e-300, u.squaredNorm() * v.squaredNorm());
}

/// The eigenvalue of an underdamped mode; of others a point that is as far on the axis.
Complex eigenvalue(double frequency, double ratio) {
  return frequency * Complex(-ratio, std::sqrt(std::max(0.0, 1 - ratio * ratio)));
}

/// How unlike a measured and a predicted mode are; infinite if they cannot be one.
double unlikeness(const MeasuredMode& measured, const PredictedMode& predicted, double alike) {
  const Complex a = eigenvalue(measured.natural_frequency, measured.damping_ratio);
  const Complex b = eigenvalue(predicted.natural_frequency, predicted.damping_ratio);
  const double distance = std::abs(a - b) / std::max(std::abs(a), std::abs(b));
  if (distance > 0.4 || alike < 0.5) return std::numeric_limits<double>::infinity();
  return distance + (1 - alike);
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
  controller::PostureLoop loop(config_.model, settings);
  analysis::System<controller::kMaxJoints> believed;
  const controller::Status status =
      loop.closed_loop(q, settings.initial.gains, settings.initial.mode, believed);
  if (status != controller::Status::kOk) {
    throw InputError("--against",
                     std::string("no prediction at this posture: ") + controller::to_text(status));
  }
  const controller::RobotModel arm = corrected(config_, correction).model();
  const auto at = controller::evaluate(arm, q, JointVector::Zero(q.size()));
  analysis::System<> system(q.size());
  system.mass = at.M;
  system.damping = believed.damping;
  system.stiffness = believed.stiffness;
  system.stiffness_factor = believed.stiffness_factor;
  analysis::SampledLoop sampled = controller::sampled_loop(arm, settings);
  sampled.delay = delay;
  system.damping += sampled.friction;
  system.damping.diagonal() -= joint_friction(config_);
  const controller::PassivePart outside = controller::passive_part(
      at.J, settings.environment, controller::JointMatrix::Zero(q.size(), q.size()));
  sampled.friction += outside.damping;
  sampled.passive_stiffness = outside.stiffness;
  if (settings.integral.time > 0) {
    const controller::Impedance springs(settings.initial, static_cast<int>(q.size()));
    sampled.memory = controller::integral_memory(
        controller::integral_stiffness(at, springs, settings.integral.time), sampled.period);
  }
  if (settings.feed_forward.gravity) {
    const MatrixXd gravity = controller::gravity_gradient(controller::DynamicsKernel(arm), q);
    sampled.gravity_gradient = gravity;
    if (correction.payload != 0) {  // whose weight nobody holds
      const MatrixXd added =
          gravity - controller::gravity_gradient(controller::DynamicsKernel(config_.model), q);
      system.stiffness += (added + added.transpose()) / 2;
      system.stiffness_factor.resize(0, q.size());
    }
  }
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
      mode.shape[static_cast<Index>(c)] = shape[joint_[c]];
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
  if (share > 0) {  // between two ticks: on the line between both
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
    for (const double value : values) node.push_back(value);
    return node;
  };
  if (correction.reflected_inertia.size() > 0) {
    robot["reflected_inertia"] = list(options.reflected_inertia);
  }
  if (correction.friction.size() > 0) robot["viscous_friction"] = list(options.viscous_friction);
  if (correction.payload != 0) robot["payload"]["mass"] = options.payload.mass;
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

void match(const std::vector<MeasuredMode>& measured, std::vector<PredictedMode>& predicted) {
  for (PredictedMode& mode : predicted) mode.measured = -1;
  std::vector<bool> used(measured.size());
  for (;;) {
    double least = std::numeric_limits<double>::infinity(), alike = 0;
    PredictedMode* which = nullptr;
    std::size_t number = 0;
    for (PredictedMode& mode : predicted) {
      if (mode.measured >= 0) continue;
      for (std::size_t i = 0; i < measured.size(); ++i) {
        if (used[i]) continue;
        const double shapes = likeness(measured[i].shape, mode.shape);
        const double there = unlikeness(measured[i], mode, shapes);
        if (there < least) least = there, which = &mode, number = i, alike = shapes;
      }
    }
    if (which == nullptr) return;
    which->measured = static_cast<int>(number);
    which->likeness = alike;
    used[number] = true;
  }
}

namespace {

/// Parameters by their names, and what they do to a correction.
class Parameters {
 public:
  Parameters(const LoopPrediction& loop, const std::string& names) {
    const controller::Config& config = loop.config();
    const Index n = loop.dof();
    for (std::size_t at = 0; at <= names.size();) {
      const auto end = std::min(names.find(',', at), names.size());
      const std::string name = names.substr(at, end - at);
      at = end + 1;
      if (name == "payload") {
        add(name, "kg", config.robot.options.payload.mass, 20, -1);
      } else if (name == "delay") {
        add(name, "ticks", config.settings.analysis.sampled.delay, 10, -1);
      } else if (name == "reflected_inertia" || name == "friction") {
        const bool inertia = name == "reflected_inertia";
        const JointVector before = inertia ? sum_of(config.robot.options.reflected_inertia, {}, n)
                                           : joint_friction(config);
        for (Index i = 0; i < n; ++i) {
          add(name + " " + std::to_string(i + 1), inertia ? "kg m^2" : "N m s/rad", before[i],
              inertia ? 1 : 20, static_cast<int>(i));
        }
      } else {
        throw InputError("--calibrate", "'" + name +
                                            "' is none of payload, reflected_inertia, "
                                            "friction, delay");
      }
      if (std::count(kinds_.begin(), kinds_.end(), name) > 0) {
        throw InputError("--calibrate", "'" + name + "' twice");
      }
      kinds_.push_back(name);
    }
  }

  Index size() const { return static_cast<Index>(list.size()); }

  ModelCorrection correction(const VectorXd& values, Index n) const {
    ModelCorrection result;
    for (std::size_t k = 0; k < list.size(); ++k) {
      const double added = values[static_cast<Index>(k)] - list[k].before;
      const int joint = joints_[k];
      if (joint >= 0) {
        VectorXd& vector =
            list[k].name.starts_with("friction") ? result.friction : result.reflected_inertia;
        if (vector.size() == 0) vector = VectorXd::Zero(n);
        vector[joint] = added;
      } else {
        (list[k].name == "payload" ? result.payload : result.delay) = added;
      }
    }
    return result;
  }

  std::vector<CalibratedParameter> list;
  VectorXd prior;  ///< how far a parameter may be from what the configuration says

 private:
  void add(const std::string& name, const std::string& unit, double before, double far, int joint) {
    list.push_back({name, unit, before, before, 0, false});
    joints_.push_back(joint);
    prior.conservativeResize(prior.size() + 1);
    prior[prior.size() - 1] = far;
  }

  std::vector<int> joints_;  ///< -1: of none
  std::vector<std::string> kinds_;
};

/// Differences of measured and predicted numbers in units of their deviations, of which none is
/// taken to be less than `least`, relative for frequencies.
VectorXd differences(const std::vector<PostureReport>& postures,
                     const std::vector<std::vector<PredictedMode>>& predicted, double least) {
  std::vector<double> all;
  for (std::size_t k = 0; k < postures.size(); ++k) {
    for (std::size_t i = 0; i < postures[k].predicted.size(); ++i) {
      const int number = postures[k].predicted[i].measured;
      if (number < 0 || i >= predicted[k].size()) continue;
      const MeasuredMode& mode = postures[k].found.modes[static_cast<std::size_t>(number)];
      const PredictedMode& there = predicted[k][i];
      const double w = mode.natural_frequency;
      Eigen::Matrix2d covariance;
      const double cross =
          std::clamp(mode.covariance, -0.99 * mode.natural_frequency_std * mode.damping_ratio_std,
                     0.99 * mode.natural_frequency_std * mode.damping_ratio_std);
      covariance << std::pow(mode.natural_frequency_std, 2) + std::pow(least * w, 2), cross, cross,
          std::pow(mode.damping_ratio_std, 2) + least * least;
      const Eigen::Vector2d difference(w - there.natural_frequency,
                                       mode.damping_ratio - there.damping_ratio);
      const Eigen::Vector2d scaled = covariance.llt().matrixL().solve(difference);
      all.insert(all.end(), {scaled[0], scaled[1]});
    }
  }
  return VectorXd::Map(all.data(), static_cast<Index>(all.size()));
}

/// Puts modes into the order of others by their shapes: frequencies cross as parameters change.
void align(const std::vector<PredictedMode>& others, std::vector<PredictedMode>& modes) {
  if (others.size() != modes.size()) return;
  for (std::size_t placed = 0; placed < modes.size(); ++placed) {
    // The most alike of those without a place.
    std::size_t from = placed, to = placed;
    double best = -1;
    for (std::size_t i = 0; i < modes.size(); ++i) {
      for (std::size_t k = 0; k < others.size(); ++k) {
        if (modes[i].measured >= 0 || modes[k].measured >= 0) continue;
        const double alike = likeness(others[k].shape, modes[i].shape);
        if (alike > best) best = alike, from = i, to = k;
      }
    }
    std::swap(modes[from], modes[to]);
    modes[to].measured = 0;  // has its place
  }
  for (PredictedMode& mode : modes) mode.measured = -1;
}

}  // namespace

Calibration calibrate(const LoopPrediction& loop, const std::string& names,
                      std::vector<PostureReport>& postures) {
  Parameters parameters(loop, names);
  const Index p = parameters.size(), n = loop.dof();
  VectorXd before(p);
  for (Index i = 0; i < p; ++i) before[i] = parameters.list[static_cast<std::size_t>(i)].before;
  const auto predict = [&](const VectorXd& values) {
    std::vector<std::vector<PredictedMode>> all;
    all.reserve(postures.size());
    for (const PostureReport& posture : postures) {
      all.push_back(loop.predict(posture.rest, parameters.correction(values, n)));
      align(posture.predicted, all.back());
    }
    return all;
  };
  const auto rematch = [&](const VectorXd& values) {
    const auto all = predict(values);
    for (std::size_t k = 0; k < postures.size(); ++k) {
      postures[k].predicted = all[k];
      match(postures[k].found.modes, postures[k].predicted);
    }
  };
  const auto rms = [](const VectorXd& r) {
    return r.size() > 0 ? std::sqrt(r.squaredNorm() / static_cast<double>(r.size())) : 0;
  };
  // First of all with large deviations, so that no match that is wrong at the start decides. In the
  // end nothing is better known than to this: no arm is linear, and at one posture, to less.
  constexpr std::array<double, 6> kLeast = {0.05, 0.02, 0.01, 3e-3, 1e-3, 3e-4};
  double least = kLeast.back();
  Calibration result;
  rematch(before);
  result.misfit_before = rms(differences(postures, predict(before), least));

  VectorXd x = before;
  MatrixXd J;
  VectorXd r;
  const VectorXd weight = parameters.prior.cwiseInverse();
  // Huber's weights: what is far off counts less than by its square.
  const auto robust = [](const VectorXd& differences) {
    constexpr double kFar = 2.5;
    return VectorXd(differences.unaryExpr([](double d) {
      const double size = std::abs(d);
      return size <= kFar ? d : std::copysign(std::sqrt(2 * kFar * size - kFar * kFar), d);
    }));
  };
  const auto residual = [&](const VectorXd& values) {
    return robust(differences(postures, predict(values), least));
  };
  const auto linearize = [&] {
    r = residual(x);
    J.resize(r.size(), p);
    for (Index i = 0; i < p; ++i) {
      VectorXd moved = x;
      const double step = 1e-4 * parameters.prior[i];
      moved[i] += step;
      J.col(i) = (residual(moved) - r) / step;
    }
  };
  for (const double stage : kLeast) {
    least = stage;
    double damping = 1e-3;
    for (int iteration = 0; iteration < 20; ++iteration) {
      rematch(x);
      linearize();
      const VectorXd pull = weight.cwiseProduct(x - before);
      const double cost = r.squaredNorm() + pull.squaredNorm();
      MatrixXd A = J.transpose() * J;
      A.diagonal() += weight.cwiseAbs2();
      const VectorXd g = J.transpose() * r + weight.cwiseProduct(pull);
      bool better = false;
      double gain = 0;
      for (; !better && damping < 1e10; damping *= 10) {
        MatrixXd damped = A;
        damped.diagonal() *= 1 + damping;
        const VectorXd next = (x - damped.ldlt().solve(g)).cwiseMax(0);
        const VectorXd there = residual(next);
        gain = cost - there.squaredNorm() - weight.cwiseProduct(next - before).squaredNorm();
        if (there.size() == r.size() && gain >= 0) x = next, better = true;
      }
      damping = std::max(1e-9, damping / 100);
      if (!better || gain < 1e-4 * (1 + cost)) break;
    }
  }
  rematch(x);
  linearize();
  result.numbers = static_cast<int>(r.size());
  result.misfit = rms(differences(postures, predict(x), least));
  MatrixXd A = J.transpose() * J;
  A.diagonal() += weight.cwiseAbs2();
  const double excess = r.squaredNorm() / std::max(1.0, static_cast<double>(r.size() - p));
  const MatrixXd covariance = A.ldlt().solve(MatrixXd::Identity(p, p)) * std::max(1.0, excess);
  for (Index i = 0; i < p; ++i) {
    CalibratedParameter& one = parameters.list[static_cast<std::size_t>(i)];
    one.value = x[i];
    one.std = std::sqrt(covariance(i, i));
    one.determined = one.std < 0.2 * parameters.prior[i];
  }
  for (Index i = 0; i < p; ++i) {
    for (Index k = i + 1; k < p; ++k) {
      const double correlation = covariance(i, k) / std::sqrt(covariance(i, i) * covariance(k, k));
      if (std::abs(correlation) < 0.95) continue;
      result.warnings.push_back(parameters.list[static_cast<std::size_t>(i)].name + " and " +
                                parameters.list[static_cast<std::size_t>(k)].name +
                                " can hardly be told apart by these records (correlation " +
                                std::to_string(correlation).substr(0, 5) +
                                "): other postures, or fix one of them");
    }
  }
  if (r.size() < p) {
    result.warnings.push_back("fewer numbers were measured (" + std::to_string(r.size()) +
                              ") than parameters are wanted (" + std::to_string(p) + ")");
  }
  result.correction = parameters.correction(x, n);
  result.parameters = std::move(parameters.list);
  return result;
}

}  // namespace dashpot::apps
