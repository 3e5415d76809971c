// Bounds what is felt through a servo to the limit of its loop: splits the limit among its scenes, in a thread of its own, so that
// no tick waits for it.
#pragma once

#include <atomic>
#include <condition_variable>
#include <functional>
#include <mutex>
#include <thread>
#include <vector>

#include "base/process.h"
#include "budget/scene_budget.h"

namespace fs {

class Budget {
 public:
  using Scenes = std::vector<Ref<SceneBudget>>;
  // Both are called by whoever runs or adds. limit: gives what all scenes together may have at present. scenes: gives those that
  // the servo feels.
  Budget(std::function<DeviceLimit()> limit, std::function<Scenes()> scenes)
      : limit_(std::move(limit)), scenes_(std::move(scenes)) {}
  ~Budget() { stop(); }

  static constexpr double interval = 0.01;  // s, from one run to the next

  void start();  // IO: no thread; also runs once
  void stop() noexcept;  // when it returns, the thread has ended
  bool run_once() noexcept;  // false: there was nothing to be worked out
  void add(SceneBudget& scene);  // before the servo feels it: it is bounded from its first tick on

 private:
  const std::function<DeviceLimit()> limit_;
  const std::function<Scenes()> scenes_;
  const uint32_t process_ = this_process();
  std::mutex running_;
  static constexpr double most_ahead = 0.1;  // s
  std::atomic<double> ahead_{2 * interval}, rest_{0};  // s, see SceneBudget::update
  std::mutex mutex_;
  std::condition_variable stopping_;
  bool is_stopping_ = false;
  std::thread thread_;
};

}  // namespace fs
