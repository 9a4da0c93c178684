#pragma once
// Records of ordinary motion and torques of arms that MuJoCo moves, with what a URDF does not say.

#include <dashpot/controller/dynamics.hpp>
#include <dashpot/controller/robot_description.hpp>
#include <dashpot/identification/torque_record.hpp>
#include <dashpot/tests/support/arms.hpp>
#include <dashpot/tests/support/dice.hpp>
#include <dashpot/tests/support/mujoco_arm.hpp>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdio>
#include <fstream>
#include <numbers>
#include <sstream>
#include <stdexcept>
#include <string>
#include <utility>
#include <vector>

namespace dashpot::testing {

/// An arm that follows sums of sines under springs and dampers in its joints at 1 kHz, and what its
/// drives and sensors are like.
struct MovedArm {
  MovedArm(const Arm& which, Dice& dice)
      : description{arm_path(which.file), which.base, which.tip, {}}, n(description.model().dof()) {
    for (Eigen::VectorXd* all : {&rotors, &coulomb, &viscous, &offset}) all->resize(n);
    for (Eigen::Index j = 0; j < n; ++j) {
      const bool large = j < (n + 1) / 2;
      rotors[j] = large ? dice.log_uniform(0.2, 2) : dice.log_uniform(0.05, 0.4);
      coulomb[j] = large ? dice.log_uniform(0.3, 3) : dice.log_uniform(0.1, 1);
      viscous[j] = large ? dice.log_uniform(0.2, 3) : dice.log_uniform(0.05, 0.5);
      offset[j] = (large ? 0.3 : 0.1) * dice.normal();
    }
    delay = dice.integer(0, 3);
    bits = dice.integer(12, 20);
    constexpr std::array<double, 4> kRates = {100, 250, 500, 1000};
    rate = kRates[static_cast<std::size_t>(dice.integer(0, 3))];
    torque_noise = dice.log_uniform(0.01, 0.2);
  }

  controller::RobotDescription description;  ///< what is known of it
  std::string truth = {};                    ///< its true URDF; empty: as described
  Eigen::Index n;
  Eigen::VectorXd rotors, coulomb, viscous, offset;  ///< kg m^2, N m, N m s/rad, N m
  sim::Inertia payload;
  Eigen::Vector3d gravity{0, 0, -9.81};
  int delay = 0, bits = 16;  ///< ticks from a torque to its effect; of an encoder's turn
  double recorded_late = 0;  ///< s, of the torques: sensors that filter
  double rate = 1000, duration = 30, torque_noise = 0.05;  ///< Hz, s, N m
  double speed = 1;                                        ///< of the motion

  /// Semi-implicit steps of a quarter of a tick act half a step early.
  double delay_in_record() const { return (delay + 0.5 - 0.125) * kTick - recorded_late; }

  /// Gives the link that joint j moves a mass, and moments of inertia, that are larger by a share.
  void make_heavier(Eigen::Index j, double share) {
    std::ifstream file(description.urdf);
    std::stringstream text;
    text << file.rdbuf();
    truth = text.str();
    const controller::RobotModel model = description.model();
    const std::string& joint = model.joints()[static_cast<std::size_t>(j)].name;
    const auto link = after("<child", truth.find("<joint name=\"" + joint + "\""));
    const auto name = truth.find('"', link) + 1;
    auto at = truth.find("<link name=\"" + truth.substr(name, truth.find('"', name) - name) + "\"");
    for (const char* number : {"<mass", "ixx=", "ixy=", "ixz=", "iyy=", "iyz=", "izz="}) {
      const auto from = truth.find('"', after(number, at)) + 1, to = truth.find('"', from);
      std::array<char, 40> larger{};
      std::snprintf(larger.data(), larger.size(), "%.15g",
                    (1 + share) * std::stod(truth.substr(from, to - from)));
      truth.replace(from, to - from, larger.data());
    }
  }

