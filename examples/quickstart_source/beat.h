// Keeps the steady rate of a loop that goes on until Ctrl-C.
#pragma once

#include <pthread.h>
#include <signal.h>

#include <algorithm>
#include <chrono>
#include <cmath>
#include <ctime>

// Blocks the signals that end a program, in this thread and in those that it starts afterwards. wait() looks at them,
// so the program ends only where it is ready to.
class Beat {
 public:
  Beat() {
    sigemptyset(&signals_);
    for (const int signal : {SIGINT, SIGTERM}) sigaddset(&signals_, signal);
    struct sigaction hang_up{};
    sigaction(SIGHUP, nullptr, &hang_up);
    if (hang_up.sa_handler != SIG_IGN) sigaddset(&signals_, SIGHUP);  // under nohup it stays ignored
    pthread_sigmask(SIG_BLOCK, &signals_, nullptr);
  }

  // Waits until `period` s after the previous beat. Returns false after Ctrl-C.
  bool wait(double period) {
    const auto now = std::chrono::steady_clock::now();
    next_ = std::max(next_ + std::chrono::microseconds(std::llround(period * 1e6)), now);
    const auto left = std::chrono::duration_cast<std::chrono::nanoseconds>(next_ - now).count();
    const timespec time = {time_t(left / 1000000000), long(left % 1000000000)};
    return sigtimedwait(&signals_, nullptr, &time) < 0;
  }

  // Whether Ctrl-C has come since the last wait.
  bool is_told_to_end() const {
    sigset_t pending;
    sigpending(&pending);
    return sigismember(&pending, SIGINT) || sigismember(&pending, SIGTERM) || sigismember(&pending, SIGHUP);
  }

 private:
  sigset_t signals_;
  std::chrono::steady_clock::time_point next_ = std::chrono::steady_clock::now();
};
