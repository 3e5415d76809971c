// What the system grants to a thread that must not be late.
#pragma once

#include <forceserver/servo.h>

namespace fs {

bool may_use_processor(int cpu) noexcept;

// For the calling thread: SCHED_FIFO at priority, else a better nice value, else a timer slack of 1 ns; negative: none of
// these. cpu: the processor it stays on, negative: any. Returns what was reached, FIFO at most.
fs_realtime request_realtime(int priority, int cpu) noexcept;

}  // namespace fs
