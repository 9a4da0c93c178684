#pragma once
#include <dashpot/controller/settings.hpp>

#include <stdexcept>
#include <string>
#include <utility>

namespace dashpot::controller {

/// Thrown at set-up; `key` is the setting's key in a configuration file, such as "limits.torque",
/// or for gains the member, such as "initial.gains.task_stiffness".
class InvalidSettings : public std::invalid_argument {
 public:
  InvalidSettings(std::string key, const std::string& reason)
      : std::invalid_argument(key + ": " + reason), key_(std::move(key)) {}
  const std::string& key() const noexcept { return key_; }

 private:
  std::string key_;
};

/// Throws InvalidSettings, with key, value and unit, unless all sizes are n, all numbers are finite
/// and in their ranges, and all gains are symmetric positive semidefinite.
void validate(const Settings& settings, int n);

}  // namespace dashpot::controller
