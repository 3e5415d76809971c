// OpenHaptics prints to the standard output, where a program may write its results. While a Quiet exists, what is printed there goes
// to the standard error instead: that of the whole process, so it exists only while a device is opened or closed.
#pragma once

#include <fcntl.h>
#include <unistd.h>

#include <cstdio>
#include <mutex>

namespace fs::openhaptics {

class Quiet {
 public:
  Quiet() : lock_(mutex()) {
    std::fflush(stdout);
    kept_ = fcntl(STDOUT_FILENO, F_DUPFD_CLOEXEC, 3);  // OpenHaptics starts programs
    if (kept_ >= 0) dup2(STDERR_FILENO, STDOUT_FILENO);
  }
  ~Quiet() {
    if (kept_ < 0) return;
    std::fflush(stdout);
    dup2(kept_, STDOUT_FILENO);
    close(kept_);
  }
  Quiet(const Quiet&) = delete;
  Quiet& operator=(const Quiet&) = delete;

 private:
  static std::recursive_mutex& mutex() {
    static std::recursive_mutex it;
    return it;
  }
  std::lock_guard<std::recursive_mutex> lock_;
  int kept_ = -1;
};

}  // namespace fs::openhaptics
