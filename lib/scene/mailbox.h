// The latest value from one writer to one reader: three slots and one atomic exchange, no locks, nothing torn. The writer
// frees what the reader let go.
#pragma once

#include <array>
#include <atomic>
#include <cstdint>
#include <utility>

namespace fs {

template <class T>
class Mailbox {
 public:
  // The writer's. Afterwards the slot that came back is emptied, so that old values are freed here and at once.
  void post(T value) {
    slots_[back_] = std::move(value);
    back_ = middle_.exchange(static_cast<uint8_t>(back_ | fresh), std::memory_order_acq_rel) & index;
    slots_[back_] = T();
  }

  // [rt] The reader's. True when there is a newer value in front().
  bool fetch() noexcept {
    if (!(middle_.load(std::memory_order_relaxed) & fresh)) return false;
    front_ = middle_.exchange(front_, std::memory_order_acq_rel) & index;
    return true;
  }
  const T& front() const noexcept { return slots_[front_]; }

  // When neither runs any more.
  void clear() { slots_ = {}; }

 private:
  static constexpr uint8_t index = 3, fresh = 4;
  std::array<T, 3> slots_;
  alignas(64) std::atomic<uint8_t> middle_{0};
  alignas(64) uint8_t back_ = 1;
  alignas(64) uint8_t front_ = 2;
};

}  // namespace fs
