#include "base/realtime.h"

#include <pthread.h>
#include <sched.h>
#include <sys/prctl.h>
#include <sys/resource.h>
#include <sys/syscall.h>
#include <unistd.h>

namespace fs {

bool may_use_processor(int cpu) noexcept {
  cpu_set_t set;
  return cpu < CPU_SETSIZE && sched_getaffinity(0, sizeof set, &set) == 0 && CPU_ISSET(static_cast<size_t>(cpu), &set);
}

fs_realtime request_realtime(int priority, int cpu) noexcept {
  if (cpu >= 0) {
    cpu_set_t set;
    CPU_ZERO(&set);
    CPU_SET(static_cast<size_t>(cpu), &set);
    pthread_setaffinity_np(pthread_self(), sizeof set, &set);
  }
  if (priority < 0) return FS_REALTIME_NONE;
  sched_param parameter{};
  parameter.sched_priority = priority;
  if (pthread_setschedparam(pthread_self(), SCHED_FIFO, &parameter) == 0) return FS_REALTIME_FIFO;
  prctl(PR_SET_TIMERSLACK, 1UL);
  const auto thread = static_cast<id_t>(syscall(SYS_gettid));
  if (setpriority(PRIO_PROCESS, thread, -15) == 0) return FS_REALTIME_NICE;
  return FS_REALTIME_NONE;
}

void end_realtime() noexcept {
  const sched_param parameter{};
  pthread_setschedparam(pthread_self(), SCHED_OTHER, &parameter);
  setpriority(PRIO_PROCESS, static_cast<id_t>(syscall(SYS_gettid)), 0);
}

}  // namespace fs
