// What the fuzzers share: bytes that are taken apart into values, and what must hold. A fuzzer is a function
// LLVMFuzzerTestOneInput, which libFuzzer calls with inputs of its own (run), and main.cpp with those of the corpus.
#pragma once

#include <sys/mman.h>
#include <unistd.h>

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <limits>
#include <span>
#include <string>
#include <string_view>

namespace fuzz {

// Ends the program: that is a fault.
inline void require(bool condition, const char* what, const char* detail = "") {
  if (condition) return;
  std::fprintf(stderr, "fault: %s %s\n", what, detail);
  std::abort();
}

// Takes values from the front of an input. What is missing is 0.
class Input {
 public:
  Input(const uint8_t* data, size_t size) : rest_(data, size) {}

  bool is_empty() const noexcept { return rest_.empty(); }
  std::span<const uint8_t> bytes(size_t most) noexcept {
    const std::span<const uint8_t> out = rest_.first(std::min(most, rest_.size()));
    rest_ = rest_.subspan(out.size());
    return out;
  }
  std::span<const uint8_t> rest() noexcept { return bytes(rest_.size()); }

  void fill(void* out, size_t size) noexcept {
    const std::span<const uint8_t> taken = bytes(size);
    if (!taken.empty()) std::memcpy(out, taken.data(), taken.size());
    if (taken.size() < size) std::memset(static_cast<uint8_t*>(out) + taken.size(), 0, size - taken.size());
  }
  template <class T>
  T take() noexcept {
    T out;
    fill(&out, sizeof out);
    return out;
  }
  uint8_t byte() noexcept { return take<uint8_t>(); }
  bool coin() noexcept { return byte() & 1; }
  unsigned below(unsigned count) noexcept { return byte() % count; }

  // One of the numbers at which code goes wrong, or a usual one, or any at all.
  double number() noexcept {
    constexpr double infinity = std::numeric_limits<double>::infinity();
    constexpr double hard[] = {0, -0.0, 1, -1, infinity, -infinity, std::numeric_limits<double>::quiet_NaN(),
                               std::numeric_limits<double>::max(), std::numeric_limits<double>::denorm_min(), 1e9, 1e-9, -1e9,
                               1e12, 1e300, -1e300, 1e-300};
    const uint8_t kind = byte();
    if (kind < 16) return hard[kind];
    if (kind < 32) return take<double>();
    if (kind < 48) return std::ldexp(static_cast<double>(take<int16_t>()), static_cast<int>(byte()) - 128);
    return (kind - 144) / 64.0;  // -1.5 to 1.75
  }
  // A coordinate, m: within 1e6 m, where forces are exact, or beyond 1e16 m, where it must be refused.
  double coordinate() noexcept {
    const double value = number();
    return std::fabs(value) > 1e6 && std::fabs(value) < 1e16 ? std::copysign(1e6, value) : value;
  }
  // One of the values of an enum, which go from 0 to `last`; now and then none of them.
  int32_t choice(int32_t last) noexcept {
    const uint8_t kind = byte();
    return kind < 240 ? kind % (last + 1) : kind < 248 ? last + kind - 239 : take<int32_t>();
  }
  std::string text(size_t most) {
    const std::span<const uint8_t> taken = bytes(std::min<size_t>(most, byte()));
    return {reinterpret_cast<const char*>(taken.data()), taken.size()};
  }
  std::string text_to_end() {
    const std::span<const uint8_t> taken = rest();
    return {reinterpret_cast<const char*>(taken.data()), taken.size()};
  }

 private:
  std::span<const uint8_t> rest_;
};

// A file in memory, for readers that want the name of one.
class MemoryFile {
 public:
  MemoryFile() : descriptor_(memfd_create("fuzz", MFD_CLOEXEC)) { require(descriptor_ >= 0, "no memory file"); }
  ~MemoryFile() { close(descriptor_); }
  MemoryFile(const MemoryFile&) = delete;
  MemoryFile& operator=(const MemoryFile&) = delete;

  std::string name() const { return "/proc/self/fd/" + std::to_string(descriptor_); }
  void put(std::string_view text) const {
    const bool is_done = ftruncate(descriptor_, 0) == 0 &&
                         pwrite(descriptor_, text.data(), text.size(), 0) == static_cast<ssize_t>(text.size());
    require(is_done, "no memory for a file");
  }

 private:
  int descriptor_;
};

}  // namespace fuzz
