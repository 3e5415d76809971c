// A client's work on the server's thread is a coroutine. It runs until its slice of time is over, until it has nothing more to
// do, or until others are done with the scenes that it needs; then the server's loop goes on with the client that has used
// least of the thread, and does the turns that are due: no work keeps the moves of others from being taken and posted.
//
// Whose is a scene while work on it is suspended? Work that changes a client's scene in several steps has a claim on it
// (claims.h): until it ends, nobody else looks at that scene or changes it, its moves are not taken and it is not posted. Work
// claims all that it needs at once, so none waits while others wait for it.
// A client that is gone: its claims end at once, its coroutine is not resumed any more, and a worker destroys it: what a group
// has not committed is forgotten. A server that stops does the same for all.
// Usage: the loop measures each run of a coroutine, and adds that to what its client has used.
// Memory: the coroutine of a client is made with its session, and those of long work when it begins; where there is none,
// std::bad_alloc is thrown there, before anything is changed, and the client is dropped.
#pragma once

#include <coroutine>
#include <exception>
#include <utility>

#include "server/host.h"

namespace fs {

// A coroutine that runs at once, up to where it first waits; co_await it to go on when it is done.
class [[nodiscard]] Task {
 public:
  struct promise_type {
    struct Return {
      bool await_ready() noexcept { return false; }
      std::coroutine_handle<> await_suspend(std::coroutine_handle<promise_type> ended) noexcept {
        const std::coroutine_handle<> caller = ended.promise().caller;
        return caller ? caller : std::noop_coroutine();
      }
      void await_resume() noexcept {}
    };
    Task get_return_object() { return Task(std::coroutine_handle<promise_type>::from_promise(*this)); }
    std::suspend_never initial_suspend() noexcept { return {}; }
    Return final_suspend() noexcept { return {}; }
    void return_void() noexcept {}
    void unhandled_exception() noexcept { error = std::current_exception(); }

    std::coroutine_handle<> caller;  // that waits for the end; none: nobody does
    std::exception_ptr error;
  };

  Task(Task&& other) noexcept : coroutine_(std::exchange(other.coroutine_, nullptr)) {}
  Task& operator=(Task&&) = delete;
  ~Task() {
    if (coroutine_) coroutine_.destroy();
  }

  bool await_ready() const noexcept { return coroutine_.done(); }
  void await_suspend(std::coroutine_handle<> caller) noexcept { coroutine_.promise().caller = caller; }
  void await_resume() {
    if (coroutine_.promise().error) std::rethrow_exception(coroutine_.promise().error);
  }

 private:
  explicit Task(std::coroutine_handle<promise_type> coroutine) : coroutine_(coroutine) {}
  std::coroutine_handle<promise_type> coroutine_;
};

// Where a client's work has stopped, and why.
class Work {
 public:
  enum class State {
    idle,     // there is nothing to do until something comes in
    ready,    // it can go on
    waiting,  // for scenes that others have claimed
  };

  explicit Work(const Host& host) : host_(host) {}
  Work(const Work&) = delete;
  Work& operator=(const Work&) = delete;

  State state() const noexcept { return state_; }
  void set_ready() noexcept { state_ = State::ready; }  // it no longer waits
  void resume() {
    state_ = State::ready;
    std::exchange(place_, nullptr).resume();
  }

  class Pause {
   public:
    Pause(Work& work, State state, bool is_skipped) : work_(work), state_(state), is_skipped_(is_skipped) {}
    bool await_ready() const noexcept { return is_skipped_; }
    void await_suspend(std::coroutine_handle<> place) noexcept {
      work_.place_ = place;
      work_.state_ = state_;
    }
    void await_resume() const noexcept {}

   private:
    Work& work_;
    const State state_;
    const bool is_skipped_;
  };
  Pause pause(State state) noexcept { return {*this, state, false}; }
  // Awaited after each step of long work: gives way to others when the slice is over. step() is for steps of about a microsecond,
  // and looks at the clock after a few of them; look() is for those that may take longer, such as a change of an object, whose
  // expression may have to be sampled.
  Pause step() noexcept { return {*this, State::ready, ++steps_ % few_steps != 0 || !host_.is_slice_over()}; }
  Pause look() noexcept { return {*this, State::ready, !host_.is_slice_over()}; }

 private:
  static constexpr size_t few_steps = 4;

  const Host& host_;
  std::coroutine_handle<> place_;
  State state_ = State::idle;
  size_t steps_ = 0;
};

}  // namespace fs
