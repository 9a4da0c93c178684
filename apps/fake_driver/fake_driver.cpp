#include <dashpot/apps/fake_driver/fake_driver.hpp>
#include <dashpot/controller/dynamics.hpp>

#include <Eigen/Cholesky>
#include <algorithm>
#include <array>
#include <cmath>
#include <cstdlib>
#include <numbers>
#include <stdexcept>

namespace dashpot::apps {
namespace {

using controller::JointMatrix;
using lcmtypes::DriverCommand;
using lcmtypes::DriverKind;
using Seven = std::array<double, 7>;

constexpr std::int64_t kEarliest = 250'000;  // us from the first status to a command (iiwa)
constexpr std::int64_t kSilence = 50'000;    // us without a command (iiwa)
constexpr std::int64_t kExpiry = 100'000;    // us of a command's utime (Panda)
constexpr Seven kHoldStiffness = {1000, 1000, 1000, 500, 500, 500, 500};  // N m/rad (iiwa)
constexpr Seven kHoldDamping = {50, 50, 50, 50, 35, 35, 35};              // N m s/rad (iiwa)
constexpr double kVelocityCutoff = 40;                                    // Hz (iiwa)
constexpr double kTorqueCutoff = 30;                                      // Hz (Panda)
constexpr double kTorqueRate = 1000;                                      // N m/s (Panda)
constexpr std::int64_t kWithoutClock = 200;                               // statuses (iiwa)
constexpr Seven kDamping = {37.5, 50, 37.5, 25, 5, 3.75, 2.5};            // N m s/rad (Panda)

JointVector vector(const Seven& values) {
  return Eigen::Map<const Eigen::Matrix<double, 7, 1>>(values.data());
}

sim::PlantOptions plant_options(const Scene& scene) {
  sim::PlantOptions options = scene.plant;
  options.delay = 0;  // FakeDriver delays commands alone
  return options;
}

/// Returns the gain of both drivers' low-pass: y += gain (u - y) once a period.
double low_pass_gain(double cutoff, double period) {
  return period / (period + 1 / (2 * std::numbers::pi * cutoff));
}

}  // namespace

FakeDriver::FakeDriver(const Scene& scene, DriverKind kind) : scene_(scene), kind_(kind) {
  if (scene.dof() != 7) throw InputError("robot", "an arm of seven joints is wanted");
  if (!scene.arm->config.robot.options.gravity.isZero(0)) {
    throw InputError("robot.gravity",
                     "must be [0, 0, 0]: the driver compensates gravity, so that none is left");
  }
  arm_.emplace(scene.arm->robot, scene.arm->options);
  plant_.emplace(*arm_, plant_options(scene), scene.start, scene.velocity);
  last_position_ = spring_rest_ = scene.start;
  velocity_ = last_torque_ = JointVector::Zero(scene.dof());
  due_.assign(static_cast<std::size_t>(std::max(scene.plant.delay, 1)), last_torque_);
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
    throw std::runtime_error("a command has NaN or infinity");
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
  const bool iiwa = kind_ == DriverKind::kIiwa;
  const bool counts = command_ && (iiwa ? utime - arrived_ <= kSilence
                                        : std::abs(utime - command_->utime) <= kExpiry);
  if (!counts) ++uncommanded_;
  if (!counts && !has_springs()) {
    due_.assign(due_.size(), iiwa ? resting_torque() : filtered(resting_torque()));
    return due_.front();
  }
  held_.reset();
  due_.push_back(iiwa ? torque_of_iiwa(counts) : filtered(command_->torque));
  JointVector due = due_.front();
  due_.pop_front();
  return due;
}

JointVector FakeDriver::torque_of_iiwa(bool counts) const {
  if (!has_springs()) return command_->torque;
  const sim::Measurement& now = plant_->measured();
  const controller::Environment& own = scene_.arm->config.settings.environment;
  const JointVector pull = own.joint_stiffness.cwiseProduct(spring_rest_ - now.position) -
                           own.joint_damping.cwiseProduct(now.velocity);
  return counts ? JointVector(command_->torque + pull) : pull;
}

/// Low-pass, then rate limit: the order of libfranka.
JointVector FakeDriver::filtered(const JointVector& torque) {
  const double most = kTorqueRate * period();
  const JointVector change = low_pass_gain(kTorqueCutoff, period()) * (torque - last_torque_);
  last_torque_ += change.cwiseMin(most).cwiseMax(-most);
  return last_torque_;
}

/// A step h of the implicit Euler method, without delay, because the model has no rotors: its wrist
/// is unstable with these gains a period late.
///     (M + h D + h^2 K) qd+ = M qd + h K (q_h - q),  torque = K (q_h - q - h qd+) - D qd+
JointVector FakeDriver::resting_torque() {
  const JointVector& q = plant_->measured().position;
  const JointVector& qd = plant_->measured().velocity;
  if (!held_) held_ = q;
  const bool iiwa = kind_ == DriverKind::kIiwa;
  const double h = period();
  const JointVector K = iiwa ? vector(kHoldStiffness) : JointVector(JointVector::Zero(7));
  const JointVector D = vector(iiwa ? kHoldDamping : kDamping);
  JointMatrix M = controller::evaluate(scene_.arm->config.model, q, qd).M;
  const JointVector impulse = M * qd + h * K.cwiseProduct(*held_ - q);
  M.diagonal() += h * D + h * h * K;
  const JointVector next = M.llt().solve(impulse);
  return K.cwiseProduct(*held_ - q - h * next) - D.cwiseProduct(next);
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
  velocity_ +=
      low_pass_gain(kVelocityCutoff, period()) * ((q - last_position_) / period() - velocity_);
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
