// Shares out what the loop can render among the scenes of a servo, in a thread of its own, so that no tick waits for it.
#pragma once

#include <condition_variable>
#include <mutex>
#include <thread>

#include "scene/admission.h"

struct fs_servo;

namespace fs {

class Keeper {
 public:
  // loop: what all scenes together may have.
  Keeper(fs_servo& servo, const LoopShare& loop) : servo_(servo), loop_(loop) {}
  ~Keeper() { stop(); }

  void start();            // IO: no thread; also runs once
  void stop() noexcept;    // when it returns, the thread has ended
  void run_once() noexcept;

 private:
  fs_servo& servo_;
  const LoopShare loop_;
  std::mutex mutex_;
  std::condition_variable stopping_;
  bool is_stopping_ = false;
  std::thread thread_;
};

}  // namespace fs
