#pragma once
#include <stdexcept>

namespace dashpot::sim {

/// Thrown at set-up for options that make no sense; the message names the key, and the unit.
class InvalidScene : public std::invalid_argument {
 public:
  using std::invalid_argument::invalid_argument;
};

}  // namespace dashpot::sim
