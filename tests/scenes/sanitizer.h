// The sanitizer that a test program is compiled for.
#pragma once

namespace scenes {

#if defined(__SANITIZE_ADDRESS__) || defined(__SANITIZE_THREAD__)
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
