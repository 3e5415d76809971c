#include "base/process.h"

#include <pthread.h>

#include <atomic>

namespace fs {
namespace {

std::atomic<uint32_t> forks{0};  // number of forks from the first process to this one

[[maybe_unused]] const int is_watching = pthread_atfork([] { process_mutex().lock(); }, [] { process_mutex().unlock(); },
                                                        [] {
                                                          forks.fetch_add(1, std::memory_order_relaxed);
                                                          process_mutex().unlock();
                                                        });

}  // namespace

uint32_t this_process() noexcept { return forks.load(std::memory_order_relaxed); }

uint64_t this_thread() noexcept {
  static std::atomic<uint64_t> last{0};
  thread_local const uint64_t number = last.fetch_add(1, std::memory_order_relaxed) + 1;
  return number;
}

std::mutex& process_mutex() noexcept {
  static std::mutex& mutex = *new std::mutex;  // never destroyed: it is used while the process ends
  return mutex;
}

}  // namespace fs
