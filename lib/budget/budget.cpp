#include "budget/budget.h"

#include <algorithm>
#include <chrono>
#include <numeric>
#include <system_error>

#include <pthread.h>
#include <time.h>

#include "base/clock.h"
#include "base/error.h"
#include "base/signals.h"
#include "budget/fair.h"

namespace fs {

// Splits the limit of the loop among scenes, by what each wants: those that want least get it, the others equal parts of what
// is left. If all get what they want, what is left is split, too, so that one may want more at any time. The damping is split
// equally among those that have some.
static std::vector<DeviceLimit> split(const DeviceLimit& limit, const std::vector<SceneWant>& wants) {
  if (wants.size() == 1) return {limit};
  std::vector<double> sorted;
  for (const SceneWant& want : wants) sorted.push_back(std::min(want.stiffness, limit.stiffness));
  const double bound = fair_bound(sorted, limit.stiffness);
  const double left = std::max(0.0, limit.stiffness - std::accumulate(sorted.begin(), sorted.end(), 0.0));
  const auto scenes = static_cast<double>(wants.size());
  const auto count = [&](auto&& is_so) { return static_cast<double>(std::count_if(wants.begin(), wants.end(), is_so)); };
  const double stiff = count([](const SceneWant& want) { return want.stiffness > 0; });
  const double damped = count([](const SceneWant& want) { return want.has_damping; });
  std::vector<DeviceLimit> out(wants.size(), limit);
  for (size_t i = 0; i < wants.size(); ++i) {
    const double want = wants[i].stiffness;
    const double part = bound < never ? std::min(want, bound) : std::min(want, limit.stiffness) + left / scenes;
    // One that wants none yet may at any time, and gets less as soon as it does.
    out[i].stiffness = want > 0 ? part : std::max(part, limit.stiffness / (stiff + 1));
    out[i].damping /= wants[i].has_damping ? damped : damped + 1;
  }
  return out;
}

// False: nothing is bounded.
static bool is_finite(const DeviceLimit& limit) { return limit.stiffness < never || limit.damping < never; }

static std::vector<SceneWant> wants_of(const Budget::Scenes& scenes) {
  std::vector<SceneWant> out;
  for (const Ref<SceneBudget>& scene : scenes) out.push_back(scene->wanted());
  return out;
}

bool Budget::run_once() noexcept {
  const DefaultArithmetic here;  // this may be the thread of a caller
  bool has_worked = false;
  try {
    const std::lock_guard lock(running_);
    const DeviceLimit limit = limit_();
    if (!is_finite(limit)) return false;
    const Scenes scenes = scenes_();
    for (int i = 0; i < 2; ++i) {
      const std::vector<SceneWant> wants = wants_of(scenes);
      const std::vector<DeviceLimit> limits = split(limit, wants);
      for (size_t k = 0; k < scenes.size(); ++k) has_worked |= scenes[k]->update(limits[k], ahead_, rest_);
      if (wants_of(scenes) == wants) break;
    }
  } catch (...) {  // no memory: the bounds stay as they are until the next time
  }
  return has_worked;
}

void Budget::add(SceneBudget& scene) {
  std::vector<SceneWant> wants = wants_of(scenes_());
  const std::lock_guard lock(running_);
  const DeviceLimit limit = limit_();
  wants.push_back({});
  if (is_finite(limit)) scene.update(split(limit, wants).back(), ahead_, rest_);
}

static double processor_time() noexcept {  // s, of the calling thread
  timespec time{};
  clock_gettime(CLOCK_THREAD_CPUTIME_ID, &time);
  return static_cast<double>(time.tv_sec) + 1e-9 * static_cast<double>(time.tv_nsec);
}

void Budget::start() {
  run_once();
  try {
    const SignalsBlocked blocked;
    thread_ = std::thread([this] {
      begin_thread("fs-budget");
      const sched_param ordinary{};
      pthread_setschedparam(pthread_self(), SCHED_OTHER, &ordinary);  // the starter may have been a real-time thread
      double last = steady_now();
      std::unique_lock lock(mutex_);
      while (!stopping_.wait_for(lock, std::chrono::duration<double>(interval), [this] { return is_stopping_; })) {
        lock.unlock();
        const double begin = processor_time(), late = steady_now() - last - interval;
        const bool has_worked = run_once();
        const double cost = processor_time() - begin;
        last = steady_now();
        constexpr double less = 0.99;  // from one turn to the next, where there was nothing to do
        rest_ = has_worked ? 9 * cost : less * rest_;  // a tenth of a processor; that the thread had to wait does not count
        ahead_ = std::min(most_ahead, std::max(interval + std::max({interval, rest_ / 4.5, 2 * late}), less * ahead_));
        lock.lock();
      }
    });
  } catch (const std::system_error& error) {
    fail_to_start("the thread that bounds the stiffness", error.what());
  }
}

void Budget::stop() noexcept {
  if (process_ != this_process()) {  // the thread stays with the parent
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
