// The sanitizer that a test program is compiled for, or another slow machine: that of Valgrind (tests/memcheck) or of qemu
// (tests/aarch64).
#pragma once

#if defined(__has_feature)  // clang, which has no macros of its own for this
#if __has_feature(address_sanitizer)
#define __SANITIZE_ADDRESS__ 1
#elif __has_feature(thread_sanitizer)
#define __SANITIZE_THREAD__ 1
#endif
#endif

namespace scenes {

#if defined(__SANITIZE_ADDRESS__) || defined(__SANITIZE_THREAD__) || defined(FORCESERVER_IS_SLOW)
inline constexpr bool is_sanitized = true;  // all is slower, and the heap is the sanitizer's
#else
inline constexpr bool is_sanitized = false;
#endif

#if defined(__SANITIZE_THREAD__)
inline constexpr bool seeks_races = true;  // and finds nothing else: tests in which nothing runs at the same time are left out
#else
inline constexpr bool seeks_races = false;
#endif

}  // namespace scenes
