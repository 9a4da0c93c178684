#pragma once

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

/// 1 under the thread sanitizer, which makes a loop slower than 1 kHz leaves time for.
#if defined(__SANITIZE_THREAD__)
#define DASHPOT_THREAD_SANITIZED 1
#elif defined(__has_feature)
#if __has_feature(thread_sanitizer)
#define DASHPOT_THREAD_SANITIZED 1
#endif
#endif
#ifndef DASHPOT_THREAD_SANITIZED
#define DASHPOT_THREAD_SANITIZED 0
#endif
