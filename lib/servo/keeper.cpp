#include "servo/keeper.h"

#include <algorithm>
#include <chrono>
#include <system_error>

#include <pthread.h>
#include <time.h>

#include "base/clock.h"
#include "base/error.h"
#include "base/signals.h"
#include "servo/servo.h"

namespace fs {

// Divides what the loop can render equally among so many scenes.
LoopShare Keeper::part_of(size_t scenes) const noexcept {
  const auto count = static_cast<double>(std::max<size_t>(1, scenes));
  LoopShare part = loop_;
  part.stiffness /= count;
  part.damping /= count;
  return part;
}

static size_t count_wanting(const std::vector<Ref<Channel>>& channels) {
  return static_cast<size_t>(std::count_if(channels.begin(), channels.end(), [](const Ref<Channel>& channel) {
    return channel->scene().bounding.wants_stiffness();
  }));
}

bool Keeper::run_once() noexcept {
  bool has_worked = false;
  try {
    const std::vector<Ref<Channel>> channels = servo_.channels().present();
    const std::lock_guard lock(sharing_);
    for (int i = 0; i < 2; ++i) {
      const size_t count = count_wanting(channels);
      for (const Ref<Channel>& channel : channels) {
        Bounding& bounding = channel->scene().bounding;
        // One that wants none yet may at any time.
        has_worked |= bounding.update(part_of(bounding.wants_stiffness() ? count : count + 1), ahead_, rest_);
      }
      if (count_wanting(channels) == count) break;
    }
  } catch (...) {  // no memory: the bounds stay as they are until the next time
  }
  return has_worked;
}

void Keeper::admit(LocalScene& scene) {
  const std::vector<Ref<Channel>> channels = servo_.channels().present();
  const std::lock_guard lock(sharing_);
  scene.bounding.update(part_of(count_wanting(channels) + 1), ahead_, rest_);
}

static double processor_time() noexcept {  // s, of the calling thread
  timespec time{};
  clock_gettime(CLOCK_THREAD_CPUTIME_ID, &time);
  return static_cast<double>(time.tv_sec) + 1e-9 * static_cast<double>(time.tv_nsec);
}

void Keeper::start() {
  run_once();
  try {
    const SignalsBlocked blocked;
    thread_ = std::thread([this] {
      begin_thread("fs-keeper");
      const sched_param ordinary{};
      pthread_setschedparam(pthread_self(), SCHED_OTHER, &ordinary);  // the starter may have been a real-time thread
      double last = steady_now();
      std::unique_lock lock(mutex_);
      while (!stopping_.wait_for(lock, std::chrono::duration<double>(turn), [this] { return is_stopping_; })) {
        lock.unlock();
        const double begin = processor_time(), late = steady_now() - last - turn;
        const bool has_worked = run_once();
        const double cost = processor_time() - begin;
        last = steady_now();
        constexpr double less = 0.99;  // from one turn to the next, where there was nothing to do
        rest_ = has_worked ? 9 * cost : less * rest_;  // a tenth of a processor; that the thread had to wait does not count
        ahead_ = std::min(most_ahead, std::max(turn + std::max({turn, rest_ / 4.5, 2 * late}), less * ahead_));
        lock.lock();
      }
    });
  } catch (const std::system_error& error) {
    fail(FS_ERROR_IO, "the thread that shares out the stiffness could not be started: %s", error.what());
  }
}

void Keeper::stop() noexcept {
  if (!servo_.is_of_this_process()) {  // the thread stays with the parent
    if (thread_.joinable()) thread_.detach();
    return;
  }
  {
    const std::lock_guard lock(mutex_);
    is_stopping_ = true;
  }
  stopping_.notify_all();
  if (thread_.joinable()) thread_.join();
}

}  // namespace fs
