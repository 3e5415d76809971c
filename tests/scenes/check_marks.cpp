// Check writes the place of each assertion that holds to a file, to tell after a crash which was the last. With a million assertions
// that takes most of the time, so a place is written only when a test comes to it for the first time: after a crash Check names the
// newest such place, which may be some way before the crash. With the linker's option --wrap=_mark_point (tests/CMakeLists.txt)
// calls of Check's function come to __wrap__mark_point, and __real__mark_point is Check's.
#include <atomic>
#include <cstdint>

extern "C" {
void __wrap__mark_point(const char* file, int line);
void __real__mark_point(const char* file, int line);
}

void __wrap__mark_point(const char* file, int line) {
  static std::atomic<bool> is_written[8192];
  std::atomic<bool>& is_place_written = is_written[(reinterpret_cast<uintptr_t>(file) + static_cast<uintptr_t>(line)) % 8192];
  if (is_place_written.load(std::memory_order_relaxed)) return;
  is_place_written.store(true, std::memory_order_relaxed);
  __real__mark_point(file, line);
}
