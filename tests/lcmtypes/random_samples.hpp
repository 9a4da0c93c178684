#pragma once
// Samples and commands with random content, and their bytes.

#include <dashpot/lcmtypes/command_filter.hpp>
#include <dashpot/lcmtypes/publish/encode.hpp>
#include <dashpot/lcmtypes/samples.hpp>
#include <dashpot/tests/support/random.hpp>

#include <Eigen/Geometry>
#include <algorithm>
#include <cstdint>
#include <memory>
#include <vector>

namespace dashpot::lcmtypes {

using testing::Random;
using Bytes = std::vector<std::uint8_t>;

inline constexpr std::int64_t kNow = 1'700'000'000'000'000;  // us, some day in 2023

template <class Vector>
std::vector<double> list(const Vector& values) {
  return {values.data(), values.data() + values.size()};
}

inline controller::Pose random_pose(Random& random) {
  const Eigen::Vector4d q = random.vector(4).normalized();
  return {random.vector(3), Eigen::Quaterniond(q).toRotationMatrix()};
}

inline StateSample random_state(Random& random, int n) {
  StateSample sample;
  sample.utime = kNow + random.integer(0, 1'000'000'000);
  controller::Snapshot& snapshot = sample.snapshot;
  snapshot.tick = static_cast<std::uint64_t>(random.integer(1, 1'000'000'000));
  snapshot.restarts = static_cast<std::uint64_t>(random.integer(1, 9));
  snapshot.status = static_cast<controller::Status>(random.integer(0, 13));
  snapshot.mode = static_cast<controller::Mode>(random.integer(0, 1));
  for (auto* vector : {&snapshot.position, &snapshot.velocity, &snapshot.torque,
                       &snapshot.law_torque, &snapshot.reference_position}) {
    *vector = random.vector(n);
  }
  snapshot.tip = random_pose(random);
  snapshot.reference_tip = random_pose(random);
  snapshot.tip_error = random.vector(6);
  snapshot.tip_wrench = random.vector(6);
  snapshot.joint_damping_ratio = random.uniform(0, 2);
  snapshot.task_damping_ratio = random.uniform(0, 2);
  snapshot.damping_level = random.uniform(0.1, 1);
  snapshot.energy_store = random.uniform(0, 10);
  snapshot.spring_share = random.uniform(0, 1);
  snapshot.payload = {random.uniform(0, 9), random.vector(3), Eigen::Matrix3d::Identity()};
  snapshot.tool = random_pose(random);
  snapshot.fault = static_cast<controller::Status>(random.integer(0, 13));
  sample.health = {random.integer(1, 99'999),
                   random.integer(1, 999'999),
                   random.integer(0, 99),
                   random.integer(0, 99),
                   {}};
  CommandTally& commands = sample.health.commands;
  for (std::int64_t& verdict : commands.verdicts) verdict = random.integer(0, 99);
  commands.last_refusal = static_cast<CommandVerdict>(random.integer(0, 15));
  commands.last_refusal_utime = kNow + random.integer(0, 99);
  commands.last_refused_sender = random.integer(0, 99);
  commands.commander = random.integer(0, 99);
  return sample;
}

inline ModesSample random_modes(Random& random, int n) {
  ModesSample sample;
  sample.utime = kNow + random.integer(0, 1'000'000'000);
  controller::Vibration& vibration = sample.vibration;
  vibration.tick = static_cast<std::uint64_t>(random.integer(1, 1'000'000'000));
  vibration.origin = static_cast<analysis::SpectrumOrigin>(random.integer(0, 2));
  vibration.position = random.vector(n);
  vibration.zero_modes = random.integer(0, n);
  vibration.count = n - vibration.zero_modes;
  for (std::size_t i = 0; i < static_cast<std::size_t>(vibration.count); ++i) {
    controller::VibrationMode& mode = vibration.modes[i];
    mode.label = random.integer(0, 1000);
    for (analysis::Complex& value : mode.eigenvalues) {
      value.real(random.uniform(-9, 0));
      value.imag(random.uniform(-9, 9));
    }
    mode.natural_frequency = random.uniform(1, 99);
    mode.damping_ratio = random.uniform(0, 2);
    mode.damped_frequency = random.uniform(1, 99);
    mode.kind = static_cast<analysis::ModeKind>(random.integer(0, 5));
    mode.shape.resize(n);
    mode.shape.real() = random.vector(n);
    mode.shape.imag() = random.vector(n);
    mode.error_bound = random.log_uniform(1e-14, 1e-9);
    mode.natural_frequency_bound = random.log_uniform(1e-14, 1e-9);
    mode.damping_ratio_bound = random.log_uniform(1e-14, 1e-9);
  }
  return sample;
}

inline SampledModesSample random_sampled_modes(Random& random, int n) {
  SampledModesSample sample;
  sample.utime = kNow + random.integer(0, 1'000'000'000);
  controller::SampledVibration& vibration = sample.vibration;
  vibration.tick = static_cast<std::uint64_t>(random.integer(1, 1'000'000'000));
  vibration.position = random.vector(n);
  vibration.status = static_cast<analysis::Status>(random.integer(0, 9));
  vibration.spectral_radius = random.uniform(0.9, 1.1);
  vibration.gain_margin = random.uniform(0.1, 9);
  vibration.assumes = static_cast<std::uint32_t>(random.integer(0, 63));
  vibration.count = random.integer(0, n);
  for (std::size_t i = 0; i < static_cast<std::size_t>(vibration.count); ++i) {
    vibration.modes[i] = {static_cast<analysis::ModeKind>(random.integer(0, 5)),
                          random.uniform(1, 99),
                          random.uniform(0, 2),
                          random.uniform(1, 99),
                          random.uniform(0, 2),
                          random.uniform(1, 99)};
  }
  return sample;
}

inline std::vector<std::vector<double>> rows_of(const Eigen::MatrixXd& matrix) {
  std::vector<std::vector<double>> rows;
  for (Eigen::Index i = 0; i < matrix.rows(); ++i) {
    const Eigen::VectorXd row = matrix.row(i);
    rows.emplace_back(row.data(), row.data() + row.size());
  }
  return rows;
}

inline constexpr std::int64_t kSender = 0x0123'4567'89ab'cdef;

/// A command of kSender with every part of a set-point, within `limits_for(n)`, given at kNow.
inline command_t random_command(Random& random, int n) {
  command_t message{};
  message.n = n;
  message.sender = kSender;
  message.utime = kNow;
  message.sequence = random.integer(1, 1000);
  message.parts = 127 + int{command_t::TASK_RATIO} + int{command_t::JOINT_RATIO} +
                  int{command_t::PAYLOAD} + int{command_t::TIP_SPEED} + int{command_t::TOOL_FRAME};
  message.mode = command_t::CARTESIAN;
  const Eigen::VectorXd position = random.vector(n).cwiseMax(-3).cwiseMin(3);
  message.joint_position.assign(position.data(), position.data() + n);
  const controller::Pose pose = random_pose(random);
  Eigen::Map<Eigen::Vector3d>(message.tip_position) = 0.1 * pose.position;
  write_quaternion(pose.rotation, message.tip_quaternion);
  Eigen::Map<controller::Vector6>(message.wrench) = random.vector(6);
  message.joint_stiffness = rows_of(1000 * random.spd(n));
  message.joint_damping = rows_of(10 * random.spd(n));
  message.frame = command_t::TOOL;
  std::fill(std::begin(message.directions), std::end(message.directions), std::int8_t{1});
  message.directions[5] = 0;
  using RowMajor6 = Eigen::Matrix<double, 6, 6, Eigen::RowMajor>;
  Eigen::Map<RowMajor6>(&message.task_stiffness[0][0]) = 1000 * random.spd(6);
  Eigen::Map<RowMajor6>(&message.task_damping[0][0]) = 10 * random.spd(6);
  message.null_stiffness.assign(static_cast<std::size_t>(n), random.uniform(0, 20));
  message.null_damping.assign(static_cast<std::size_t>(n), random.uniform(0, 2));
  message.task_damping_ratio = random.uniform(0.1, 2);
  message.joint_damping_ratio = random.uniform(0.1, 2);
  message.payload_mass = random.uniform(1, 9);
  Eigen::Map<Eigen::Vector3d>(message.payload_center) = 0.1 * random.vector(3);
  for (int i = 0; i < 3; ++i) message.payload_inertia[i][i] = random.uniform(0.1, 0.15);
  const controller::Pose tool = random_pose(random);
  Eigen::Map<Eigen::Vector3d>(message.tool_position) = 0.1 * tool.position;
  write_quaternion(tool.rotation, message.tool_quaternion);
  message.linear_velocity = random.uniform(0.1, 2);
  message.angular_velocity = random.uniform(0.1, 2);
  return message;
}

inline CommandLimits limits_for(int n) {
  CommandLimits limits;
  limits.position_lower = controller::JointVector::Constant(n, -3.0);
  limits.position_upper = controller::JointVector::Constant(n, 3.0);
  return limits;
}

template <class Message>
Bytes bytes_of(const Message& message) {
  Bytes bytes;
  encode(message, bytes);
  return bytes;
}

template <class Message, class Sample>
Message message_of(const Sample& sample) {
  Message message{};
  fill(sample, message);
  return message;
}

/// A copy in memory of exactly its size, so that the address sanitizer sees any read beyond.
class Exact {
 public:
  explicit Exact(const Bytes& bytes) : size(bytes.size()), copy_(new std::uint8_t[bytes.size()]) {
    std::copy(bytes.begin(), bytes.end(), copy_.get());
  }
  const std::uint8_t* data() const { return copy_.get(); }
  std::size_t size;

 private:
  std::unique_ptr<std::uint8_t[]> copy_;
};

/// As LCM writes it: the first byte is the highest.
inline void write_int32(Bytes& bytes, std::size_t offset, std::int32_t value) {
  for (std::size_t i = 0; i < 4; ++i) {
    bytes[offset + i] =
        static_cast<std::uint8_t>(static_cast<std::uint32_t>(value) >> (24 - 8 * i));
  }
}

}  // namespace dashpot::lcmtypes
