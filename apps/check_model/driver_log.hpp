#pragma once
#include <dashpot/apps/records/recorded_motion.hpp>

#include <optional>
#include <string>

namespace dashpot::apps {

/// Reads the statuses of a driver of an iiwa or a Panda from an LCM log: channels q1 ..., v1 ...
/// and the measured torques tau1 ...; and tau_cmd1 ..., the torques of the commands that followed
/// the statuses, if the log has any. Nothing if the file is not a log or has no statuses. Throws
/// InputError if the number of joints changes.
std::optional<MotionFile> read_driver_log(const std::string& path);

}  // namespace dashpot::apps
