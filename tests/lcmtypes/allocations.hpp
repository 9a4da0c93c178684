#pragma once
#include <cstddef>

namespace dashpot::lcmtypes {

/// What operator new was asked for. Counted in the whole program lcmtypes_tests, unless a sanitizer
/// brings its own (allocations_test.cpp).
struct Allocations {
  int count = 0;
  std::size_t largest = 0;  ///< bytes
};

/// Returns the allocations of this thread since it began.
Allocations& allocations() noexcept;

/// Returns the allocations of this thread while `act` runs.
template <class Act>
Allocations allocations_of(const Act& act) {
  allocations() = {};
  act();
  return allocations();
}

}  // namespace dashpot::lcmtypes
