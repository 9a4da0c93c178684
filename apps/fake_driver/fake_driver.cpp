#include <dashpot/apps/fake_driver/fake_driver.hpp>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdlib>
#include <numbers>
#include <stdexcept>

namespace dashpot::apps {
namespace {

using lcmtypes::DriverCommand;
using lcmtypes::DriverKind;

constexpr std::int64_t kEarliest = 250'000;  // us from the first status to a command (iiwa)
constexpr std::int64_t kSilence = 50'000;    // us without a command (iiwa)
constexpr std::int64_t kExpiry = 100'000;    // us of a command's utime (Panda)
constexpr double kHoldStiffness = 1000, kHoldDamping = 50;  // N m/rad, N m s/rad (iiwa)
constexpr double kVelocityCutoff = 40;                      // Hz (iiwa)
constexpr double kTorqueCutoff = 30;                        // Hz (Panda)
constexpr double kTorqueRate = 1000;                        // N m/s (Panda)
constexpr std::int64_t kWithoutClock = 200;                 // statuses (iiwa)
constexpr std::array<double, 7> kDamping = {37.5, 50, 37.5, 25, 5, 3.75, 2.5};  // Panda

sim::PlantOptions plant_options(const Scene& scene, DriverKind kind) {
  sim::PlantOptions options = scene.plant;
  options.delay = std::max(options.delay, 1);
  if (kind == DriverKind::kPanda) options.torque_cutoff = kTorqueCutoff;
  return options;
}

}  // namespace

FakeDriver::FakeDriver(const Scene& scene, DriverKind kind) : scene_(scene), kind_(kind) {
  if (!scene.arm || scene.dof() != 7) throw InputError("robot", "an arm of seven joints is wanted");
  if (!scene.arm->config.robot.options.gravity.isZero(0)) {
    throw InputError("robot.gravity",
                     "must be [0, 0, 0]: the driver compensates gravity, so that none is left");
  }
  mechanism_ = make_mechanism(scene);
  plant_.emplace(*mechanism_, plant_options(scene, kind), scene.start, scene.velocity);
  last_position_ = spring_rest_ = scene.start;
  velocity_ = last_torque_ = JointVector::Zero(scene.dof());
}

void FakeDriver::take(const void* data, std::size_t size, std::int64_t utime) {
  DriverCommand command;
  const bool iiwa = kind_ == DriverKind::kIiwa;
  if (!decode(kind_, data, size, command)) throw std::runtime_error("a command cannot be read");
  if (iiwa && (first_ == 0 || utime - first_ < kEarliest)) {
    throw std::runtime_error("a command came within 0.25 s of the first status");
  }
  if (command.torque.size() != 7 || command.position.size() != (iiwa ? 7 : 0)) {
    throw std::runtime_error("a command has " + std::to_string(command.torque.size()) +
                             " torques and " + std::to_string(command.position.size()) +
                             " positions");
  }
  if (!command.torque.allFinite() || !command.position.allFinite()) {
    throw std::runtime_error("a command has a number that is none");
  }
  if (!iiwa && command.control_mode != 4) {
    throw std::runtime_error("a command expects control mode " +
                             std::to_string(command.control_mode));
  }
  if (iiwa && command_) spring_rest_ = command_->position;
  command_ = command;
  arrived_ = utime;
  ++commands_;
}

JointVector FakeDriver::torque(std::int64_t utime) {
  const JointVector& q = plant_->measured().position;
  const JointVector qd = plant_->measured().velocity;
  if (kind_ == DriverKind::kIiwa) {
    const bool counts = command_ && utime - arrived_ <= kSilence;
    if (!counts) ++uncommanded_;
    if (has_springs()) {
      const controller::Environment& own = scene_.arm->config.settings.environment;
      const JointVector pull =
          own.joint_stiffness.cwiseProduct(spring_rest_ - q) - own.joint_damping.cwiseProduct(qd);
      return counts ? JointVector(command_->torque + pull) : pull;
    }
    if (counts) {
      held_.reset();
      return command_->torque;
    }
    if (!held_) held_ = q;
    return kHoldStiffness * (*held_ - q) - kHoldDamping * qd;
  }
  JointVector wanted = JointVector::Zero(7);
  if (command_ && std::abs(utime - command_->utime) <= kExpiry) {
    wanted = command_->torque;
  } else {
    ++uncommanded_;
    for (Eigen::Index i = 0; i < 7; ++i) wanted[i] = -kDamping[static_cast<std::size_t>(i)] * qd[i];
  }
  const double step = kTorqueRate * period();
  for (Eigen::Index i = 0; i < 7; ++i) {
    last_torque_[i] += std::clamp(wanted[i] - last_torque_[i], -step, step);
  }
  return last_torque_;
}

bool FakeDriver::has_springs() const noexcept {
  const controller::Environment& own = scene_.arm->config.settings.environment;
  return kind_ == DriverKind::kIiwa &&
         !(own.joint_stiffness.isZero(0) && own.joint_damping.isZero(0));
}

void FakeDriver::step(std::int64_t utime) {
  const sim::Status moved = plant_->step(torque(utime));
  if (moved != sim::Status::kOk) {
    throw std::runtime_error(std::string("the simulation ended: ") + sim::to_text(moved));
  }
  const JointVector& q = plant_->measured().position;
  const double gain = 1 - std::exp(-2 * std::numbers::pi * kVelocityCutoff * period());
  velocity_ += gain * ((q - last_position_) / period() - velocity_);
  last_position_ = q;
  if (first_ == 0) first_ = utime;
  ++statuses_;
}

lcmtypes::DriverStatus FakeDriver::status(std::int64_t utime) const {
  lcmtypes::DriverStatus status;
  const bool iiwa = kind_ == DriverKind::kIiwa;
  status.utime = iiwa && statuses_ <= kWithoutClock ? -1 : utime;
  status.position = plant_->measured().position;
  if (has_springs()) status.commanded = spring_rest_;
  status.velocity = iiwa ? velocity_ : plant_->measured().velocity;
  status.torque = plant_->torque();
  status.external = JointVector::Zero(7);
  status.robot_mode = iiwa ? 0 : 2;
  return status;
}

}  // namespace dashpot::apps
