// Serial numbers, from 1 on. None is used twice in a process, so they identify objects even after those are gone.
#pragma once

#include <atomic>
#include <cstdint>

namespace fs {

inline std::atomic<uint64_t> newest_serial{0};

inline uint64_t next_serial() noexcept { return newest_serial.fetch_add(1, std::memory_order_relaxed) + 1; }

// The last that was drawn. Where numbers are drawn under a lock, whoever has it knows that all up to this one were drawn before.
inline uint64_t last_serial() noexcept { return newest_serial.load(std::memory_order_relaxed); }

}  // namespace fs
