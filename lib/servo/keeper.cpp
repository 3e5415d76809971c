#include "servo/keeper.h"

#include <algorithm>
#include <chrono>
#include <system_error>

#include <pthread.h>

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

void Keeper::start() {
  run_once();
  try {
    const SignalsBlocked blocked;
    thread_ = std::thread([this] {
      begin_thread("fs-keeper");
      const sched_param ordinary{};
      pthread_setschedparam(pthread_self(), SCHED_OTHER, &ordinary);  // the starter may have been a real-time thread
      using Clock = std::chrono::steady_clock;
      std::chrono::duration<double> pause(0.04);
      std::unique_lock lock(mutex_);
      while (!stopping_.wait_for(lock, pause, [this] { return is_stopping_; })) {
        lock.unlock();
        const auto begin = Clock::now();
        run_once();
        // A tenth of a processor at most. In steps of 2, as another time ahead is other work.
        const double took = std::chrono::duration<double>(Clock::now() - begin).count();
        pause = std::chrono::duration<double>(std::max(0.04, 9 * took));
        while (ahead_ < 1.5 * pause.count()) ahead_ = 2 * ahead_;
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
