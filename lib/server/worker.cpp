#include "server/worker.h"

#include <pthread.h>

#include <system_error>
#include <utility>

#include "base/error.h"
#include "base/signals.h"

namespace fs {

Worker::Worker(const char* thread_name, std::function<void()> notify) : thread_name_(thread_name), notify_(std::move(notify)) {
  const SignalsBlocked blocked;
  try {
    thread_ = std::thread([this] { run(); });
  } catch (const std::system_error& error) {
    fail_to_start("the server's worker thread", error.what());
  }
}

Worker::~Worker() {
  {
    const std::lock_guard lock(mutex_);
    is_stopping_ = true;
    is_stopped_ = true;
  }
  changed_.notify_one();
  thread_.join();
}

void Worker::add(Job job) {
  {
    const std::lock_guard lock(mutex_);
    jobs_[job.owner].push_back(std::move(job));
  }
  changed_.notify_one();
}

void Worker::forget(uint64_t owner) noexcept {
  std::list<Job> forgotten;  // destroyed without the lock
  const std::lock_guard lock(mutex_);
  if (working_for_ == owner) is_stopped_ = true;
  const auto found = jobs_.find(owner);
  if (found == jobs_.end()) return;
  forgotten.swap(found->second);
  jobs_.erase(found);
}

std::list<Worker::Job> Worker::take_done() {
  const std::lock_guard lock(mutex_);
  return std::exchange(done_, {});
}

void Worker::run() {
  begin_thread(thread_name_);
  uint64_t last = 0;
  std::unique_lock lock(mutex_);
  for (;;) {
    changed_.wait(lock, [this] { return is_stopping_ || !jobs_.empty(); });
    if (is_stopping_) return;
    auto next = jobs_.upper_bound(last);
    if (next == jobs_.end()) next = jobs_.begin();
    last = working_for_ = next->first;
    is_stopped_ = false;
    std::list<Job> job;  // moved from list to list: that takes no memory, which there may be none of
    job.splice(job.end(), next->second, next->second.begin());
    if (next->second.empty()) jobs_.erase(next);
    lock.unlock();
    StopToken stop(is_stopped_);
    job.front().work(stop);
    job.front().work = nullptr;
    lock.lock();
    working_for_ = 0;
    done_.splice(done_.end(), job);
    lock.unlock();
    notify_();
    lock.lock();
  }
}

}  // namespace fs
