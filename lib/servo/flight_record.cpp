#include "servo/flight_record.h"

#include <algorithm>

namespace fs {

void FlightRecord::add(const fs_tick& tick) noexcept {
  const uint64_t index = count_.load(std::memory_order_relaxed);
  slots_[index % slots_.size()].write({index, tick});
  count_.store(index + 1, std::memory_order_release);
}

size_t FlightRecord::count(uint64_t after, uint64_t end) const noexcept {
  return after < end ? static_cast<size_t>(std::min<uint64_t>(end - after, size_)) : 0;
}

size_t FlightRecord::count(uint64_t after) const noexcept { return count(after, count_.load(std::memory_order_acquire)); }

bool FlightRecord::read(uint64_t index, Sample& out) const noexcept {
  return slots_[index % slots_.size()].read(out) && out.index == index;
}

size_t FlightRecord::read(fs_tick* out, size_t capacity) const {
  const uint64_t end = count_.load(std::memory_order_acquire);
  const size_t kept = count(0, end), wanted = std::min(kept, capacity);
  size_t written = 0;
  for (uint64_t index = end - wanted; index < end; ++index) {
    Sample sample;
    if (read(index, sample)) out[written++] = sample.tick;
  }
  return written < wanted ? written : kept;
}

}  // namespace fs
