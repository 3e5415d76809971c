// Check writes the place of each assertion that holds to a file, so that it can say after which one a test crashed. A test of a
// million assertions spends most of its time on that. So each line is written once: when a test comes to it for the first time.
// The linker puts the first function here in place of Check's, which it calls the second.
#include <atomic>

extern "C" {
void __wrap__mark_point(const char* file, int line);
void __real__mark_point(const char* file, int line);
}

void __wrap__mark_point(const char* file, int line) {
  static std::atomic<bool> is_written[4096];  // by line, of all files
  std::atomic<bool>& is_line_written = is_written[line % 4096];
  if (is_line_written.load(std::memory_order_relaxed)) return;
  is_line_written.store(true, std::memory_order_relaxed);
  __real__mark_point(file, line);
}
