#pragma once
#include <stdexcept>
#include <string>

namespace dashpot::sim {

/// Thrown at set-up for options that make no sense; the message names the key, and the unit.
class InvalidScene : public std::invalid_argument {
 public:
  using std::invalid_argument::invalid_argument;
  InvalidScene(const std::string& key, const std::string& reason)
      : InvalidScene(key + ": " + reason) {}
};

}  // namespace dashpot::sim
