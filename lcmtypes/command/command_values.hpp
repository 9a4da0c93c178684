#pragma once
#include <dashpot/lcmtypes/command.hpp>
#include <dashpot/lcmtypes/command_limits.hpp>
#include <dashpot/lcmtypes/command_t.hpp>
#include <dashpot/lcmtypes/command_verdict.hpp>

#include <string>

namespace dashpot::lcmtypes {

/// Copies the parts that `message` sets into `command`, if their values are in order: sizes, finite
/// numbers, unit quaternion, `limits`, positive semidefinite gains. Otherwise `command` is left
/// half written, and `why` says which number is beyond which limits, if one is. Does not look at
/// time and sequence.
CommandVerdict copy_values(const command_t& message, const CommandLimits& limits, Command& command,
                           std::string& why);

}  // namespace dashpot::lcmtypes
