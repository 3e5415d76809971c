// A thread for what takes long (shapes and their trees), so that neither the servo nor the thread that takes moves waits.
// Who has jobs is served in turn.
#pragma once

#include <condition_variable>
#include <deque>
#include <functional>
#include <map>
#include <mutex>
#include <thread>
#include <vector>

namespace fs {

class Worker {
 public:
  // What is left to be done by the thread that asked.
  using Done = std::function<void()>;
  using Job = std::function<Done()>;  // must not throw

  // notify: called by the worker's thread when something was done.
  explicit Worker(std::function<void()> notify);
  ~Worker();  // drops the jobs that have not begun

  void add(uint64_t owner, Job job);
  std::vector<Done> take_done();

 private:
  void run();

  const std::function<void()> notify_;
  std::mutex mutex_;
  std::condition_variable changed_;
  std::map<uint64_t, std::deque<Job>> jobs_;  // by owner
  std::vector<Done> done_;
  bool is_stopping_ = false;
  std::thread thread_;
};

}  // namespace fs