  identification::TorqueRecord record(Dice& dice) const {
    const controller::RobotModel known = description.model();
    const Path path(known, speed, dice);
    sim::RobotParameters parameters;
    parameters.reflected_inertia = rotors;
    parameters.coulomb_friction = coulomb;
    parameters.viscous_friction = viscous;
    parameters.gravity = gravity;
    parameters.accept_inertias = true;
    const sim::Robot robot =
        truth.empty()
            ? sim::Robot::from_file(description.urdf, known.base(), known.tip(), parameters)
            : sim::Robot::from_text(truth, known.base(), known.tip(), parameters);
    MujocoOptions options;
    options.delay = delay;
    options.payload = payload;
    const auto [from, moving] = path.at(0);
    const auto arm = MujocoArm::make(robot, {}, options, from, moving);
    const auto ticks = static_cast<Eigen::Index>(duration / kTick);
    const auto every = static_cast<Eigen::Index>(std::lround(1 / (kTick * rate)));
    const auto late = static_cast<Eigen::Index>(std::lround(recorded_late / kTick));
    Eigen::MatrixXd torque(n, ticks), position(n, ticks);
    const controller::DynamicsKernel kernel(known);
    controller::DynamicsResult at;
    constexpr double kStiff = 25;  // rad/s
    for (Eigen::Index i = 0; i < ticks; ++i) {
      const auto [q, qd] = path.at(static_cast<double>(i) * kTick);
      kernel.evaluate(q, qd, at);
      const Eigen::VectorXd inertia = at.M.diagonal() + rotors;
      position.col(i) = arm->position();
      torque.col(i) = at.gravity + inertia.cwiseProduct(kStiff * kStiff * (q - arm->position()) +
                                                        2 * kStiff * (qd - arm->velocity()));
      arm->step(torque.col(i), kTick);
    }
    identification::TorqueRecord result;
    const Eigen::Index N = ticks / every;
    result.time.resize(N);
    result.position.resize(n, N);
    result.torque.resize(n, N);
    const double step = 2 * std::numbers::pi / std::exp2(bits);
    for (Eigen::Index i = 0; i < N; ++i) {
      result.time[i] = static_cast<double>(i * every) * kTick;
      result.position.col(i) = step * (position.col(i * every) / step).array().round();
      result.torque.col(i) = torque.col(std::max<Eigen::Index>(0, i * every - late)) + offset +
                             torque_noise * dice.vector(n);
    }
    return result;
  }

 private:
  std::size_t after(const char* what, std::size_t from) const {
    const auto at = truth.find(what, from);
    if (at == std::string::npos) throw std::runtime_error(std::string("no ") + what);
    return at;
  }

  static constexpr double kTick = 1e-3;
  static constexpr int kSines = 3;

  /// The wanted motion.
  struct Path {
    Path(const controller::RobotModel& model, double speed, Dice& dice) {
      for (const controller::Joint& joint : model.joints()) {
        const double lower = std::max(joint.lower, -2.5), upper = std::min(joint.upper, 2.5);
        const double range = std::min(1.2, 0.35 * (upper - lower));
        Eigen::Array<double, kSines, 3> sines;
        for (int s = 0; s < kSines; ++s) {
          sines(s, 1) = 2 * std::numbers::pi * speed * dice.uniform(0.08, 0.25) * (s + 1);
          sines(s, 2) = dice.uniform(0, 2 * std::numbers::pi);
        }
        Eigen::Array<double, kSines, 1> size(1.0, 0.5, 0.3);
        size *= range / size.sum();
        const double fastest = (size * sines.col(1)).sum();
        sines.col(0) = size * std::min(1.0, 0.9 * joint.velocity / fastest);
        center.push_back(dice.uniform(lower + range, upper - range));
        parts.push_back(sines);
      }
    }
    std::pair<controller::JointVector, controller::JointVector> at(double t) const {
      const auto joints = static_cast<Eigen::Index>(parts.size());
      controller::JointVector q(joints), qd(joints);
      for (Eigen::Index j = 0; j < joints; ++j) {
        const auto& sines = parts[static_cast<std::size_t>(j)];
        const auto phase = sines.col(1) * t + sines.col(2);
        q[j] = center[static_cast<std::size_t>(j)] + (sines.col(0) * phase.sin()).sum();
        qd[j] = (sines.col(0) * sines.col(1) * phase.cos()).sum();
      }
      return {q, qd};
    }
    std::vector<double> center;
    std::vector<Eigen::Array<double, kSines, 3>> parts;
  };
};

/// "delay 2, 17 bits, 250 Hz, 0.02 N m"
inline std::string record_name(const MovedArm& arm) {
  std::array<char, 100> text{};
  std::snprintf(text.data(), text.size(), "delay %d, %d bits, %g Hz, %.2g N m", arm.delay, arm.bits,
                arm.rate, arm.torque_noise);
  return text.data();
}

}  // namespace dashpot::testing
