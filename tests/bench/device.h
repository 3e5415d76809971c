// The device "bench:", which takes hardly any time and notes when another force arrives. There is one per process.
#pragma once

#include <sys/types.h>

#include <cstdint>
#include <vector>

#include <forceserver/driver.h>

namespace bench {

struct Arrival {
  int64_t time;       // ns, monotonic: when write was called
  fs_vec3 force;      // N, other than the force before
};

fs_device* open_bench_device();     // 1000 Hz, 10 N, the hand at rest in the origin
pid_t servo_thread();               // of the last write; 0: none yet
int64_t processor_time(pid_t thread);  // ns, that a thread of this process has used
std::vector<Arrival> take_arrivals();  // the first 65536 since the device was opened; only when the servo has stopped

}  // namespace bench
