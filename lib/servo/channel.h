// What one scene gives to the servo: its objects with the weights they have faded to, seen through its views (frame, tool,
// clutch) and turned into device axes. A servo has one for each scene that it evaluates.
#pragma once

#include "scene/evaluate.h"
#include "scene/local_scene.h"

struct fs_servo;

namespace fs {

class Channel final : public Counted<Channel>, public ServoLink {
 public:
  // What one scene may add to the sum.
  struct Limits {
    double force = never, torque = never;  // N, N m
  };

  // Gives the scene to the servo, which must live as long as the channel is attached. STATE.
  Channel(fs_servo& servo, Ref<LocalScene> scene, const Limits& limits);
  ~Channel() { detach(); }

  // Takes the scene back, when the servo evaluates it no more. What was done already is not done again.
  void detach() noexcept;

  // From time `when` (s, scene's clock) on the whole scene fades out, for good. Any thread.
  void leave(double when) noexcept { leaves_at_.store(when, std::memory_order_release); }
  void end_lease(double now) noexcept {  // it leaves now, unless it has before
    if (const double when = leaves_at_.load(std::memory_order_relaxed); when > now) leave(now);
  }
  // [rt] It has faded out, and adds nothing any more.
  bool is_gone(double now) const noexcept { return now > leaves_at_.load(std::memory_order_acquire) + fade; }

  // Any thread.
  // Its force was not finite, or took too long: it has none.
  bool is_bad() const noexcept { return is_bad_.load(std::memory_order_acquire); }
  uint64_t limited() const noexcept { return limited_.load(std::memory_order_relaxed); }  // ticks
  Wrench wrench() const noexcept;                                                         // as added at the last tick

  // [rt] Takes the newest snapshot; changes that it brings begin at `now`.
  void fetch(double now) noexcept;

  // [rt] The scene's response for the hand (device frame), in device axes, within the limits. tick: the number of this one.
  fs_response evaluate(const fs_state& hand, double now, uint64_t tick) noexcept;

  // [rt] What evaluate took, s. One that makes every tick late by itself is taken out before the guard stops all force.
  void charge(double cost, double period) noexcept;

  // [rt] Instead of evaluate, when the device gave no pose.
  void lose_hand() noexcept;

  // [rt] Tells the scene of this tick. response_flags: what the guard added.
  void publish(const Wrench& sent, uint32_t response_flags, uint64_t tick) noexcept;

  void get_stats(fs_servo_stats& out) const override;
  void get_device_info(fs_device_info& out) const override;
  bool take_event(fs_event& out) override;

 private:
  fs_response evaluate_views(const fs_state& hand, double now, uint64_t tick) noexcept;
  void limit(fs_response& device) noexcept;
  fs_response evaluate_view(const Snapshot& snapshot, const View& view, double weight, bool is_current,
                            const fs_state& hand, double now, uint64_t tick) noexcept;

  fs_servo& servo_;
  const Ref<LocalScene> scene_;
  const Limits limits_;
  bool is_attached_ = true;
  std::atomic<double> leaves_at_{never};
  uint64_t events_read_;  // of the servo's; under the scene's lock

  // The servo's.
  HandSample hand_{};
  Quat axes_ = identity_quat();  // scene to device, of the present view
  std::atomic<bool> is_bad_{false};
  int slow_in_a_row_ = 0;
  std::atomic<uint64_t> limited_{0};
  Latest<Wrench> wrench_;
};

// [rt] To the sum of all scenes.
void add(fs_response& sum, const fs_response& other) noexcept;

// The channels of a servo, immutable.
struct ChannelList : Counted<ChannelList> {
  std::vector<Ref<Channel>> channels;
};

// [rt] The hand in the scene's frame, and the scene's response in the device's.
fs_state to_scene(const fs_frame& frame, const fs_state& hand) noexcept;
fs_response to_device(const fs_frame& frame, const fs_response& response) noexcept;

}  // namespace fs
