// What one scene gives to the servo: its objects with their weights, seen through its views (frame, tool, clutch) and
// turned into device axes. A servo has one for each scene that it evaluates.
#pragma once

#include "field/frame.h"
#include "scene/local_scene.h"

struct fs_servo;

namespace fs {

class Channel final : public Counted<Channel> {
 public:
  // What one scene may add to the sum.
  struct Limits {
    double force = never, torque = never;  // N, N m
  };

  // Gives the scene to the servo, which must live as long as the channel is attached. starts_in: see attach_servo. STATE.
  Channel(fs_servo& servo, Ref<LocalScene> scene, const Limits& limits, bool starts_in);
  ~Channel() { detach(); }

  // Takes the scene back, when the servo evaluates it no more. What was done already is not done again.
  void detach() noexcept;

  // From time `when` (s, scene's clock) on the whole scene fades out, for good; one without objects may go at once.
  // Any thread.
  void leave(double when) noexcept { leaves_at_.store(when, std::memory_order_release); }
  void leave_at_once() noexcept { is_gone_.store(true, std::memory_order_release); }
  void end_lease(double now) noexcept {  // it leaves now, unless it has before
    if (const double when = leaves_at_.load(std::memory_order_relaxed); when > now) leave(now);
  }
  // It has faded out, and adds nothing any more: a tick says so. Any thread.
  bool is_gone() const noexcept { return is_gone_.load(std::memory_order_acquire); }  // [rt]

  // Any thread.
  // Its force was not finite, or took too long: it has none.
  bool is_bad() const noexcept { return is_bad_.load(std::memory_order_acquire); }
  uint64_t limited() const noexcept { return limited_.load(std::memory_order_relaxed); }  // ticks
  Wrench wrench() const noexcept;                                                         // as added at the last tick

  // [rt] Takes the newest snapshot, and moves the weights to `now`.
  void fetch(double now) noexcept;

  // [rt] The scene's response for the hand (device frame), in device axes, within the limits.
  fs_response evaluate(const fs_state& hand, double now) noexcept;

  // [rt] What evaluate took, s. One that makes every tick late by itself is taken out before the guard stops all force.
  void charge(double cost, double period) noexcept;

  // [rt] Instead of evaluate, when the device gave no pose.
  void lose_hand(double now) noexcept;

  // [rt] Tells the scene of this tick. response_flags: what the guard added. tick: its number.
  void publish(const Wrench& sent, uint32_t response_flags, uint64_t tick) noexcept;

 private:
  fs_response evaluate_views(const fs_state& hand, double now) noexcept;
  fs_response evaluate_view(const Snapshot& snapshot, uint32_t view, fs_state state, double weight, double now) noexcept;
  void limit(fs_response& device) noexcept;

  const Ref<LocalScene> scene_;
  const Limits limits_;
  const double fade_;  // s
  bool is_attached_ = true;
  std::atomic<double> leaves_at_{never};
  std::atomic<bool> is_gone_{false};

  // The servo's.
  ServoReader reader_;
  double weight_ = 1;        // of the whole scene
  double newest_time_ = -never;  // s, of the newest tick
  HandSample hand_{};
  TickSample tick_{};
  Quat axes_ = identity_quat();  // scene to device, of the present view
  std::atomic<bool> is_bad_{false};
  int slow_in_a_row_ = 0;
  std::atomic<uint64_t> limited_{0};
  Latest<Wrench> wrench_;
};

// The channels of a servo, immutable.
struct ChannelList : Counted<ChannelList> {
  std::vector<Ref<Channel>> channels;
};

}  // namespace fs
