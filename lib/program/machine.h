// What the system tells of this machine and grants to this process. A function that returns text or a number throws
// std::runtime_error, with the reason, where the system does not tell it.
#pragma once

#include <cstdint>
#include <optional>
#include <string>

std::string text_of(const std::string& file);  // its first line

std::string kernel();
std::string distribution();
std::string processor();      // its model, and how many this process may use
std::string preemption();     // of the kernel
std::string governor();       // of the processors' frequency; of several that differ all
std::string container_kind();  // "": this is no container, as far as one can see

bool has_capability(int number);  // of this process, such as CAP_SYS_NICE

// What the system answers to a request; "": it is granted.
std::string refusal_of_fifo(int priority);     // of a thread with SCHED_FIFO
std::string refusal_of_lock(std::size_t bytes);  // of memory that is not paged out
std::string refusal_of_memfd();                // of shared memory
std::string refusal_of_pidfd();                // of being told when a process ends

// A limit of the control groups in which this process is. None: there is no limit.
struct MemoryLimit {
  std::uint64_t most, used;  // bytes
};
std::optional<MemoryLimit> memory_limit();
std::optional<double> processor_limit();  // processors' worth of time
