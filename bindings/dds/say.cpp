#include "say.h"

#include <algorithm>
#include <chrono>
#include <cstdio>
#include <mutex>
#include <utility>

namespace bridge {
namespace {

// Whoever drags an object of another site, and whoever floods a room, does not fill a journal.
class Limit {
 public:
  // How many lines were left out since the last one; -1: this one is left out, too.
  int pass() {
    const auto now = std::chrono::steady_clock::now();
    allowance_ = std::min(most, allowance_ + a_second * std::chrono::duration<double>(now - last_).count());
    last_ = now;
    if (allowance_ < 1) {
      ++left_out_;
      return -1;
    }
    --allowance_;
    return std::exchange(left_out_, 0);
  }

 private:
  static constexpr double most = 40, a_second = 1;
  double allowance_ = most;
  std::chrono::steady_clock::time_point last_ = std::chrono::steady_clock::now();
  int left_out_ = 0;
};

void print(FILE* file, const char* before, std::string text) {
  static std::mutex mutex;
  static Limit limit;
  const std::lock_guard lock(mutex);
  const int left_out = limit.pass();
  if (left_out < 0) return;
  if (left_out > 0) std::fprintf(file, "%s(%d lines were left out)\n", before, left_out);
  for (char& c : text) {
    if (static_cast<unsigned char>(c) < 0x20 || c == 0x7f) c = '?';
  }
  std::fprintf(file, "%s%s\n", before, text.c_str());
  std::fflush(file);
}

}  // namespace

void say(const std::string& text) { print(stdout, "", text); }
void complain(const std::string& text) { print(stderr, "forceserver-bridge: ", text); }

}  // namespace bridge
