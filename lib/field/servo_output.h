// What a servo's tick tells about one scene. It may lie in memory that a client maps read-only.
#pragma once

#include <atomic>

#include <forceserver/servo.h>

#include "base/seqlock.h"

namespace fs {

// The hand as the servo last saw it, in the scene's frame.
struct HandSample {
  fs_state state;
  fs_response response;  // of this scene alone
  fs_wrench sent;        // of all scenes, after the guard, along this scene's axes
};

// Only the tick writes it; attaching a servo writes the first values.
struct ServoOutput {
  std::atomic<double> time{0};    // s, of the newest tick: the clock of a virtual servo
  std::atomic<uint64_t> tick{0};  // the newest finished
  std::atomic<uint64_t> used{0};  // sequence of the snapshot it evaluated
  Latest<HandSample> hand;
};

}  // namespace fs
