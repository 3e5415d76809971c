// Calls that wait, cut so that close() and Ctrl-C end them.
#pragma once

#include <functional>

#include "structs.h"

namespace forceserver_python {

// The sentence about a slice, with the timeout of the whole wait.
inline std::string with_timeout(std::string text, double whole) {
  static const std::string word = "timeout ";
  char said[32];
  snprintf(said, sizeof said, "%g", whole);
  const size_t at = text.find(word);
  if (at == std::string::npos) return text;
  const size_t begin = at + word.size();
  return text.replace(begin, std::min(text.find(' ', begin), text.size()) - begin, said);
}

// A wait in slices: `call` waits for so long and gives its status; `done` says whether there is nothing to wait for any
// more. Each slice is a call of its own, so another thread or a signal's handler can close the handle.
template <class T, class Call, class Done>
void wait_in_slices(Handle& handle, double timeout, Call&& call, Done&& done) {
  using clock = std::chrono::steady_clock;
  const auto start = clock::now();
  for (double rest = timeout;;) {
    const double now = rest > 0.1 ? 0.1 : rest;
    fs_status status;
    {
      const Use<T> use(handle);
      status = without_gil([&] { return call(use, now); });
      if (status < 0 && status != FS_ERROR_TIMEOUT) check(status);
    }
    rest = timeout - std::chrono::duration<double>(clock::now() - start).count();
    if (done(status)) return;
    if (!(rest > 0)) {
      if (status < 0) raise(status, with_timeout(fs_last_error(), timeout));
      return;
    }
    check_signals();
  }
}

// A call that makes a handle and cannot be cut into slices runs in a thread of its own. After Ctrl-C that thread gives
// back what it has made.
template <class T>
py::object make_in_thread(std::function<fs_status(T**)> call, bool of_path = false) {
  struct Work {
    std::mutex mutex;
    std::condition_variable changed;
    bool done = false, given_up = false;
    fs_status status = FS_OK;
    std::string text;
    T* made = nullptr;
  };
  const auto work = std::make_shared<Work>();
  std::thread([work, call = std::move(call)] {
    T* made = nullptr;
    const fs_status status = call(&made);
    std::unique_lock lock(work->mutex);
    work->status = status;
    if (status < 0) work->text = fs_last_error();
    work->done = true;
    if (work->given_up) {
      lock.unlock();
      if (status >= 0) give_back(made);
      return;
    }
    work->made = made;
    work->changed.notify_all();
  }).detach();
  for (;;) {
    const bool done = without_gil([&] {
      std::unique_lock lock(work->mutex);
      return work->changed.wait_for(lock, slice, [&] { return work->done; });
    });
    if (done) break;
    try {
      check_signals();
    } catch (...) {
      std::unique_lock lock(work->mutex);
      work->given_up = true;
      T* made = work->done && work->status >= 0 ? work->made : nullptr;
      lock.unlock();
      if (made) give_back(made);
      throw;
    }
  }
  if (work->status < 0) raise(work->status, work->text, of_path);
  return new_handle(work->made);
}

// Builds the search tree in such a thread, which has a reference of its own: so the shape can be closed meanwhile.
inline py::object build(Handle& shape) {
  std::shared_ptr<fs_shape> kept;
  {
    const Use<fs_shape> use(shape);
    kept.reset(retained(static_cast<fs_shape*>(use)), fs_shape_destroy);
  }
  return make_in_thread<fs_shape>([kept](fs_shape**) { return fs_shape_build(kept.get()); });
}

// Steps a servo a few ticks at a time, so that Ctrl-C is heard and the servo can be closed, also by a signal's handler in
// this thread. What the last tick says counts.
inline void step(Handle& servo, uint64_t ticks) {
  using clock = std::chrono::steady_clock;
  do {
    {
      const Use<fs_servo> use(servo);
      const fs_status status = without_gil([&] {
        const auto end = clock::now() + slice;
        fs_status last;
        do {
          const uint64_t some = std::min<uint64_t>(ticks, 64);
          last = fs_servo_step(use, some);
          ticks -= some;
        } while (ticks > 0 && (last >= 0 || last == FS_ERROR_DISCONNECTED) && !servo.closing() && clock::now() < end);
        return last;
      });
      if (status < 0 && (ticks == 0 || status != FS_ERROR_DISCONNECTED)) check(status);
    }
    check_signals();
  } while (ticks > 0);
}

}  // namespace forceserver_python
