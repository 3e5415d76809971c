// What one scene gives to the servo: its objects with the weights they have faded to, seen through its views (frame, tool,
// clutch) and turned into device axes.
#pragma once

#include "scene/evaluate.h"
#include "scene/scene.h"

namespace fs {

class Channel {
 public:
  Channel(Scene& scene, ServoLink& link) : scene_(scene), link_(link) {
    hand_.state.pose = hand_.response.proxy = identity_pose();
  }

  // [rt] Takes the newest snapshot; changes that it brings begin at `now`.
  void fetch(double now) noexcept;

  // [rt] The scene's response for the hand (device frame), in device axes. tick: the number of this one.
  fs_response evaluate(const fs_state& hand, double now, uint64_t tick) noexcept;

  // [rt] Instead of evaluate, when the device gave no pose.
  void lose_hand() noexcept;

  // [rt] Tells the scene of this tick. response_flags: what the guard added.
  void publish(const Wrench& sent, uint32_t response_flags, uint64_t tick) noexcept;

 private:
  fs_response evaluate_view(const Snapshot& snapshot, const View& view, double weight, bool is_current,
                            const fs_state& hand, double now, uint64_t tick) noexcept;

  Scene& scene_;
  ServoLink& link_;
  HandSample hand_{};
  Quat axes_ = identity_quat();  // scene to device, of the present view
};

// [rt] The hand in the scene's frame, and the scene's response in the device's.
fs_state to_scene(const fs_frame& frame, const fs_state& hand) noexcept;
fs_response to_device(const fs_frame& frame, const fs_response& response) noexcept;

}  // namespace fs
