// The end of a command that goes on until Ctrl-C.
#pragma once

#include <poll.h>
#include <signal.h>
#include <sys/eventfd.h>
#include <unistd.h>

#include <array>
#include <cerrno>
#include <cmath>
#include <cstdint>
#include <cstdio>
#include <ctime>
#include <stdexcept>

// While it exists, the signals that end a program end nothing: wait() tells of them. So the program always sets the force
// to 0 and restores the terminal. These are handlers, as a mask would not hold for the threads that a driver has started.
// A signal that wait() has not told of has its usual effect at the end of this object; SIGPIPE has none. One object at a time.
class Ending {
 public:
  Ending() {
    if (event_ < 0) event_ = eventfd(0, EFD_CLOEXEC | EFD_NONBLOCK);
    if (event_ < 0) throw std::runtime_error("there is no file descriptor left to wait for signals with");
    came_ = 0;
    std::uint64_t told = 0;
    if (read(event_, &told, sizeof told) < 0) {
    }  // nothing came before
    struct sigaction action{};
    action.sa_handler = [](int signal) {
      if (signal != SIGPIPE) came_ = signal;  // a write that failed tells of SIGPIPE
      const int before = errno;
      const std::uint64_t one = 1;
      if (write(event_, &one, sizeof one) < 0) {
      }  // it is full: it has told already
      errno = before;
    };
    action.sa_flags = SA_RESTART;
    for (std::size_t i = 0; i < signals.size(); ++i) {
      sigaction(signals[i], nullptr, &before_[i]);
      const bool stays_ignored = signals[i] == SIGHUP && before_[i].sa_handler == SIG_IGN;  // nohup
      if (!stays_ignored) sigaction(signals[i], &action, nullptr);
    }
  }
  Ending(const Ending&) = delete;
  Ending& operator=(const Ending&) = delete;
  ~Ending() {
    for (std::size_t i = 0; i < signals.size(); ++i) sigaction(signals[i], &before_[i], nullptr);
    if (came_ && !is_told_) {
      std::fflush(nullptr);
      raise(came_);
    }
  }
  bool wait(double seconds) const {  // true: a signal has asked us to end
    const timespec time = {time_t(seconds), long((seconds - std::floor(seconds)) * 1e9)};
    pollfd asked = {event_, POLLIN, 0};
    ppoll(&asked, 1, &time, nullptr);  // any signal ends it
    is_told_ = poll(&asked, 1, 0) > 0;
    return is_told_;
  }

 private:
  static constexpr std::array<int, 5> signals = {SIGINT, SIGTERM, SIGHUP, SIGPIPE, SIGXCPU};
  static inline int event_ = -1;
  static inline volatile sig_atomic_t came_ = 0;  // the last signal other than SIGPIPE
  mutable bool is_told_ = false;
  std::array<struct sigaction, signals.size()> before_;
};
