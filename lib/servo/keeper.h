// Shares out what the loop can render among the scenes of a servo, in a thread of its own, so that no tick waits for it.
#pragma once

#include <atomic>
#include <condition_variable>
#include <mutex>
#include <thread>

#include "scene/local_scene.h"

struct fs_servo;

namespace fs {

class Keeper {
 public:
  // loop: what all scenes together may have.
  Keeper(fs_servo& servo, const LoopShare& loop) : servo_(servo), loop_(loop) {}
  ~Keeper() { stop(); }

  static constexpr double turn = 0.01;  // s, from one run to the next

  void start();            // IO: no thread; also runs once
  void stop() noexcept;    // when it returns, the thread has ended
  bool run_once() noexcept;  // false: there was nothing to be worked out
  void admit(LocalScene& scene);  // before the servo feels it: it is bounded from its first tick on

 private:
  std::vector<LoopShare> parts_of(const std::vector<double>& wants) const;  // N/m, of each scene

  fs_servo& servo_;
  const LoopShare loop_;
  std::mutex sharing_;
  static constexpr double most_ahead = 0.1;        // s
  std::atomic<double> ahead_{2 * turn}, rest_{0};  // s, see Bounding::update
  std::mutex mutex_;
  std::condition_variable stopping_;
  bool is_stopping_ = false;
  std::thread thread_;
};

}  // namespace fs
