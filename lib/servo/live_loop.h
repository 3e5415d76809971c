// The loop of a servo as it is at present: the delay that its device measures changes what it renders.
#pragma once

#include <atomic>
#include <string>

#include "base/seqlock.h"
#include "budget/limit.h"
#include "servo/loop_values.h"
#include "servo/measured_link.h"

namespace fs {

class LiveLoop {
 public:
  LiveLoop(const LoopOptions& options, const LoopValues& first, const fs_device_info& device);

  // Any thread.
  LoopValues values() const noexcept;
  fs_link link() const noexcept;  // as the driver measured it last; zeros: it did not

  // [rt] The tick's. True: out is another than before.
  bool fetch(LoopValues& out) noexcept;

  // One thread at a time; not [rt]. Asks the device how its link is, if that is due at time `now`, s. Returns why its answer was
  // refused (see MeasuredLink); empty: it was not.
  const std::string& measure(Device& device, double now);
  // What all scenes together may have. speed: m/s, the hand is never faster.
  DeviceLimit limit(const fs_device_info& device, double speed) const noexcept;

 private:
  const LoopOptions options_;
  MeasuredLink measured_;
  Latest<LoopValues> values_;
  Latest<fs_link> link_;
  std::atomic<uint64_t> count_{0};  // how often values_ has changed
  uint64_t fetched_ = 0;            // the tick's
};

}  // namespace fs
