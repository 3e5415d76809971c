// Hands the latest value from one writer to one reader through three slots and one atomic word, without locks. A value
// is never torn. The writer can take a value back until the reader has fetched it, and frees old values.
#pragma once

#include <array>
#include <atomic>
#include <cstdint>
#include <utility>

namespace fs {

template <class T>
class Mailbox {
 public:
  // Writer. True: the previous value was never fetched. Empties the slot that comes back, so old values are freed here.
  bool post(T value) {
    slots_[back_] = std::move(value);
    return swap_middle(back_ | fresh);
  }

  // Writer. Takes the newest value back. True: the reader had not fetched it, and now cannot.
  bool take_back() { return swap_middle(back_); }

  // Writer. Frees a value that the reader has replaced, without waiting for the next post.
  void tidy() {
    const uint8_t found = middle_.load(std::memory_order_acquire);
    if (!(found & fresh) && !(slots_[found] == T())) slots_[found] = T();  // the reader takes fresh ones only
  }

  // [rt] Reader. True: front() is a newer value now.
  bool fetch() noexcept {
    uint8_t found = middle_.load(std::memory_order_relaxed);
    for (int tries = 0; tries < 8 && found & fresh; ++tries) {  // it may be taken back, or be replaced, meanwhile
      if (!middle_.compare_exchange_strong(found, front_, std::memory_order_acq_rel, std::memory_order_relaxed)) continue;
      front_ = found & index;
      return true;
    }
    return false;
  }
  const T& front() const noexcept { return slots_[front_]; }

  // Sets front() before the reader runs.
  void prime(T value) { slots_[front_] = std::move(value); }

  // Empties all slots; neither side may run.
  void clear() { slots_ = {}; }

 private:
  static constexpr uint8_t index = 3, fresh = 4;

  bool swap_middle(int value) {
    const uint8_t before = middle_.exchange(static_cast<uint8_t>(value), std::memory_order_acq_rel);
    back_ = before & index;
    slots_[back_] = T();
    return before & fresh;
  }

  std::array<T, 3> slots_;
  alignas(64) std::atomic<uint8_t> middle_{0};
  alignas(64) uint8_t back_ = 1;
  alignas(64) uint8_t front_ = 2;
};

}  // namespace fs
