// The end of a command that goes on until Ctrl-C.
#pragma once

#include <pthread.h>
#include <signal.h>

#include <cmath>
#include <ctime>

// Blocks the signals that end a program in every thread, and waits for them here. So nothing is interrupted half-way,
// and the program always sets the force to 0 and restores the terminal. It must exist before the program starts any
// thread; the library's own threads block these signals anyway.
class Ending {
 public:
  Ending() {
    sigemptyset(&signals_);
    for (int signal : {SIGINT, SIGTERM, SIGHUP, SIGPIPE}) sigaddset(&signals_, signal);
    pthread_sigmask(SIG_BLOCK, &signals_, nullptr);
  }
  bool wait(double seconds) const {  // true: a signal asked us to end
    const timespec time = {time_t(seconds), long((seconds - std::floor(seconds)) * 1e9)};
    return sigtimedwait(&signals_, nullptr, &time) > 0;
  }

 private:
  sigset_t signals_;
};
