// A value that one thread writes and any thread reads, without waiting on either side. After H. Boehm, "Can seqlocks
// get along with programming language memory models?" (MSPC 2012). Each word is loaded with acquire and stored with
// release, because the thread sanitizer does not understand fences.
#pragma once

#include <array>
#include <atomic>
#include <cstdint>
#include <cstring>
#include <type_traits>

namespace fs {

template <class T>
class Seqlock {
  static_assert(std::is_trivially_copyable_v<T> && sizeof(T) % 8 == 0);
  static constexpr size_t words = sizeof(T) / 8;

 public:
  // [rt] One writer. bytes: a multiple of 8; what comes after them is not written, and may be that of any value written before.
  void write(const T& value, size_t bytes = sizeof(T)) noexcept {
    const uint64_t sequence = sequence_.load(std::memory_order_relaxed);
    sequence_.store(sequence + 1, std::memory_order_relaxed);
    for (size_t i = 0; i < bytes / 8; ++i) {  // no whole copy first: copying a value just assembled stalls
      uint64_t word;
      std::memcpy(&word, reinterpret_cast<const char*>(&value) + 8 * i, sizeof word);
      words_[i].store(word, std::memory_order_release);
    }
    sequence_.store(sequence + 2, std::memory_order_release);
  }

  // [rt] 0 when nothing was ever written, or a write came in between; else the number of the write.
  uint64_t read(T& value) const noexcept {
    uint64_t copy[words];
    const uint64_t before = sequence_.load(std::memory_order_acquire);
    if (before == 0 || before & 1) return 0;
    for (size_t i = 0; i < words; ++i) copy[i] = words_[i].load(std::memory_order_acquire);
    if (sequence_.load(std::memory_order_relaxed) != before) return 0;
    std::memcpy(&value, copy, sizeof value);
    return before;
  }

 private:
  std::atomic<uint64_t> sequence_{0};
  std::array<std::atomic<uint64_t>, words> words_{};
};

// Two seqlocks, written alternately: one is complete at any time, even while the writer is delayed in the other.
template <class T>
class Latest {
 public:
  void write(const T& value, size_t bytes = sizeof(T)) noexcept {  // [rt] as Seqlock's
    const unsigned other = 1 - newest_.load(std::memory_order_relaxed);
    slots_[other].write(value, bytes);
    newest_.store(other, std::memory_order_release);
  }

  // [rt] False when nothing was ever written. (It would also be false if the writer wrote during each of a
  // hundred tries; a writer with any other work cannot do that.)
  bool read(T& value) const noexcept {
    for (int tries = 0; tries < 100; ++tries) {
      const unsigned newest = newest_.load(std::memory_order_acquire);
      // Looked at again: a value that has been written but is not the newest yet would make the next read go back.
      if (slots_[newest].read(value) && newest_.load(std::memory_order_acquire) == newest) return true;
    }
    return false;
  }

 private:
  std::array<Seqlock<T>, 2> slots_;
  std::atomic<unsigned> newest_{0};
};

}  // namespace fs
