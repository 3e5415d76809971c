#include "worker.h"

#include <exception>

#include "say.h"

namespace bridge {

Worker::~Worker() {
  {
    const std::lock_guard lock(mutex_);
    is_ending_ = true;
  }
  changed_.notify_one();
  thread_.join();
}

void Worker::start(Job job) {
  {
    const std::lock_guard lock(mutex_);
    jobs_.push_back(std::move(job));
  }
  changed_.notify_one();
}

void Worker::run_done() {
  for (;;) {
    Done done;
    {
      const std::lock_guard lock(mutex_);
      if (done_.empty()) return;
      done = std::move(done_.front());
      done_.pop_front();
    }
    if (done) done();
  }
}

void Worker::run() {
  for (;;) {
    Job job;
    {
      std::unique_lock lock(mutex_);
      changed_.wait(lock, [this] { return is_ending_ || !jobs_.empty(); });
      if (is_ending_) return;
      job = std::move(jobs_.front());
      jobs_.pop_front();
    }
    Done done;
    try {
      done = job();
    } catch (const std::exception& error) {
      complain(error.what());
    }
    job = nullptr;  // what it holds is given back here, not under the lock
    {
      const std::lock_guard lock(mutex_);
      done_.push_back(std::move(done));
    }
    wake_();
  }
}

}  // namespace bridge
