#include "servo/keeper.h"

#include <algorithm>
#include <chrono>
#include <system_error>

#include <pthread.h>
#include <time.h>

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
  part.ahead = ahead_;
  return part;
}

static size_t count_wanting(const std::vector<Ref<Channel>>& channels) {
  return static_cast<size_t>(std::count_if(channels.begin(), channels.end(), [](const Ref<Channel>& channel) {
    return channel->scene().bounding.wants_stiffness();
  }));
}

void Keeper::run_once() noexcept {
  try {
    const std::vector<Ref<Channel>> channels = servo_.channels().present();
    const std::lock_guard lock(sharing_);
    const size_t count = count_wanting(channels);
    for (const Ref<Channel>& channel : channels) {
      Bounding& bounding = channel->scene().bounding;
      bounding.update(part_of(bounding.wants_stiffness() ? count : count + 1));  // one that wants none yet may at any time
    }
  } catch (...) {  // no memory: the bounds stay as they are until the next time
  }
}

void Keeper::admit(LocalScene& scene) {
  const std::vector<Ref<Channel>> channels = servo_.channels().present();
  const std::lock_guard lock(sharing_);
  scene.bounding.update(part_of(count_wanting(channels) + 1));
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
      std::chrono::duration<double> pause(0.04);
      std::unique_lock lock(mutex_);
      while (!stopping_.wait_for(lock, pause, [this] { return is_stopping_; })) {
        lock.unlock();
        const double begin = processor_time();
        run_once();
        // A tenth of a processor at most; that the thread had to wait does not count.
        pause = std::chrono::duration<double>(std::max(0.04, 9 * (processor_time() - begin)));
        double ahead = shortest_ahead;  // doubled: where it changes, all is worked out anew
        while (ahead < 1.5 * pause.count()) ahead *= 2;
        ahead_ = ahead;
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
