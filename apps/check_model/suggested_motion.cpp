#include <dashpot/apps/check_model/calibrated_modes.hpp>
#include <dashpot/apps/check_model/suggested_motion.hpp>
#include <dashpot/apps/check_model/written_arm.hpp>
#include <dashpot/apps/cli/subcommands.hpp>
#include <dashpot/apps/cli/terminal.hpp>
#include <dashpot/apps/loop/simulated_loop.hpp>
#include <dashpot/apps/scene/scene.hpp>
#include <dashpot/text/printable.hpp>
#include <dashpot/text/read_file.hpp>

#include <algorithm>
#include <array>
#include <cmath>
#include <filesystem>
#include <optional>
#include <random>

namespace dashpot::apps {
namespace {

using Eigen::Index;
using identification::TorqueRecord;

/// How fast goals are gone to: the share of the velocity limits, s to reach it, s in all.
struct Pace {
  double velocity, rise, duration;
};
constexpr std::array kPaces = {Pace{0.1, 0.25, 30},  Pace{0.2, 0.25, 30},  Pace{0.3, 0.25, 60},
                               Pace{0.3, 0.25, 120}, Pace{0.45, 0.25, 60}, Pace{0.6, 0.15, 120}};
constexpr double kEvery = 1.5;     // s from goal to goal
constexpr double kLimited = 0.02;  // share of the time in which limits of torque or speed may act

/// A file beside the result, for the scenes that are tried; goes in the end.
struct TrialFile {
  explicit TrialFile(const std::string& result) : path(result + ".trial") {}
  TrialFile(const TrialFile&) = delete;
  TrialFile& operator=(const TrialFile&) = delete;
  ~TrialFile() {
    std::error_code ignored;
    std::filesystem::remove(path, ignored);
  }
  const std::string path;
};

/// Where goals may be: the middle and half the range of each joint.
std::pair<JointVector, JointVector> ranges(const Config& config, const CheckModelReport& report) {
  const controller::Limits& limits = config.settings.limits;
  JointVector middle = (report.lowest + report.highest) / 2;
  JointVector half = (report.highest - report.lowest) / 2;
  for (Index j = 0; j < half.size(); ++j) {
    const controller::Joint& joint = config.model.joints()[static_cast<std::size_t>(j)];
    const bool slides = joint.type == controller::JointType::kPrismatic;
    half[j] = std::max(half[j], slides ? 0.05 : 0.3);
    const double margin = slides ? 0.01 : 0.1;
    const double lower = limits.position_lower[j] + margin;
    const double upper = limits.position_upper[j] - margin;
    if (!(lower < upper)) {
      half[j] = 0;
    } else {
      half[j] = std::min(half[j], (upper - lower) / 2);
      middle[j] = std::clamp(middle[j], lower + half[j], upper - half[j]);
    }
  }
  return {middle, half};
}

/// The configuration with goals that are gone to at a pace.
std::string with_goals(const std::string& text, std::vector<ConfigChange> changes,
                       const Config& config, const CheckModelReport& report, const Pace& pace,
                       bool& kept) {
  const auto [middle, half] = ranges(config, report);
  std::mt19937 random(1);
  const auto uniform = [&random] { return static_cast<double>(random()) / 4294967296.0; };
  std::string steps;
  for (double at = 0.5; at + kEvery <= pace.duration; at += kEvery) {
    JointVector goal = middle;
    for (Index j = 0; j < goal.size(); ++j) goal[j] += half[j] * (2 * uniform() - 1);
    steps += (steps.empty() ? "" : ",") + std::string("\n    {at: ") + text::number(at) +
             ", joint_position: " + yaml_list(goal) + "}";
  }
  const JointVector velocity = pace.velocity * config.settings.limits.velocity;
  changes.push_back({{"control", "mode"}, "joint"});
  changes.push_back({{"motion", "velocity"}, yaml_list(velocity)});
  changes.push_back({{"motion", "acceleration"}, yaml_list(velocity / pace.rise)});
  changes.push_back({{"scenario"},
                     "{duration: " + text::number(pace.duration) + ", start: {position: " +
                         yaml_list(middle) + "}, steps: [" + steps + "]}"});
  return changed_config(text, changes, kept);
}

/// Returns what the calibrated arm does in the scene; no record if limits of the controller act
/// often, or a worse status appears.
std::optional<TorqueRecord> simulate(const std::string& path, const Config& config,
                                     const CheckModelReport& report) {
  Scene scene = load_scene(path);
  controller::RobotDescription robot = calibrated_robot(config, report.check);
  sim::RobotParameters parameters = believed(robot, robot.model());
  for (Index j = 0; j < parameters.reflected_inertia.size(); ++j) {
    const identification::Estimate& one =
        report.check.joints[static_cast<std::size_t>(j)].reflected_inertia;
    // A rotor that is not determined, or whose joint never moved, has at least its deviation.
    double& inertia = parameters.reflected_inertia[j];
    if (!one.determined && std::isfinite(one.deviation)) {
      inertia = std::max({inertia, one.value, one.deviation});
    }
  }
  if (!config.settings.feed_forward.gravity) parameters.gravity.setZero();  // the robot holds it
  scene.arm->robot = sim::Robot::from_file(robot.urdf, robot.base, robot.tip, parameters);
  scene.plant.delay = std::max(scene.plant.delay, report.loop.delay);
  const auto controller = PluginLibrary("").create(path, scene.dof());
  ClosedLoop loop(scene, *controller);
  const auto every = static_cast<Index>(std::max(1.0, std::round(4e-3 / scene.plant.period)));
  const Index count = static_cast<Index>(scene.duration / scene.plant.period) / every;
  const Index n = scene.dof();
  TorqueRecord record{Eigen::VectorXd(count), Eigen::MatrixXd(n, count), Eigen::MatrixXd(n, count)};
  JointVector left = JointVector::Zero(n);
  for (Index j = 0; j < n; ++j) {
    const JointCheck& joint = report.check.joints[static_cast<std::size_t>(j)];
    if (joint.moves) left[j] = joint.residual_after;
  }
  left = (left.array() > 0).select(left, left.maxCoeff());  // as much at joints that rested
  std::mt19937 random(2);
  std::normal_distribution<double> normal;
  JointVector noise = JointVector::Zero(n);
  const double step = static_cast<double>(every) * scene.plant.period;
  const double keep = std::exp(-step / report.check.window);
  double limited = 0;  // ticks
  for (Index i = 0; i < count; ++i) {
    for (Index tick = 0; tick < every; ++tick) {
      loop.follow_scenario();
      const std::int32_t status = loop.control();
      limited += status == DASHPOT_TORQUE_LIMITED ? 1 : 0;
      if (status < 0 || status >= DASHPOT_SETPOINT_REJECTED ||
          limited > kLimited * static_cast<double>(count * every) ||
          loop.move() != sim::Status::kOk) {
        return std::nullopt;
      }
    }
    const sim::Measurement& measured = loop.plant().measured();
    record.time[i] = step * static_cast<double>(i);
    record.position.col(i) = measured.position;
    // Somewhat more than the model leaves over of the records, with the memory of a window.
    for (Index j = 0; j < n; ++j) {
      noise[j] = keep * noise[j] + std::sqrt(1 - keep * keep) * 1.3 * left[j] * normal(random);
    }
    record.torque.col(i) = measured.torque + noise;
  }
  return record;
}

/// Joints with what a check leaves undetermined, and the motion that would tell.
std::vector<std::string> undetermined(const ModelCheck& check) {
  std::vector<std::string> all;
  for (std::size_t j = 0; j < check.joints.size(); ++j) {
    const std::string& wanted = check.joints[j].wanted;
    if (!wanted.empty()) all.push_back("joint " + std::to_string(j + 1) + ": " + wanted);
  }
  return all;
}

}  // namespace

void suggest_motion(const std::string& from, const std::string& to, const Config& config,
                    CheckModelReport& report) {
  refuse_doubtful("--suggest-motion", report.check);
  if (undetermined(report.check).empty()) {
    throw InputError("--suggest-motion", "the records determine everything: no motion is needed");
  }
  const std::string text = text::read_regular_file(from);
  std::string best;
  std::vector<std::string> left;
  bool kept = true;
  const TrialFile trial(to);
  for (const Pace& pace : kPaces) {
    show_progress(static_cast<double>(&pace - kPaces.data()) / kPaces.size(), "trying a motion");
    const std::string scene =
        with_goals(text, path_changes(from, to, config), config, report, pace, kept);
    write_text("--suggest-motion", trial.path, scene);
    const auto record = simulate(trial.path, config, report);
    if (!record) break;
    const ModelCheck check = identification::check_model(
        config.robot, {*record},
        {report.check.validation / report.check.used, report.payload_known});
    std::vector<std::string> there = undetermined(check);
    if (!best.empty() && there.size() >= left.size()) continue;
    best = scene;
    left = std::move(there);
    if (left.empty()) break;
  }
  if (best.empty()) {
    throw InputError("--suggest-motion",
                     "with the gains and limits of the configuration, limits act even in slow "
                     "motion");
  }
  std::string comment =
      "# Goals that determine what the records of dashpot calibrate do not. Dashpot does not know\n"
      "# what stands around the arm: look at each goal first. dashpot run FILE, or dashpot drive\n"
      "# FILE --scenario.\n";
  for (const std::string& one : left) {
    comment += "# Not determined even so: " + one + "\n";
    report.notes.push_back("the suggested motion does not determine " + one);
  }
  if (!kept) report.notes.push_back("the comments of " + from + " were not kept");
  write_text("--suggest-motion", to, comment + best);
}

}  // namespace dashpot::apps
