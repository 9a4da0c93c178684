#pragma once
#include <chrono>
#include <cstdlib>

/// 1 under the address, thread or memory sanitizer, which bring their own malloc and make all slow.
#if defined(__SANITIZE_ADDRESS__) || defined(__SANITIZE_THREAD__)
#define DASHPOT_SANITIZED 1
#elif defined(__has_feature)
#if __has_feature(address_sanitizer) || __has_feature(thread_sanitizer) || \
    __has_feature(memory_sanitizer)
#define DASHPOT_SANITIZED 1
#endif
#endif
#ifndef DASHPOT_SANITIZED
#define DASHPOT_SANITIZED 0
#endif

namespace dashpot::testing {
/// Longest wait of a test for another thread or program: only a hang takes so long.
inline constexpr std::chrono::seconds kHang{120};

/// Whether to leave out what takes long and runs the code of other tests, too: CTest says so where
/// all is slow, under sanitizers and emulators.
inline bool quick() {
  return std::getenv("DASHPOT_QUICK") != nullptr;
}
}  // namespace dashpot::testing
#define DASHPOT_SKIP_IF_QUICK()    \
  if (::dashpot::testing::quick()) \
  GTEST_SKIP() << "takes long; the tests beside it run the same code"
