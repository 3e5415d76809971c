// Long work checks at every step whether it is to stop, so that it ends within about a millisecond. Another thread
// can also see how far it is.
#pragma once

#include <algorithm>
#include <atomic>
#include <cstdint>

namespace fs {

struct Stopped {};  // thrown where nobody wants the work any more

class StopToken {
 public:
  StopToken() = default;  // never to stop
  explicit StopToken(const std::atomic<bool>& is_stopped) : is_stopped_(&is_stopped) {}

  // Called at each step of the work; a step is a bounded amount, such as a few comparisons or copies.
  void check() {
    if (++steps_ % 1024 != 0) return;
    if (is_stopped()) throw Stopped{};
    show_part(static_cast<double>(steps_ - part_first_) / part_steps_);
  }
  bool is_stopped() const noexcept { return is_stopped_ && is_stopped_->load(std::memory_order_relaxed); }
  uint64_t steps() const noexcept { return steps_; }  // so far

  // From here on `progress` goes from 0 to 1 while the work is done part by part; null: nobody is shown it.
  void show(std::atomic<double>* progress) noexcept {
    progress_ = progress;
    part_end_ = 0;
  }
  // The next part begins, which takes about this many steps; after it the fraction `end` of the work is done.
  void begin_part(double end, double steps) noexcept {
    part_begin_ = part_end_;
    part_end_ = end;
    part_first_ = steps_;
    part_steps_ = std::max(steps, 1.0);
    show_part(0);
  }
  // How much of the part is done, 0..1, where that is known better than by its steps. It never falls.
  void show_part(double done) noexcept {
    if (progress_) progress_->store(part_begin_ + (part_end_ - part_begin_) * std::min(done, 1.0), std::memory_order_relaxed);
  }

 private:
  const std::atomic<bool>* is_stopped_ = nullptr;
  std::atomic<double>* progress_ = nullptr;
  uint64_t steps_ = 0, part_first_ = 0;
  double part_begin_ = 0, part_end_ = 0, part_steps_ = 1;
};

}  // namespace fs
