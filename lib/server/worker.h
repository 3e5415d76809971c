// A thread for what takes long (shapes and their trees), so that neither the servo nor the thread that takes moves waits.
// Who has jobs is served in turn.
#pragma once

#include <condition_variable>
#include <functional>
#include <list>
#include <map>
#include <mutex>
#include <thread>

namespace fs {

class Worker {
 public:
  struct Job {
    std::function<void()> work;  // by the worker's thread; must not throw
    std::function<void()> done;  // what is left to be done by the thread that asked
  };

  // notify: called by the worker's thread when something was done.
  explicit Worker(std::function<void()> notify);
  ~Worker();  // drops the jobs that have not begun

  void add(uint64_t owner, Job job);
  void forget(uint64_t owner) noexcept;  // its jobs that have not begun
  std::list<Job> take_done();

 private:
  void run();

  const std::function<void()> notify_;
  std::mutex mutex_;
  std::condition_variable changed_;
  std::map<uint64_t, std::list<Job>> jobs_;  // by owner
  std::list<Job> done_;
  bool is_stopping_ = false;
  std::thread thread_;
};

}  // namespace fs
