// How late a servo is on this machine, beside a thread that only waits.
#pragma once

#include <forceserver/forceserver.h>

constexpr int servo_priority = 80;  // what a servo asks for, unless its options say otherwise

struct Late {
  double p50, p99, most;  // s, from the time at which a thread wanted to wake to when it did
};

struct Lateness {
  Late servo, idle;
  fs_servo_stats stats;  // of the servo, at its end
};

// Runs a servo at 1 kHz on the simulator, and at the same time a thread of the same priority that wakes as often and does
// nothing. seconds: at most 10.
Lateness measure_lateness(double seconds);
