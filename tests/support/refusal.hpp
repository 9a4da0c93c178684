#pragma once
#include <string>

namespace dashpot::testing {

/// Returns what an error of this kind says that `call` throws.
template <class Error, class Call>
std::string refusal(const Call& call) {
  try {
    call();
  } catch (const Error& error) {
    return error.what();
  }
  return "accepted";
}

}  // namespace dashpot::testing
