// A thread for what takes long (shapes and their trees), so that neither the servo nor the thread that takes moves waits.
// Owners that have jobs are served one after the other, a job each.
#pragma once

#include <atomic>
#include <condition_variable>
#include <functional>
#include <list>
#include <map>
#include <mutex>
#include <thread>

#include "base/stop_token.h"

namespace fs {

class Worker {
 public:
  struct Job {
    // Called by the worker's thread; must not throw. Long work looks at `stop` at every step.
    std::function<void(StopToken& stop)> work;
    std::function<void()> done;  // what the thread that asked does then
    uint64_t owner = 0;
  };

  // thread_name: a literal. notify: called by the worker's thread when something was done.
  Worker(const char* thread_name, std::function<void()> notify);
  ~Worker();  // drops the jobs that have not begun, and abandons the one that has

  void add(Job job);
  void forget(uint64_t owner) noexcept;  // drops its jobs; one that has begun is abandoned, and counts as done
  std::list<Job> take_done();

 private:
  void run();

  const char* const thread_name_;
  const std::function<void()> notify_;
  std::mutex mutex_;
  std::condition_variable changed_;
  std::map<uint64_t, std::list<Job>> jobs_;  // by owner
  std::list<Job> done_;
  uint64_t working_for_ = 0;               // the owner whose job has begun
  std::atomic<bool> is_stopped_{false};  // that job
  bool is_stopping_ = false;
  std::thread thread_;
};

}  // namespace fs
