// The end of a command that goes on until Ctrl-C.
#pragma once

#include <pthread.h>
#include <signal.h>

#include <cmath>
#include <ctime>

// The signals that end a program are blocked in every thread and waited for here: nothing is interrupted in the middle,
// and what has to be put back (the force to 0, the terminal) always is. To be made before the first thread that may be
// interrupted: those of the library never are.
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
