// What a servo keeps from tick to tick of the views of a scene: the weight of each, and how it finds the hand in it. The
// weights move as those of objects do (weight.h); the scene reads what was found when the view changes or is asked for.
#pragma once

#include <array>

#include "base/seqlock.h"
#include "field/snapshot.h"

namespace fs {

// How the servo finds a view: where the clutch holds the tool, and where it has moved the frame.
struct FoundView {
  uint64_t version = 0;    // of the view
  uint64_t is_held = 0;    // `tool` is where the clutch holds it, in the scene
  uint64_t is_moved = 0;   // `frame` is the pose of the frame, else it is as given
  Pose tool = identity_pose(), frame = identity_pose();
};

class ViewMemory {
 public:
  // For the scene, under its lock.
  Weight& weight(uint32_t view) noexcept { return all_[view].weight; }
  // What the tick has found out about a view; false: no tick has used this version of it.
  bool get_found(uint32_t view, uint64_t version, FoundView& out) const noexcept;

  // Any thread. 0: no tick has begun this version of it.
  double weight_at(uint32_t view, uint64_t version) const noexcept;

  // [rt] For the reader. Moves the weights to `now`; fade: s, 0: at once.
  void advance(const Views& views, double now, double fade) noexcept;
  // [rt] Finds out where a view has the tool, with the hand at `hand` (device frame).
  const FoundView& find(const Views& views, uint32_t view, const Pose& hand) noexcept;

 private:
  struct One {
    Weight weight;
    uint64_t wanted = 0;  // the version that was looked at last
    bool going_in = false;
    FoundView found;
    Latest<FoundView> published;
  };

  std::array<One, Views::size> all_;
  double since_ = 0;  // s: the weights are those of this time
};

}  // namespace fs
