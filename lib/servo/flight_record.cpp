#include "servo/flight_record.h"

#include <algorithm>

namespace fs {

void FlightRecord::add(const fs_tick& tick) noexcept {
  const uint64_t number = count_.load(std::memory_order_relaxed);
  slots_[number % slots_.size()].write({number, tick});
  count_.store(number + 1, std::memory_order_release);
}

size_t FlightRecord::read(fs_tick* out, size_t capacity) const {
  const uint64_t end = count_.load(std::memory_order_acquire);
  const uint64_t kept = std::min<uint64_t>(end, size_);
  const uint64_t wanted = std::min<uint64_t>(kept, capacity);
  size_t written = 0;
  for (uint64_t number = end - wanted; number < end; ++number) {
    Slot slot;
    if (!slots_[number % slots_.size()].read(slot) || slot.number != number) continue;  // overwritten meanwhile
    out[written++] = slot.tick;
  }
  return written < wanted ? written : static_cast<size_t>(kept);
}

}  // namespace fs
