// What the suite prints: one line for each check, and the counts at the end. A check that stands in pending.h is expected
// to fail until the protection that it names is there; it does not count as passed.
#pragma once

#include <atomic>
#include <cstdarg>
#include <cstdio>
#include <functional>
#include <string>
#include <thread>
#include <vector>

namespace stability {

std::string format(const char* pattern, ...) __attribute__((format(printf, 1, 2)));

class Report {
 public:
  void title(const std::string& text);
  void note(const std::string& text);
  // id: unique; text: what was expected and measured.
  void check(const std::string& id, bool is_right, const std::string& text);
  // Prints the counts; true when nothing failed.
  bool end() const;

 private:
  int passed_ = 0, failed_ = 0, pending_ = 0;
};

// Calls f(0) .. f(count - 1) on all processors.
template <class F>
void in_parallel(size_t count, F&& f) {
  std::atomic<size_t> next{0};
  const auto work = [&] {
    for (size_t i; (i = next++) < count;) f(i);
  };
  std::vector<std::thread> threads;
  for (unsigned i = 1; i < std::max(1u, std::thread::hardware_concurrency()); ++i) threads.emplace_back(work);
  work();
  for (std::thread& thread : threads) thread.join();
}

}  // namespace stability
