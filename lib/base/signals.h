// How the library's own threads begin, in whatever process they are.
//
// While it lives, a thread that is started has the application's signals blocked: its handlers may lock and allocate.
#pragma once

#include <pthread.h>

#include <cfenv>
#include <csignal>

namespace fs {

class SignalsBlocked {
 public:
  SignalsBlocked() {
    sigset_t signals;
    sigfillset(&signals);
    for (const int fault : {SIGSEGV, SIGBUS, SIGFPE, SIGILL, SIGTRAP, SIGABRT}) sigdelset(&signals, fault);
    pthread_sigmask(SIG_SETMASK, &signals, &before_);
  }
  ~SignalsBlocked() { pthread_sigmask(SIG_SETMASK, &before_, nullptr); }
  SignalsBlocked(const SignalsBlocked&) = delete;
  SignalsBlocked& operator=(const SignalsBlocked&) = delete;

 private:
  sigset_t before_;
};

// First in each thread: numbers are worked out as everywhere, though the one that started it rounds otherwise, takes tiny
// numbers for 0, or has asked for a signal at an overflow.
inline void begin_thread(const char* name) noexcept {
  pthread_setname_np(pthread_self(), name);
  std::fesetenv(FE_DFL_ENV);
}

}  // namespace fs
