// Bounds the slopes and the damping of a scene's objects, so that the loop of its servo can render their sum: works out the
// share of each object (admission.h), and has the servo evaluate the objects within it. The servo's keeper.h calls this.
#pragma once

#include <atomic>
#include <mutex>
#include <string>
#include <unordered_map>

#include "scene/admission.h"
#include "scene/evaluated.h"

namespace fs {

class Bounding {
 public:
  // mutex: the scene's.
  Bounding(std::mutex& mutex, Evaluated& evaluated) : mutex_(mutex), evaluated_(evaluated) {}

  // loop: what the servo leaves to this scene. An object that is set between two calls gets the bounds of an object alone.
  // Does nothing if nothing has changed since the last call. The shares are worked out without the lock, and entered with
  // it. One thread at a time; not [rt].
  void update(const LoopShare& loop);

  // Whether any object would make use of a share. Any thread.
  bool wants_stiffness() const noexcept { return wants_stiffness_.load(std::memory_order_relaxed); }
  // N/m at the device, what the scene allows itself; 0: no such bound. Any thread.
  void set_max_stiffness(double stiffness);

 private:
  // slope: N/m of the scene, as it is felt.
  void note_slope(const Object& object, double slope, double to_device, double time);

  std::mutex& mutex_;
  Evaluated& evaluated_;
  std::atomic<double> max_stiffness_{0};
  std::atomic<bool> wants_stiffness_{true};

  // What the last update went by.
  struct Seen {
    uint64_t sequence = 0;  // of the snapshot; 0: there was none
    LoopShare loop;
    double most = 0;            // N/m
    bool is_to_be_repeated = false;  // something moves, or is to be told later
  };
  Seen seen_;

  // What has been told of an object.
  struct Told {
    double slope;     // N/m at the device; of one that was not bounded before, what it wanted
    double time;      // s
    uint64_t update;  // the last that saw it
  };
  std::unordered_map<std::string, Told> told_;
  uint64_t updates_ = 0;
  bool has_untold_ = false;
  static constexpr int most_events = 20;  // a second
  int events_left_ = most_events;
  double events_since_ = -never;  // s
};

}  // namespace fs
