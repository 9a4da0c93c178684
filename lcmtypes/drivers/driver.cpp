#include <dashpot/lcmtypes/driver.hpp>
#include <dashpot/lcmtypes/lcmt_iiwa_command.hpp>
#include <dashpot/lcmtypes/lcmt_iiwa_status.hpp>
#include <dashpot/lcmtypes/lcmt_panda_command.hpp>
#include <dashpot/lcmtypes/lcmt_panda_status.hpp>

#include <array>

namespace dashpot::lcmtypes {
namespace {

using controller::JointVector;

/// Reads the sizes of a message without decoding it.
class Sizes {
 public:
  /// `hash` is the expected fingerprint.
  Sizes(const void* data, std::size_t size, std::int64_t hash)
      : bytes_(static_cast<const unsigned char*>(data)), size_(size) {
    fits_ = data != nullptr && size >= 8 && read(8) == static_cast<std::uint64_t>(hash);
  }
  Sizes& skip(std::size_t count) {
    fits_ = fits_ && size_ - at_ >= count;
    if (fits_) at_ += count;
    return *this;
  }
  /// Reads a number of entries, and this many entries for each of `arrays`.
  Sizes& arrays(int least, std::size_t arrays) {
    fits_ = fits_ && size_ - at_ >= 4;
    if (!fits_) return *this;
    const auto n = static_cast<std::int32_t>(read(4));
    fits_ = least <= n && n <= controller::kMaxJoints;
    return fits_ ? skip(8 * arrays * static_cast<std::size_t>(n)) : *this;
  }
  bool end() const { return fits_ && at_ == size_; }

 private:
  std::uint64_t read(std::size_t count) {
    std::uint64_t value = 0;
    for (std::size_t i = 0; i < count; ++i) value = (value << 8) | bytes_[at_ + i];
    at_ += count;
    return value;
  }

