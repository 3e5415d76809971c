// How the library's own threads begin, whatever the application has set up.
//
// A thread started while a SignalsBlocked exists has the application's signals blocked, because the application's
// handlers may lock and allocate.
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

// Default floating-point arithmetic, as in the library's own threads, as long as this lives: a caller's thread may round differently,
// or want a signal at a division by 0.
class DefaultArithmetic {
 public:
  DefaultArithmetic() noexcept {
    std::fegetenv(&before_);
    std::fesetenv(FE_DFL_ENV);
  }
  ~DefaultArithmetic() { std::fesetenv(&before_); }
  DefaultArithmetic(const DefaultArithmetic&) = delete;
  DefaultArithmetic& operator=(const DefaultArithmetic&) = delete;

 private:
  std::fenv_t before_{};
};

// Called first in each thread. It restores default floating-point arithmetic: the thread that started this one may
// round differently, flush subnormal numbers to 0 or trap overflows.
inline void begin_thread(const char* name) noexcept {
  pthread_setname_np(pthread_self(), name);
  std::fesetenv(FE_DFL_ENV);
}

}  // namespace fs
