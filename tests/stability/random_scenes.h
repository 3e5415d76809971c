// Scenes that are made at random, the same for the same seed, on a device that is made at random too.
#pragma once

#include <cstdint>
#include <functional>
#include <string>

#include "plant/rig.h"
#include "scenes/random.h"

namespace stability {

// All that is felt in one run.
struct Situation {
  DeviceModel device;
  HandModel hand = nominal;
  double early = 2.5, late = 7, width = 1;  // s, of the windows in which the motion is looked at
  uint64_t seed = 0;                        // of the scene
  bool is_rich = false;                     // contacts, motion, frames, tools of several points, damping of objects
  uint32_t left_out = 0;                    // bits: objects that are removed before the start
};

// The device of the facts with a delay of 0, 1, 2 or 5 ms; 1 to 6 objects with profiles.
Situation simple_situation(uint64_t seed, const HandModel& hand);

// Devices of 0.05 to 1 kg at 500 Hz to 20 kHz with delays up to 20 ms, any hand or none; any scene.
Situation any_situation(uint64_t seed);

std::string described(const Situation& situation);

struct Outcome {
  bool oscillates = false;
  double swing = 0;     // m, peak to peak, in the late window
  uint32_t faults = 0;  // fs_fault bits at the end
  bool is_flung = false;  // nobody holds the handle, and what repels drives it away until it is too fast; it does not swing
  bool is_bad() const { return oscillates || (faults && !is_flung); }
};
// Runs it; all objects are at rest after 2 s. Something pushes the handle at 1.3 s. each: called before each tick, with the time.
Outcome run(const Situation& situation, const fs_servo_options& options,
            const std::function<void(Rig&, double)>& each = {});

// A simulated controller behind a link that takes local models (driver.h): delays to 50 ms, 25 to 500 models a second, devices of
// 0.05 to 1 kg, any hand or none; any scene, without a push.
std::string link_of(uint64_t seed);  // its URI
Outcome run_link(uint64_t seed, uint32_t left_out = 0, const std::function<void(fs_scene*, double)>& each = {});

}  // namespace stability