  const unsigned char* bytes_;
  std::size_t size_;
  std::size_t at_ = 0;
  bool fits_ = false;
};

template <class Message>
bool decode_status(const void* data, std::size_t size, Message& message) noexcept {
  try {
    return message.decode(data, 0, static_cast<int>(size)) == static_cast<int>(size);
  } catch (...) {  // out of memory
    return false;
  }
}

template <class Message>
void encode_message(const Message& message, std::vector<std::uint8_t>& bytes) {
  bytes.resize(static_cast<std::size_t>(message.getEncodedSize()));
  message.encode(bytes.data(), 0, static_cast<int>(bytes.size()));
}

JointVector joints(const std::vector<double>& values) {
  return Eigen::Map<const Eigen::VectorXd>(values.data(), static_cast<Eigen::Index>(values.size()));
}

std::vector<double> list(const JointVector& values) {
  return {values.data(), values.data() + values.size()};
}

/// Returns `values`, or as many zeros as `like` has entries.
std::vector<double> list(const JointVector& values, const JointVector& like) {
  return values.size() > 0 ? list(values) : std::vector<double>(list(like).size());
}

}  // namespace

const DriverProfile& profile_of(DriverKind kind) noexcept {
  static const std::array<DriverProfile, 2> profiles = {
      DriverProfile{"iiwa", "IIWA_STATUS", "IIWA_COMMAND", {60, 60, 60, 30, 12, 12, 6}},
      DriverProfile{"panda", "PANDA_STATUS", "PANDA_COMMAND", {}}};
  return profiles[static_cast<std::size_t>(kind)];
}

bool decode(DriverKind kind, const void* data, std::size_t size, DriverStatus& status) noexcept {
  status = DriverStatus();
  if (kind == DriverKind::kIiwa) {
    drake::lcmt_iiwa_status message;
    if (!Sizes(data, size, message.getHash()).skip(8).arrays(1, 7).end() ||
        !decode_status(data, size, message)) {
      return false;
    }
    status.utime = message.utime;
    status.position = joints(message.joint_position_measured);
    status.velocity = joints(message.joint_velocity_estimated);
    status.commanded = joints(message.joint_position_commanded);
    status.torque = joints(message.joint_torque_measured);
    status.external = joints(message.joint_torque_external);
    return true;
  }
  drake::lcmt_panda_status message;
  if (!Sizes(data, size, message.getHash()).skip(8).arrays(1, 8).skip(8 + 1 + 8 + 1).end() ||
      !decode_status(data, size, message)) {
    return false;
  }
  status.utime = message.utime;
  status.position = joints(message.joint_position);
  status.velocity = joints(message.joint_velocity);
  status.torque = joints(message.joint_torque);
  status.external = joints(message.joint_torque_external);
  status.robot_mode = message.robot_mode;
  status.success_rate = message.control_command_success_rate;
  return true;
}

bool decode(DriverKind kind, const void* data, std::size_t size, DriverCommand& command) noexcept {
  command = DriverCommand();
  if (kind == DriverKind::kIiwa) {
    drake::lcmt_iiwa_command message;
    if (!Sizes(data, size, message.getHash()).skip(8).arrays(0, 1).arrays(0, 1).end() ||
        !decode_status(data, size, message)) {
      return false;
    }
    command.utime = message.utime;
    command.position = joints(message.joint_position);
    command.torque = joints(message.joint_torque);
    return true;
  }
  drake::lcmt_panda_command message;
  if (!Sizes(data, size, message.getHash())
           .skip(8)
           .arrays(0, 1)
           .arrays(0, 1)
           .arrays(0, 1)
           .skip(1)
           .end() ||
      !decode_status(data, size, message)) {
    return false;
  }
  command.utime = message.utime;
  command.position = joints(message.joint_position);
  command.torque = joints(message.joint_torque);
  command.control_mode = message.control_mode_expected;
  return true;
}

void encode(DriverKind kind, const DriverStatus& status, std::vector<std::uint8_t>& bytes) {
  const JointVector& q = status.position;
  const std::vector<double> zeros(list(q).size());
  if (kind == DriverKind::kIiwa) {
    drake::lcmt_iiwa_status message;
    message.utime = status.utime;
    message.num_joints = static_cast<std::int32_t>(q.size());
    message.joint_position_measured = list(q);
    message.joint_velocity_estimated = list(status.velocity, q);
    message.joint_position_commanded = list(status.commanded.size() > 0 ? status.commanded : q);
    message.joint_position_ipo = list(q);
    message.joint_torque_measured = list(status.torque, q);
    message.joint_torque_commanded = zeros;
    message.joint_torque_external = list(status.external, q);
    encode_message(message, bytes);
    return;
  }
  drake::lcmt_panda_status message;
  message.utime = message.robot_utime = status.utime;
  message.num_joints = static_cast<std::int32_t>(q.size());
  message.joint_position = message.joint_position_desired = list(q);
  message.joint_velocity = message.joint_velocity_desired = list(status.velocity, q);
  message.joint_acceleration_desired = message.joint_torque_desired = zeros;
  message.joint_torque = list(status.torque, q);
  message.joint_torque_external = list(status.external, q);
  message.control_command_success_rate = status.success_rate;
  message.robot_mode = static_cast<std::int8_t>(status.robot_mode);
  message.control_mode = 0;
  encode_message(message, bytes);
}

void encode(DriverKind kind, const DriverCommand& command, std::vector<std::uint8_t>& bytes) {
  if (kind == DriverKind::kIiwa) {
    drake::lcmt_iiwa_command message;
    message.utime = command.utime;
    message.num_joints = static_cast<std::int32_t>(command.position.size());
    message.joint_position = list(command.position);
    message.num_torques = static_cast<std::int32_t>(command.torque.size());
    message.joint_torque = list(command.torque);
    encode_message(message, bytes);
    return;
  }
  drake::lcmt_panda_command message;
  message.utime = command.utime;
  message.num_joint_position = static_cast<std::int32_t>(command.position.size());
  message.joint_position = list(command.position);
  message.num_joint_velocity = 0;
  message.num_joint_torque = static_cast<std::int32_t>(command.torque.size());
  message.joint_torque = list(command.torque);
  message.control_mode_expected = static_cast<std::int8_t>(command.control_mode);
  encode_message(message, bytes);
}

}  // namespace dashpot::lcmtypes
