// Asks the system for a priority for a thread that must not be late.
#pragma once

#include <forceserver/servo.h>

namespace fs {

bool may_use_processor(int cpu) noexcept;  // the calling thread

// For the calling thread, asks for SCHED_FIFO at `priority`; if that is refused, sets a timer slack of 1 ns and asks
// for a better nice value. A negative priority asks for nothing. cpu: the processor that the thread stays on; negative:
// any. Returns what was granted, FIFO at most.
fs_realtime request_realtime(int priority, int cpu) noexcept;

// Makes the calling thread an ordinary one again.
void end_realtime() noexcept;

}  // namespace fs
