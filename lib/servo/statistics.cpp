#include "servo/statistics.h"

#include <cmath>

namespace fs {
namespace {

// Only one thread adds, so it needs no atomic addition.
void add(std::atomic<uint64_t>& count, bool is_one_more) noexcept {
  count.store(count.load(std::memory_order_relaxed) + is_one_more, std::memory_order_relaxed);
}

}  // namespace

void Statistics::note(const Tick& tick) noexcept {
  late_.add(tick.late, tick.time);
  compute_.add(tick.compute, tick.time);
  if (tick.number == 1) first_time_.store(tick.time, std::memory_order_relaxed);
  newest_time_.store(tick.time, std::memory_order_relaxed);
  ticks_.store(tick.number, std::memory_order_relaxed);
  add(device_errors_, tick.has_error);
  add(guarded_, tick.is_guarded);
  add(approximated_, tick.is_approximated);
  faults_.store(tick.faults, std::memory_order_relaxed);
  energy_.store(tick.energy, std::memory_order_relaxed);
}

void Statistics::tell(fs_servo_stats& out) const noexcept {
  const RollingHistogram::Percentiles late = late_.percentiles(), compute = compute_.percentiles();
  const double since = std::fmax(first_time_.load(), late.since), span = newest_time_.load() - since;
  out.faults = faults_.load();
  out.ticks = ticks_.load();
  out.rate = span > 0 ? static_cast<double>(late.count - (since > late.since)) / span : 0;
  out.energy = energy_.load();
  out.misses = misses_.load();
  out.device_errors = device_errors_.load();
  out.guarded = guarded_.load();
  out.approximated = approximated_.load();
  out.late_p50 = late.p50;
  out.late_p99 = late.p99;
  out.late_max = late.max;
  out.compute_p50 = compute.p50;
  out.compute_p99 = compute.p99;
  out.compute_max = compute.max;
}

}  // namespace fs
