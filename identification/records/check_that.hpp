#pragma once
#include <stdexcept>
#include <string>

namespace dashpot::identification {

/// Throws std::invalid_argument, "identify: message", unless the condition holds.
inline void check_that(bool condition, const std::string& message) {
  if (!condition) throw std::invalid_argument("identify: " + message);
}

}  // namespace dashpot::identification
