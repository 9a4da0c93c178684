#pragma once
#include <dashpot/controller/robot_types.hpp>

#include <cstddef>
#include <cstdint>
#include <vector>

namespace dashpot::lcmtypes {

/// The public LCM drivers of arms whose messages are spoken here: drake-iiwa-driver and
/// drake-franka-driver. Their messages are lcmt_iiwa_status and so on, of the package drake.
enum class DriverKind { kIiwa, kPanda };

/// Properties of a driver that its messages do not contain.
struct DriverProfile {
  const char* name;             ///< "iiwa", "panda"
  const char* status_channel;   ///< "IIWA_STATUS"
  const char* command_channel;  ///< "IIWA_COMMAND"
  /// External torque with which the driver stops, N m, for seven joints; empty: it has no such
  /// limit.
  std::vector<double> external_torque;
};
const DriverProfile& profile_of(DriverKind kind) noexcept;

/// The members of a driver's status that are used. Vectors have the status's number of joints.
struct DriverStatus {
  std::int64_t utime = 0;            ///< us; -1: the iiwa's clock is not known yet
  controller::JointVector position;  ///< measured, rad
  controller::JointVector velocity;  ///< rad/s
  /// iiwa: commanded joint positions, rad; the measured ones if it is empty.
  controller::JointVector commanded;
  controller::JointVector torque;    ///< measured, N m
  controller::JointVector external;  ///< external torque as the driver gives it, N m
  int robot_mode = 0;                ///< Panda: 5: stopped by the user, 6: recovers
  double success_rate = 1;           ///< Panda: share of the commands that arrived in time
};

/// The members of a driver's command. A vector without entries is not sent.
struct DriverCommand {
  std::int64_t utime = 0;            ///< us since 1970-01-01 UTC
  controller::JointVector position;  ///< iiwa, rad
  controller::JointVector torque;    ///< beyond gravity, N m
  int control_mode = 4;              ///< Panda: 1 position, 2 velocity, 4 torque
};

/// Decodes bytes of unknown origin, which are judged by fingerprint and sizes before anything is
/// allocated: 1 to 16 joints in a status, 0 to 16 entries in each array of a command, and not a
/// byte too many. Returns false, with the result unspecified, for any others. The values are not
/// judged: they may be NaN.
bool decode(DriverKind kind, const void* data, std::size_t size, DriverStatus& status) noexcept;
bool decode(DriverKind kind, const void* data, std::size_t size, DriverCommand& command) noexcept;

/// Sets `bytes` to the message. Members of a message that are not listed above are zero.
void encode(DriverKind kind, const DriverStatus& status, std::vector<std::uint8_t>& bytes);
void encode(DriverKind kind, const DriverCommand& command, std::vector<std::uint8_t>& bytes);

}  // namespace dashpot::lcmtypes
