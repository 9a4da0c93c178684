#pragma once

#include <stdexcept>
#include <string>

namespace dashpot::analysis {

/// Throws std::invalid_argument, "where: message", unless the condition holds.
inline void require(const char* where, bool condition, const std::string& message) {
  if (!condition) throw std::invalid_argument(std::string(where) + ": " + message);
}

}  // namespace dashpot::analysis
