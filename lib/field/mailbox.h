// The latest value from one writer to one reader: three slots and one atomic word, no locks, nothing torn. What was posted
// can be taken back as long as it was not fetched. The writer frees what the reader let go.
#pragma once

#include <array>
#include <atomic>
#include <cstdint>
#include <utility>

namespace fs {

template <class T>
class Mailbox {
 public:
  // The writer's. True when the value before was never fetched. The slot that comes back is emptied, so that old values
  // are freed here and at once.
  bool post(T value) {
    slots_[back_] = std::move(value);
    return swap_middle(back_ | fresh);
  }

  // The writer's. Takes back what was posted last: true when it was not fetched, and now cannot be any more.
  bool take_back() { return swap_middle(back_); }

  // The writer's. What was posted last has not been fetched so far.
  bool is_unread() const noexcept { return middle_.load(std::memory_order_acquire) & fresh; }

  // The writer's. Frees what the reader has let go of, which would otherwise stay until the next post.
  void tidy() {
    const uint8_t found = middle_.load(std::memory_order_acquire);
    if (!(found & fresh) && !(slots_[found] == T())) slots_[found] = T();  // the reader takes fresh ones only
  }

  // [rt] The reader's. True when there is a newer value in front().
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

  // Before the reader runs: what it has until it fetches.
  void prime(T value) { slots_[front_] = std::move(value); }

  // When neither runs any more.
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
