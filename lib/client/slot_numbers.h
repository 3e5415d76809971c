// Which slots of the inbox are taken. The lowest free slot is taken first, so that few pages of the inbox are in use.
#pragma once

#include <algorithm>
#include <cstdint>
#include <vector>

#include "transfer/wire.h"

namespace fs {

class SlotNumbers {
 public:
  explicit SlotNumbers(uint32_t count) : taken_(count) {}

  uint32_t take() noexcept {  // no_slot: none is free
    while (first_free_ < taken_.size() && taken_[first_free_]) ++first_free_;
    if (first_free_ == taken_.size()) return wire::no_slot;
    taken_[first_free_] = true;
    return static_cast<uint32_t>(first_free_);
  }
  void set(uint32_t number, bool is_taken) noexcept {
    taken_[number] = is_taken;
    if (!is_taken) first_free_ = std::min<size_t>(first_free_, number);
  }
  void give(uint32_t number) noexcept {
    if (number != wire::no_slot) set(number, false);
  }

 private:
  std::vector<bool> taken_;
  size_t first_free_ = 0;  // all before it are taken
};

}  // namespace fs
