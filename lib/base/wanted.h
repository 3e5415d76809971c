// Long work checks at every step whether it is still wanted, so that it can be abandoned within about a millisecond.
#pragma once

#include <atomic>
#include <cstdint>

namespace fs {

struct Abandoned {};  // thrown where nobody wants the work any more

class Wanted {
 public:
  Wanted() = default;  // never abandoned
  explicit Wanted(const std::atomic<bool>& is_abandoned) : is_abandoned_(&is_abandoned) {}

  // Called at each step of the work; a step is a bounded amount, such as a few comparisons or copies.
  void step() {
    if (++steps_ % 1024 == 0 && is_abandoned()) throw Abandoned{};
  }
  bool is_abandoned() const noexcept { return is_abandoned_ && is_abandoned_->load(std::memory_order_relaxed); }
  uint64_t steps() const noexcept { return steps_; }  // so far

 private:
  const std::atomic<bool>* is_abandoned_ = nullptr;
  uint64_t steps_ = 0;
};

}  // namespace fs
