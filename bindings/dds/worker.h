// One thread for what takes long: the bridge goes on meanwhile.
#pragma once

#include <condition_variable>
#include <deque>
#include <functional>
#include <mutex>
#include <thread>

namespace bridge {

class Worker {
 public:
  using Done = std::function<void()>;  // called by run_done, in the bridge's thread
  using Job = std::function<Done()>;   // called by the worker's thread; may throw, and then nothing more is called

  explicit Worker(std::function<void()> wake) : wake_(std::move(wake)), thread_([this] { run(); }) {}
  ~Worker();

  void start(Job job);  // jobs run in the order in which they were started
  void run_done();      // calls what the jobs that have ended returned

 private:
  void run();

  const std::function<void()> wake_;  // the bridge's thread
  std::mutex mutex_;
  std::condition_variable changed_;
  std::deque<Job> jobs_;
  std::deque<Done> done_;
  bool is_ending_ = false;
  std::thread thread_;
};

}  // namespace bridge
